from typing import Any

import numpy as np
import pytest

from bootifol.envs import camera
from bootifol.envs.pictures import PictureConfig, RenderProfile
from bootifol.errors import BootifolError
from bootifol.tasks import make_environment

pytestmark = pytest.mark.usefixtures("requires_rendering")

BALL_OVER_A_FLOOR = """
<mujoco>
  <visual><headlight ambient=".1 .1 .1" diffuse="0 0 0" specular="0 0 0"/></visual>
  <worldbody>
    <light pos="2 0 3" dir="-2 0 -3" directional="true" castshadow="true" diffuse=".7 .7 .7" specular="0 0 0"/>
    <camera name="above" pos="0 0 4" xyaxes="1 0 0 0 1 0"/>
    <geom type="plane" size="5 5 .1" rgba=".8 .8 .8 1"/>
    <geom type="sphere" size=".3" pos="0 0 1" rgba="1 0 0 1"/>
  </worldbody>
</mujoco>
"""


def picture_of_the_ball(profile: RenderProfile) -> np.ndarray:
    mujoco = camera.load_mujoco()
    model = mujoco.MjModel.from_xml_string(BALL_OVER_A_FLOOR)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    filming = camera.Camera(model, 64, profile)
    picture = filming.picture(data)
    filming.close()
    return picture


def floor(picture: np.ndarray) -> np.ndarray:
    """Brightness of the floor left of the ball, where its shadow falls."""
    return picture.mean(axis=2)[:, :22]


def test_shadows_are_drawn_unless_the_profile_is_fast() -> None:
    pictures: dict[RenderProfile, np.ndarray] = {
        profile: picture_of_the_ball(profile) for profile in ("fast", "balanced", "full")
    }
    for picture in pictures.values():
        assert (picture.shape, picture.dtype) == ((64, 64, 3), np.uint8)
        assert np.argmax(picture[32, 32]) == 0, "the ball is in the middle"
    assert np.ptp(floor(pictures["fast"])) < 12
    for profile in ("balanced", "full"):
        of_floor = floor(pictures[profile])
        assert of_floor.min() < 0.6 * of_floor.max()


def test_the_first_row_is_the_top() -> None:
    mujoco = camera.load_mujoco()
    model = mujoco.MjModel.from_xml_string(BALL_OVER_A_FLOOR.replace('pos="0 0 1"', 'pos="0 .8 .5"'))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    filming = camera.Camera(model, 32, "fast")
    red = filming.picture(data)[..., 0].astype(int) - filming.picture(data)[..., 1]
    filming.close()
    row, column = np.unravel_index(red.argmax(), red.shape)
    assert row < 14
    assert 12 < column < 20


def test_profiles_show_reacher_differently() -> None:
    frames = []
    for profile in ("fast", "balanced", "full"):
        environment = make_environment("reacher_hard", PictureConfig(32, 32, profile=profile), 1)
        frames.append(environment.reset(seed=5)[1]["frame"].astype(int))
        environment.close()
    for one, other in ((0, 1), (0, 2), (1, 2)):
        difference = np.abs(frames[one] - frames[other])
        assert difference.max() > 0
        assert difference.mean() < 60, "still the same scene"


def test_closing_one_environment_leaves_the_pictures_of_another_alone() -> None:
    first = make_environment("reacher_hard", PictureConfig(24, 24, profile="balanced"), 3)
    second = make_environment("reacher_hard", PictureConfig(32, 32), 3)
    before = second.reset(seed=1)[1]["frame"]
    assert np.ptp(before) > 50
    first.reset(seed=1)
    first.close()
    first.close()
    np.testing.assert_array_equal(second.reset(seed=1)[1]["frame"], before)
    second.close()


def test_a_machine_that_cannot_render_is_told_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_context(mujoco: Any) -> Any:
        raise RuntimeError("no display")

    monkeypatch.setattr(camera, "_context_class", no_context)
    monkeypatch.setenv("MUJOCO_GL", "egl")
    with pytest.raises(
        BootifolError, match=r"cannot render .*RuntimeError: no display.*apt-get install libegl1"
    ):
        make_environment("reacher_hard", PictureConfig(), 1)


def test_another_platform_than_egl_is_named_as_the_likely_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    assert "export MUJOCO_GL=egl" in str(camera.no_rendering(RuntimeError("no")))

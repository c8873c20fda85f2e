from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from small_demo_sets import FRAMES, SIZE, WriteSet, moving_videos

from bootifol.demos.check import Defects, check_demo_set
from bootifol.demos.contact_sheet import contact_sheet
from bootifol.demos.fit import differences
from bootifol.demos.manifest import Manifest, read_manifest, write_manifest
from bootifol.envs.pictures import PictureConfig
from bootifol.errors import BootifolError
from bootifol.tasks import task_named


def test_duplicates_and_frozen_videos_are_named(write_set: WriteSet) -> None:
    videos = moving_videos(6)
    videos[4] = videos[1]
    videos[2] = videos[2, :1]
    checked = check_demo_set(write_set(videos))
    assert checked.defects.duplicates == (("drawn-expert-000001", "drawn-expert-000004"),)
    assert checked.defects.frozen == ("drawn-expert-000002",)
    assert len(checked.defects.sentences()) == 2
    assert checked.bytes_on_disk == sum(
        path.stat().st_size for path in checked.contact_sheet.parent.glob("*.npy")
    )
    assert Image.open(checked.contact_sheet).format == "PNG"


def test_a_video_that_moves_in_one_pixel_is_not_frozen(write_set: WriteSet) -> None:
    videos = np.zeros((1, FRAMES, SIZE, SIZE, 3), np.uint8)
    videos[0, -1, 0, 0, 0] = 100
    assert check_demo_set(write_set(videos)).defects.frozen == ()


def test_videos_without_action_may_stand_still(write_set: WriteSet) -> None:
    videos = moving_videos(2)[:, :1].repeat(FRAMES, axis=1)
    assert check_demo_set(write_set(videos, behavior="still")).defects == Defects()


def test_padding_is_no_stillness(write_set: WriteSet) -> None:
    videos = moving_videos(3)
    videos[2, 2:] = videos[2, 1]
    directory = write_set(videos)
    assert check_demo_set(directory).defects.half_frozen == ("drawn-expert-000002",)
    manifest = read_manifest(directory)
    ended_early = replace(manifest.videos[2], length=2)
    write_manifest(directory, replace(manifest, videos=(*manifest.videos[:2], ended_early)))
    assert check_demo_set(directory).defects.half_frozen == ()


def test_an_expert_that_always_holds_its_goal_stands_still_honestly(write_set: WriteSet) -> None:
    videos = moving_videos(3)
    videos[:, 2:] = videos[:, 1:2]
    assert check_demo_set(write_set(videos)).defects.half_frozen == ()


def test_a_task_that_is_tiny_in_the_picture_is_told(write_set: WriteSet) -> None:
    small, large = np.zeros((2, 2, FRAMES, 64, 64, 3), np.uint8)
    size = {"video_size": 64, "agent_size": 64}
    for t in range(FRAMES):
        small[:, t, 30:32, 4 * t : 4 * t + 2] = 255
        large[:, t, 30:34, 4 * t : 4 * t + 4] = 255
    small[1, :, 0, 0], large[1, :, 0, 0] = 255, 255  # not the same video twice
    checked = check_demo_set(write_set(small, name="small", **size))
    assert checked.defects.little_motion == 8 / 64**2
    assert any(sentence.startswith("only 0.2% of the picture") for sentence in checked.defects.sentences())
    assert check_demo_set(write_set(large, name="large", **size)).defects.little_motion is None
    random = check_demo_set(write_set(small, name="random", behavior="random", **size))
    assert random.defects.little_motion is None, "what the expert does is what matters"


def test_many_groups_of_nearly_the_same_videos_are_one_sentence() -> None:
    groups = tuple((f"a{number}", f"b{number}") for number in range(4))
    assert len(Defects(near_duplicates=groups[:3]).sentences()) == 3
    [sentence] = Defects(near_duplicates=groups).sentences()
    assert sentence.startswith("8 videos look nearly like another, in 4 groups")


def test_an_imported_video_is_named_with_its_file(write_set: WriteSet) -> None:
    directory = write_set(moving_videos(1)[:, :1].repeat(FRAMES, axis=1))
    manifest = read_manifest(directory)
    entry = replace(manifest.videos[0], source={"file": "IMG_7.mov", "first_frame": 61})
    write_manifest(directory, replace(manifest, videos=(entry,)))
    [sentence] = check_demo_set(directory).defects.sentences()
    assert "drawn-expert-000000 (IMG_7.mov from frame 61 on): leave them out" in sentence


def test_damage_gives_a_sentence(write_set: WriteSet) -> None:
    directory = write_set(moving_videos(4))
    shard = directory / "shard-00001.npy"
    data = bytearray(shard.read_bytes())
    data[-1] ^= 1
    shard.write_bytes(data)
    with pytest.raises(
        BootifolError, match=r"shard-00001.npy is damaged: the pixels of drawn-expert-000003 "
    ):
        check_demo_set(directory)


@pytest.fixture
def fitting(write_set: WriteSet) -> Manifest:
    """A manifest of recorded videos that fit drawn_reach at 8 pixels."""
    return replace(read_manifest(write_set(moving_videos(1))), frames=31)


IMPORTED = {"task": None, "agent_size": None, "render_profile": None, "frames_per_second": 10.0}
EIGHT = PictureConfig(agent_size=8, video_size=8)
DRAWN_REACH = task_named("drawn_reach")


def test_fitting_videos_differ_in_nothing(fitting: Manifest) -> None:
    assert differences(fitting, DRAWN_REACH) == []
    assert differences(fitting, DRAWN_REACH, EIGHT) == []
    assert differences(replace(fitting, frames=62), DRAWN_REACH, EIGHT) == []


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"task": "reacher_hard"}, "show the task reacher_hard"),
        ({"action_repeat": 2}, "2 simulator steps after the other, and in drawn_reach it is 1"),
        (
            {"frames": 30},
            "30 frames and an episode of drawn_reach has 31: record them again with --episode-steps 30",
        ),
        (
            {"video_size": 16, "render_profile": "full"},
            "are 16×16 pixels where the run reads 8×8, and rendered with profile full where the run renders with fast: "
            "pass --pictures.video-size 16 --pictures.profile full, or record them again with "
            "--video-size 8 --agent-size 8 --profile fast",
        ),
        (
            {"agent_size": 16},
            "rendered at 16 pixels where the run renders at 8: pass --pictures.agent-size 16, or "
            "record them again with --video-size 8 --agent-size 8 --profile fast",
        ),
        (
            IMPORTED | {"video_size": 4},
            "4×4 pixels where the run reads 8×8: pass --pictures.video-size 4 --pictures.agent-size 4, or import them "
            "again with --size 8",
        ),
        (
            IMPORTED | {"video_size": 16},
            "pass --pictures.video-size 16, or",
        ),
        (IMPORTED | {"frames": 30}, "import them again with --frames 31"),
        (IMPORTED | {"frames_per_second": 25.0}, "25 pictures a second and drawn_reach shows 10"),
    ],
)
def test_each_difference_comes_with_what_to_do(
    fitting: Manifest, fields: dict[str, object], sentence: str
) -> None:
    found = differences(replace(fitting, **fields), DRAWN_REACH, EIGHT)  # type: ignore[arg-type]
    assert len(found) == 1
    assert sentence in found[0]


def test_a_contact_sheet_shows_a_video_a_row_from_first_to_last_frame() -> None:
    videos = np.zeros((2, 21, 96, 96, 3), np.uint8)
    videos += np.arange(21, dtype=np.uint8)[None, :, None, None, None] + np.array([0, 100], np.uint8).reshape(
        2, 1, 1, 1, 1
    )
    sheet = contact_sheet(videos, ["first", "second"], columns=3)
    assert sheet.shape == (2 * 118 + 4, 3 * 100 + 4, 3)
    middles = sheet[[66, 184]][:, [52, 152, 252], 0]
    assert middles.tolist() == [[0, 10, 20], [100, 110, 120]]
    assert (sheet[17, 4:100] < 200).all() and (sheet[18:114, 3] < 200).all(), "a border around every picture"
    names = [sheet[top : top + 17].min(axis=(1, 2)) for top in (0, 118)]
    assert all((rows < 50).any() for rows in names), "a name above every row"


def test_white_pictures_can_be_told_from_the_sheet() -> None:
    sheet = contact_sheet(np.full((1, 2, 96, 96, 3), 255, np.uint8), ["white"])
    assert (sheet[60, [3, 100, 103, 200]] < 200).all()


def test_short_videos_fill_fewer_columns() -> None:
    assert contact_sheet(np.zeros((1, 2, 96, 96, 3), np.uint8), ["short"], columns=10).shape == (122, 204, 3)


def test_a_contact_sheet_of_a_damaged_directory_is_not_written(write_set: WriteSet, tmp_path: Path) -> None:
    directory = write_set(moving_videos(2))
    (directory / "shard-00000.npy").unlink()
    with pytest.raises(BootifolError):
        check_demo_set(directory)
    assert not (directory / "contact_sheet.png").exists()

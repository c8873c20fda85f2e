"""Videos of the drawn task, disturbed in known ways, brought back toward its pictures."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from bootifol.cli.main import main
from bootifol.demos.demo_set import DemoSet
from bootifol.demos.import_videos import Conversion, import_videos
from bootifol.demos.manifest import read_manifest
from bootifol.demos.match_set import match_demo_sets, match_of
from bootifol.demos.matching import Match, Repair, difference, fit
from bootifol.demos.record import record
from bootifol.envs.pictures import PictureConfig
from bootifol.errors import BootifolError
from bootifol.tasks import task_named
from bootifol.types import FrameBatch, Frames

SIZES = PictureConfig(agent_size=32, video_size=32)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two behaviors of drawn_home."""
    out = tmp_path_factory.mktemp("demos")
    record("drawn_home", "expert", 12, out / "expert", SIZES)
    record("drawn_home", "random", 12, out / "random", SIZES, seed=2)
    return out


@pytest.fixture(scope="module")
def expert(recorded: Path) -> FrameBatch:
    return DemoSet.open(recorded / "expert").gather(range(12))


@pytest.fixture(scope="module")
def environment(recorded: Path) -> FrameBatch:
    return DemoSet.open(recorded / "random").gather(range(12))


def wider(videos: FrameBatch) -> FrameBatch:
    """From farther away, and not in the middle."""
    out = np.empty_like(videos)
    out[:] = videos[0, 0, 0, 0]
    for video, shown in zip(videos, out, strict=True):
        for frame, picture in zip(video, shown, strict=True):
            picture[2:28, 4:30] = np.asarray(Image.fromarray(frame).resize((26, 26), Image.Resampling.BOX))
    return out


def tinted(videos: FrameBatch) -> FrameBatch:
    levels = videos * np.array([1.2, 1.0, 0.8], np.float32) + 10
    return levels.clip(0, 255).round().astype(np.uint8)


def drifting(videos: FrameBatch) -> FrameBatch:
    gains = 1 + 0.15 * np.sin(np.linspace(0, 3, videos.shape[1], dtype=np.float32))
    return (videos * gains[:, None, None, None]).clip(0, 255).round().astype(np.uint8)


def fitted(videos: FrameBatch, environment: FrameBatch, *repairs: Repair) -> Match:
    acting = environment.reshape(-1, *environment.shape[2:])
    return fit(videos[:, 0], iter(videos), environment[:, 0], acting, repairs)


def error(left: Frames, right: Frames) -> float:
    return float(np.abs(left.astype(int) - right).mean())


def test_light_and_white_balance_are_taken_back(expert: FrameBatch, environment: FrameBatch) -> None:
    match = fitted(tinted(expert), environment, "colors")
    assert match.gain == pytest.approx([1 / 1.2, 1.0, 1 / 0.8], rel=0.05)
    assert error(match(tinted(expert)[0]), expert[0]) < 1.5 < error(tinted(expert)[0], expert[0])


def test_the_square_that_the_environment_shows_is_found(expert: FrameBatch, environment: FrameBatch) -> None:
    match = fitted(tinted(wider(expert)), environment, "crop", "colors")
    assert match.crop is not None
    np.testing.assert_allclose(match.crop, (4, 2, 26), atol=1)


def test_exposure_that_drifts_is_held(expert: FrameBatch, environment: FrameBatch) -> None:
    match = fitted(drifting(expert), environment, "colors", "exposure")
    assert match.usual is not None
    corner = match(drifting(expert)[0])[:, 0, 0].astype(int)
    assert np.ptp(drifting(expert)[0][:, 0, 0].astype(int), axis=0).max() > 5
    assert np.ptp(corner, axis=0).max() <= 1


def test_a_background_that_nearly_fits_gives_way_and_what_moves_stays(
    expert: FrameBatch, environment: FrameBatch
) -> None:
    stripes = (12 * (np.arange(32) % 4 < 2)).astype(np.uint8)[:, None]
    striped = np.minimum(expert, 240) + stripes[:, :, None]
    match = fitted(striped, environment, "background")
    assert match.background is not None
    after = match(striped[0])
    still = expert[0, 0, 0, 0]
    background = (expert[0] == still).all(-1)
    background[:, :, :] &= ~_near(~background)
    assert error(after[background], np.broadcast_to(still, after[background].shape)) < 1
    dot = (expert[0] == (240, 226, 150)).all(-1)
    assert error(after[dot], striped[0][dot]) < 1, "the dot is as it was"


def _near(mask: np.ndarray) -> np.ndarray:
    padded = np.pad(mask, ((0, 0), (2, 2), (2, 2)))
    height, width = mask.shape[1:]
    return np.any([padded[:, y : y + height, x : x + width] for y in range(5) for x in range(5)], axis=0)


def test_what_fits_stays_as_it_is(expert: FrameBatch, environment: FrameBatch) -> None:
    match = fitted(expert, environment, "crop", "colors", "exposure", "background")
    assert (match.crop, match.usual) == (None, None)
    assert error(match(expert[0]), expert[0]) < 0.5
    video = expert[0]
    assert Match(32)(video) is video
    with pytest.raises(BootifolError, match="name at least one repair"):
        fitted(expert, environment)


@pytest.fixture
def imported(tmp_path: Path, recorded: Path, expert: FrameBatch) -> Path:
    for index, video in enumerate(drifting(tinted(wider(expert)))):
        (tmp_path / "files").mkdir(exist_ok=True)
        np.save(tmp_path / "files" / f"{index}.npy", video)
    import_videos([tmp_path / "files"], tmp_path / "demos" / "expert", Conversion(frames=31, size=32))
    record("drawn_home", "random", 2, tmp_path / "demos" / "random", SIZES)
    return tmp_path / "demos"


def test_matched_sets_stand_beside_and_say_what_was_done(
    imported: Path, environment: FrameBatch, capsys: pytest.CaptureFixture[str]
) -> None:
    before = (imported / "expert" / "manifest.json").read_bytes()
    assert main(["demos", "check", str(imported), "--task", "drawn_home"]) == 1
    assert f"can be repaired: bootifol demos match {imported} --task drawn_home" in capsys.readouterr().out
    assert main(["demos", "match", str(imported), "--task", "drawn_home"]) == 0
    out = imported.with_name("demos_matched")
    printed = capsys.readouterr().out
    assert (
        f"next: bootifol demos check {out} --task drawn_home, then bootifol train --task drawn_home"
        in printed
    )
    assert "random: copied, for it was recorded" in printed
    assert (imported / "expert" / "manifest.json").read_bytes() == before
    matched, source = DemoSet.open(out / "expert", verify=True), DemoSet.open(imported / "expert")
    assert difference(matched.gather(range(12))[:, 0], environment[:, 0]) < 2
    assert matched.manifest.conversion is not None
    done = matched.manifest.conversion["matched"]
    assert done["task"] == "drawn_home" and done["crop"] is not None and done["exposure"] is True
    again = match_of(out / "expert", read_manifest(out / "expert"))
    assert error(again(source[3].frames), matched[3].frames) < 0.5, "others can be treated alike"
    assert match_of(imported / "expert", source.manifest).changes_nothing
    assert main(["demos", "check", str(out), "--task", "drawn_home"]) == 0


def test_what_cannot_be_matched_gets_a_sentence_and_nothing_is_written(
    imported: Path, recorded: Path, tmp_path: Path
) -> None:
    task = task_named("drawn_home")
    with pytest.raises(BootifolError, match="only imported ones are matched"):
        match_demo_sets(recorded, task, tmp_path / "out")
    with pytest.raises(BootifolError, match="exists already"):
        match_demo_sets(imported, task, imported)
    match_demo_sets(imported, task, tmp_path / "once", ("colors",))
    with pytest.raises(BootifolError, match="was matched already"):
        match_demo_sets(tmp_path / "once", task, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_pictures_of_a_match_that_are_gone_are_named(imported: Path, tmp_path: Path) -> None:
    match_demo_sets(imported, task_named("drawn_home"), tmp_path / "out")
    (tmp_path / "out" / "expert" / "matched_usual.png").unlink()
    with pytest.raises(BootifolError, match=r"matched_usual\.png is missing or damaged"):
        match_of(tmp_path / "out" / "expert", read_manifest(tmp_path / "out" / "expert"))

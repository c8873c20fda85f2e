"""The learned reward along videos, from a run's checkpoint."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tiny_runs import PICTURES, TINY, new_run

from bootifol import api
from bootifol.demos.demo_set import DemoSet
from bootifol.demos.import_videos import Conversion, import_videos
from bootifol.demos.record import record
from bootifol.errors import BootifolError
from bootifol.training.run_config import RunConfig
from bootifol.video_files.writing import write_video

SHORT = replace(TINY, interactive=replace(TINY.interactive, agent_steps=30))


@pytest.mark.parametrize("method", ["bootifol", "gaifo"])
def test_videos_are_scored_as_far_as_the_method_can_compare(tmp_path: Path, demos: Path, method: str) -> None:
    """Without reference videos, to the end."""
    assert new_run(tmp_path / "run", demos, method, SHORT).learn()
    size = SHORT.pictures.video_size
    np.save(tmp_path / "long.npy", np.random.default_rng(0).integers(0, 256, (90, size, size, 3), np.uint8))
    (rewards,) = api.score(tmp_path / "run", [tmp_path / "long.npy"]).values()
    expert_steps = len(np.load(next((demos / "expert").glob("*.npy")), mmap_mode="r")[0]) - 1
    assert len(rewards) == (89 if method == "gaifo" else expert_steps)
    assert np.isfinite(rewards).all()


def test_a_file_is_scored_as_the_video_that_an_import_makes_of_it(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A phone's clip is wide and has more pictures a second than the agent sees."""
    expert = DemoSet.open(demos / "expert")
    for index in range(4):
        wide = np.pad(expert[index].frames, ((0, 0), (0, 0), (16, 16), (0, 0)))
        write_video(tmp_path / "clips" / f"{index}.mp4", wide.repeat(3, axis=0), 30.0)
    clips = sorted((tmp_path / "clips").iterdir())
    conversion = Conversion(expert.manifest.frames, PICTURES.video_size, frames_per_second=10.0)
    import_videos(clips, tmp_path / "mine" / "expert", conversion)
    record("drawn_reach", "random", 4, tmp_path / "mine" / "random", PICTURES)
    monkeypatch.chdir(tmp_path)
    assert new_run(Path("run"), Path("mine"), config=SHORT).learn()
    of_set = list(api.score("run", ["mine/expert"]).values())
    of_files = list(api.score("run", clips).values())
    assert len(of_set) == len(of_files) == 4
    np.testing.assert_array_equal(of_files, of_set)
    assert len({rewards.tobytes() for rewards in of_set}) == 4

    monkeypatch.chdir(tmp_path / "clips")
    with pytest.raises(BootifolError, match="are not at mine: give the command in the directory in which"):
        api.score("../run", clips)


def test_a_file_is_cropped_as_the_import_was(tmp_path: Path, demos: Path) -> None:
    expert = DemoSet.open(demos / "expert")
    size = PICTURES.video_size
    scene = np.random.default_rng(0).integers(
        0, 256, (len(expert[0].frames), size + 9, 2 * size, 3), np.uint8
    )
    np.save(tmp_path / "scene.npy", scene)
    conversion = Conversion(len(scene), size, crop=(5, 9, size))
    imported = import_videos([tmp_path / "scene.npy"], tmp_path / "mine" / "expert", conversion)
    run = RunConfig("drawn_reach", "bootifol", "smoke", 1, str(tmp_path / "mine"), None, SHORT)
    (video,) = api.read_videos(tmp_path / "scene.npy", run)
    np.testing.assert_array_equal(video.frames, scene[:, 9:, 5 : 5 + size])
    np.testing.assert_array_equal(video.frames, imported[0].frames)

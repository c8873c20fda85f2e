import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import numpy as np
import pytest

from bootifol.demos import record as module
from bootifol.demos import shards
from bootifol.demos.demo_set import DemoSet
from bootifol.demos.manifest import read_manifest
from bootifol.demos.record import Recording, record
from bootifol.envs.pictures import PictureConfig
from bootifol.errors import BootifolError
from bootifol.experts import Behavior

PICTURES = PictureConfig(agent_size=16, video_size=16)
STEPS = 6
VIDEO_BYTES = (STEPS + 1) * 16 * 16 * 3


@pytest.fixture(autouse=True)
def small_shards(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shards, "_SHARD_BYTES", 2 * VIDEO_BYTES)  # two videos a shard


def record_drawn(
    out: Path, behavior: Behavior = "expert", episodes: int = 5, seed: int = 3, workers: int = 1
) -> DemoSet:
    return record("drawn_reach", behavior, episodes, out, PICTURES, seed, STEPS, workers)


def contents(directory: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in directory.iterdir()}


def test_a_recorded_set_has_the_pictures_of_its_episodes(tmp_path: Path) -> None:
    demo_set = record_drawn(tmp_path / "expert")
    demo_set.verify()
    manifest = demo_set.manifest
    assert (len(demo_set), manifest.frames, manifest.video_size) == (5, STEPS + 1, 16)
    assert (manifest.task, manifest.behavior, manifest.render_profile) == ("drawn_reach", "expert", "fast")
    assert (manifest.action_repeat, manifest.frames_per_second) == (1, 10)
    assert [shard.videos for shard in manifest.shards] == [2, 2, 1]
    assert demo_set[4].name == "drawn_reach-expert-000004"
    assert (demo_set[4].frames[0] != demo_set[4].frames[-1]).any()
    assert len({video.frames.tobytes() for video in (demo_set[i] for i in range(5))}) == 5


def test_nothing_recorded_tells_how_well_the_task_was_done(tmp_path: Path) -> None:
    record_drawn(tmp_path / "expert")
    text = (tmp_path / "expert" / "manifest.json").read_text().lower()
    assert not any(word in text for word in ("reward", "return", "success", "score", 'action"'))
    assert sorted(contents(tmp_path / "expert")) == [
        "manifest.json",
        *(f"shard-0000{i}.npy" for i in range(3)),
    ]


def test_behaviors_differ_but_begin_alike(tmp_path: Path) -> None:
    behaviors: tuple[Behavior, ...] = ("expert", "random", "half_good", "still")
    videos = {behavior: record_drawn(tmp_path / behavior, behavior)[2].frames for behavior in behaviors}
    for behavior in behaviors:
        np.testing.assert_array_equal(videos[behavior][0], videos["expert"][0])
        assert behavior == "expert" or (videos[behavior][-1] != videos["expert"][-1]).any()
    assert (videos["still"] == videos["still"][0]).all()


def test_another_seed_records_other_videos(tmp_path: Path) -> None:
    one, other = record_drawn(tmp_path / "a", seed=3), record_drawn(tmp_path / "b", seed=4)
    assert not {video.sha256 for video in one.manifest.videos} & {
        video.sha256 for video in other.manifest.videos
    }


@pytest.mark.parametrize("behavior", ["expert", "half_good", "random"])
def test_an_interrupted_recording_goes_on_to_the_same_bytes(
    tmp_path: Path, behavior: Behavior, monkeypatch: pytest.MonkeyPatch
) -> None:
    record_drawn(tmp_path / "whole", behavior)
    play = module.play
    played: list[int] = []

    def interrupted_at_3(plan: Recording, index: int) -> object:
        if index == 3:
            raise KeyboardInterrupt
        played.append(index)
        return play(plan, index)

    monkeypatch.setattr(module, "play", interrupted_at_3)
    with pytest.raises(KeyboardInterrupt):
        record_drawn(tmp_path / "resumed", behavior)
    assert played == [0, 1, 2]
    with pytest.raises(BootifolError, match=r"unfinished \(2 of 5 videos\)"):
        DemoSet.open(tmp_path / "resumed")
    (tmp_path / "resumed" / ".shard-00001.npy.0123abcd.tmp").write_bytes(b"left by a killed process")

    def counted(plan: Recording, index: int) -> object:
        played.append(index)
        return play(plan, index)

    monkeypatch.setattr(module, "play", counted)
    record_drawn(tmp_path / "resumed", behavior)
    assert played == [0, 1, 2, 2, 3, 4]  # the finished shard was kept
    assert contents(tmp_path / "resumed") == contents(tmp_path / "whole")


def test_a_shard_damaged_meanwhile_is_recorded_again_and_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record_drawn(tmp_path / "expert")
    whole = contents(tmp_path / "expert")
    shard = tmp_path / "expert" / "shard-00001.npy"
    shard.write_bytes(shard.read_bytes()[:-7])
    play, played = module.play, []

    def counted(plan: Recording, index: int) -> object:
        played.append(index)
        return play(plan, index)

    monkeypatch.setattr(module, "play", counted)
    record_drawn(tmp_path / "expert")
    assert played == [2, 3]
    assert contents(tmp_path / "expert") == whole
    record_drawn(tmp_path / "expert")  # nothing left to do
    assert played == [2, 3]


@pytest.fixture(scope="module")
def recorded_by_two_workers(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    out = tmp_path_factory.mktemp("workers") / "half_good"
    record("drawn_reach", "half_good", 5, out, PICTURES, 3, STEPS, workers=2)
    yield out


def test_two_workers_record_the_same_videos_as_one(tmp_path: Path, recorded_by_two_workers: Path) -> None:
    alone = record("drawn_reach", "half_good", 5, tmp_path / "half_good", PICTURES, 3, STEPS, workers=1)
    assert alone.manifest.videos == DemoSet.open(recorded_by_two_workers).manifest.videos


def test_a_worker_that_dies_gives_a_sentence_and_keeps_what_was_recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class DyingPool:
        def __init__(self, workers: int, **options: object) -> None:
            self.calls = 0

        def map(self, function: Callable[[int], object], indices: range) -> Iterator[object]:
            self.calls += 1
            if self.calls == 2:
                raise BrokenProcessPool
            return map(function, indices)

        def shutdown(self, cancel_futures: bool) -> None:
            pass

    monkeypatch.setattr(module, "ProcessPoolExecutor", DyingPool)
    with pytest.raises(BootifolError, match="a worker process died while recording"):
        record_drawn(tmp_path / "set", workers=2)
    assert len(read_manifest(tmp_path / "set").videos) == 2


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"seed": 4}, "its seed is 3, not 4"),
        ({"episodes": 6}, "its episodes is 5, not 6"),
        ({"behavior": "random"}, "drawn_reach-expert"),
    ],
)
def test_another_set_is_never_overwritten(tmp_path: Path, changed: dict[str, object], sentence: str) -> None:
    record_drawn(tmp_path / "set")
    before = contents(tmp_path / "set")
    with pytest.raises(BootifolError, match=sentence):
        record_drawn(tmp_path / "set", **changed)  # type: ignore[arg-type]
    assert contents(tmp_path / "set") == before


def test_a_directory_with_something_else_in_it_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(BootifolError, match="holds no demo set"):
        record_drawn(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_going_on_under_other_versions_is_refused(tmp_path: Path) -> None:
    record_drawn(tmp_path / "set")
    path = tmp_path / "set" / "manifest.json"
    manifest = json.loads(path.read_text())
    manifest["versions"]["numpy"] = "1.0"
    path.write_text(json.dumps(manifest))
    record_drawn(tmp_path / "set")  # complete: nothing to render
    (tmp_path / "set" / "shard-00000.npy").unlink()
    with pytest.raises(BootifolError, match=r"begun with numpy 1\.0"):
        record_drawn(tmp_path / "set")


def test_a_full_disk_is_noticed_before_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = shutil.disk_usage(tmp_path)._replace(free=5)
    monkeypatch.setattr(module.shutil, "disk_usage", lambda path: usage)
    with pytest.raises(BootifolError, match=r"the disk has 0\.0 GB free"):
        record_drawn(tmp_path / "set")


def test_unknown_names_give_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(BootifolError, match="no behavior 'experts'"):
        record("drawn_reach", "experts", 1, tmp_path / "a", PICTURES)  # type: ignore[arg-type]
    with pytest.raises(BootifolError, match="no task 'drawn'"):
        record("drawn", "random", 1, tmp_path / "a", PICTURES)
    with pytest.raises(BootifolError, match="at least 1"):
        record("drawn_reach", "random", 0, tmp_path / "a", PICTURES)
    assert not (tmp_path / "a").exists()


def test_seeds_of_videos_are_distinct_and_depend_on_both_numbers() -> None:
    def seeds(seed: int) -> set[int]:
        plan = Recording("drawn_reach", "expert", 500, PICTURES, seed, STEPS, 1)
        return {plan.video_seed(index) for index in range(500)}

    assert len(seeds(1) | seeds(2)) == 1000
    assert max(seeds(1)) < 2**31


def test_a_killed_recording_of_reacher_goes_on_to_the_same_bytes(tmp_path: Path) -> None:
    """Killed without a chance to clean up, in a process of its own, and resumed in this one."""
    script = (
        "import os; from bootifol.demos import record as module; from bootifol.envs.pictures import PictureConfig\n"
        "from bootifol.demos import shards; shards._SHARD_BYTES = 1\n"
        "play = module.play\n"
        "module.play = lambda plan, index: play(plan, index) if index < 2 else os._exit(9)\n"
        f"module.record('reacher_hard', 'half_good', 3, {str(tmp_path / 'killed')!r}, "
        "PictureConfig(agent_size=16, video_size=16), 5, 8)\n"
    )
    killed = subprocess.run([sys.executable, "-c", script], env=os.environ, capture_output=True, text=True)
    assert killed.returncode == 9, killed.stderr
    assert (tmp_path / "killed" / "shard-00001.npy").exists()
    for name in ("killed", "whole"):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(shards, "_SHARD_BYTES", 1)
            record("reacher_hard", "half_good", 3, tmp_path / name, PICTURES, 5, 8)
    assert contents(tmp_path / "killed") == contents(tmp_path / "whole")

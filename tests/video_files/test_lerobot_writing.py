import json
import os
import subprocess
import sys
from pathlib import Path

import av
import numpy as np
import pytest

from bootifol.video_files import lerobot_writing
from bootifol.video_files.lerobot_reading import lerobot_episodes
from bootifol.video_files.lerobot_writing import CAMERA, write_lerobot

pq = pytest.importorskip("pyarrow.parquet")

LENGTHS = [4, 2, 5]


def episodes(height: int = 8, width: int = 8) -> list[np.ndarray]:
    """Plain pictures, each of another gray level."""
    levels = iter(range(10, 250, 20))
    return [
        np.stack([np.full((height, width, 3), next(levels), np.uint8) for _ in range(length)])
        for length in LENGTHS
    ]


def written(root: Path, frames: list[np.ndarray] | None = None, rate: float = 10) -> Path:
    root.mkdir()
    write_lerobot(root, episodes() if frames is None else frames, rate, "reach the target", lambda: None)
    return root


def test_the_files_are_where_lerobot_looks_for_them(tmp_path: Path) -> None:
    root = written(tmp_path / "a")
    assert sorted(str(path.relative_to(root)) for path in root.rglob("*.*") if path.is_file()) == [
        "data/chunk-000/file-000.parquet",
        "meta/episodes/chunk-000/file-000.parquet",
        "meta/info.json",
        "meta/stats.json",
        "meta/tasks.parquet",
        f"videos/{CAMERA}/chunk-000/file-000.mp4",
    ]
    info = json.loads((root / "meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"], info["splits"]) == ("v3.0", 10, {"train": "0:3"})
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (3, 11, 1)
    assert info["features"][CAMERA]["shape"] == [8, 8, 3]


def test_frames_are_numbered_within_their_episode_and_within_the_dataset(tmp_path: Path) -> None:
    table = pq.read_table(written(tmp_path / "a") / "data/chunk-000/file-000.parquet")
    columns = table.to_pydict()
    assert columns["index"] == list(range(11))
    assert columns["frame_index"] == [0, 1, 2, 3, 0, 1, 0, 1, 2, 3, 4]
    assert columns["episode_index"] == [0, 0, 0, 0, 1, 1, 2, 2, 2, 2, 2]
    assert columns["timestamp"] == pytest.approx([index / 10 for index in columns["frame_index"]])
    kinds = {"index": "int64", "frame_index": "int64", "episode_index": "int64", "task_index": "int64"}
    assert {field.name: str(field.type) for field in table.schema} == kinds | {"timestamp": "float"}


def test_episodes_say_where_they_begin_and_end(tmp_path: Path) -> None:
    rows = pq.read_table(written(tmp_path / "a") / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [row["length"] for row in rows] == LENGTHS
    assert [(row["dataset_from_index"], row["dataset_to_index"]) for row in rows] == [(0, 4), (4, 6), (6, 11)]
    begins, ends = ([row[f"videos/{CAMERA}/{edge}_timestamp"] for row in rows] for edge in ("from", "to"))
    assert begins == pytest.approx([0, 0.4, 0.6])
    assert ends == pytest.approx([0.4, 0.6, 1.1])
    assert rows[2]["tasks"] == ["reach the target"]


def test_the_task_is_the_index_of_its_table(tmp_path: Path) -> None:
    schema = pq.read_schema(written(tmp_path / "a") / "meta/tasks.parquet")
    assert schema.pandas_metadata["index_columns"] == ["task"]
    assert schema.names == ["task_index", "task"]


def test_a_full_video_file_is_followed_by_another(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lerobot_writing, "_PIXEL_BYTES_PER_FILE", 0)
    monkeypatch.setattr(lerobot_writing, "_FILES_PER_CHUNK", 2)
    root = written(tmp_path / "a")
    read = lerobot_episodes(root)
    assert [str(episode.file.relative_to(root / "videos" / CAMERA)) for episode in read] == [
        "chunk-000/file-000.mp4",
        "chunk-000/file-001.mp4",
        "chunk-001/file-000.mp4",
    ]
    assert [episode.first_seconds for episode in read] == [0, 0, 0]
    assert [len(list(episode.stream())) for episode in read] == LENGTHS


def test_odd_sizes_keep_their_shape_and_every_second_frame_is_a_key_frame(tmp_path: Path) -> None:
    root = written(tmp_path / "a", episodes(7, 9), rate=29.97)
    with av.open(str(root / f"videos/{CAMERA}/chunk-000/file-000.mp4")) as container:
        frames = list(container.decode(video=0))
    assert (frames[0].height, frames[0].width) == (7, 9)
    assert all(frame.key_frame for frame in frames[::2])
    assert [frame.time for frame in frames] == pytest.approx([index / 29.97 for index in range(11)], abs=1e-5)


def test_statistics_of_all_frames_agree_with_numpy(tmp_path: Path) -> None:
    frames = [np.random.default_rng(n).integers(0, 256, (n, 4, 6, 3), np.uint8) for n in LENGTHS]
    root = written(tmp_path / "a", frames)
    stats = json.loads((root / "meta/stats.json").read_text())
    pixels = np.concatenate(frames).reshape(-1, 3) / 255
    for name in ("min", "max", "mean", "std"):
        expected = getattr(pixels, name)(axis=0).reshape(3, 1, 1)
        np.testing.assert_allclose(np.array(stats[CAMERA][name]), expected)
    assert stats[CAMERA]["count"] == [11]
    assert stats["index"]["mean"] == pytest.approx([5.0])
    assert stats["index"]["std"] == pytest.approx([np.arange(11).std()])
    first = pq.read_table(root / "meta/episodes/chunk-000/file-000.parquet").to_pylist()[0]
    np.testing.assert_allclose(
        np.ravel(first[f"stats/{CAMERA}/mean"]), frames[0].reshape(-1, 3).mean(0) / 255
    )


@pytest.mark.skipif("LEROBOT_PYTHON" not in os.environ, reason="LeRobot wants an environment of its own")
def test_lerobot_reads_it() -> None:
    """LEROBOT_PYTHON is a Python that has LeRobot; scripts/check_lerobot.sh says how to make one."""
    script = Path(__file__).parents[2] / "scripts" / "check_lerobot.sh"
    done = subprocess.run(
        ["bash", script], env=os.environ | {"PYTHON": sys.executable}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "reads it: 3 episodes, 93 frames at 10 a second" in done.stdout

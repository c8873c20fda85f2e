import json
import shutil
import sys
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from bootifol.demos.demo_set import DemoSet
from bootifol.demos.import_videos import Conversion, import_videos
from bootifol.errors import BootifolError
from bootifol.video_files.lerobot_reading import lerobot_episodes
from bootifol.video_files.reading import video_paths

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")

RATE = 10
FILES = {0: [[10, 20, 30], [40, 50, 60, 70, 80]], 1: [[90, 100]]}
"""Gray levels of each episode's frames, by the video file they are in: episodes 0 and 1, then episode 2."""


def write_file(path: Path, levels: list[int]) -> None:
    """One long group of pictures, so that every episode but the first begins between key frames."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264rgb", rate=RATE, options={"crf": "0"})
        stream.height = stream.width = 16
        stream.pix_fmt = "rgb24"
        for level in levels:
            frame = np.full((16, 16, 3), level, np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
        container.mux(stream.encode(None))


def write_dataset(root: Path, cameras: tuple[str, ...] = ("observation.images.front",)) -> Path:
    """A dataset of three episodes, each camera 5 levels brighter than the one before it."""
    rows: list[dict[str, Any]] = []
    for file, episodes in FILES.items():
        for brighter, camera in enumerate(cameras):
            levels = [level + 5 * brighter for episode in episodes for level in episode]
            write_file(root / f"videos/{camera}/chunk-000/file-{file:03d}.mp4", levels)
        first = 0
        for levels in episodes:
            row: dict[str, Any] = {"episode_index": len(rows), "tasks": ["lift"], "length": len(levels)}
            for camera in cameras:
                where = {"chunk_index": 0, "file_index": file, "from_timestamp": first / RATE}
                where["to_timestamp"] = (first + len(levels)) / RATE
                row |= {f"videos/{camera}/{name}": value for name, value in where.items()}
            rows.append(row)
            first += len(levels)
    write_rows(root, rows)
    features = {camera: {"dtype": "video", "shape": [16, 16, 3]} for camera in cameras}
    write_info(
        root,
        codebase_version="v3.0",
        fps=RATE,
        total_episodes=3,
        video_path="videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4",
        features=features | {"action": {"dtype": "float32", "shape": [2]}},
    )
    return root


def write_rows(root: Path, rows: list[dict[str, Any]]) -> None:
    path = root / "meta/episodes/chunk-000/file-000.parquet"
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.Table.from_pylist(rows), path)


def read_rows(root: Path) -> list[dict[str, Any]]:
    return list(pq.read_table(root / "meta/episodes/chunk-000/file-000.parquet").to_pylist())


def write_info(root: Path, **fields: Any) -> None:
    path = root / "meta" / "info.json"
    old = json.loads(path.read_text()) if path.exists() else {}
    path.write_text(json.dumps(old | fields))


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_dataset(tmp_path_factory.mktemp("lerobot") / "lift")


@pytest.fixture
def dataset(whole: Path, tmp_path: Path) -> Path:
    """A copy to damage."""
    return Path(shutil.copytree(whole, tmp_path / "lift"))


def levels_of(dataset: Path, camera: str | None = None) -> list[list[int]]:
    return [
        [int(timed.frame[0, 0, 0]) for timed in episode.stream()]
        for episode in lerobot_episodes(dataset, camera)
    ]


def test_each_episode_is_the_part_of_its_file_that_the_dataset_says(whole: Path) -> None:
    assert levels_of(whole) == FILES[0] + FILES[1]
    seconds = [timed.seconds for timed in lerobot_episodes(whole)[1].stream()]
    assert seconds == pytest.approx([0, 0.1, 0.2, 0.3, 0.4])


def test_import_makes_one_video_an_episode(whole: Path, tmp_path: Path) -> None:
    demo_set = import_videos([whole], tmp_path / "mine" / "expert", Conversion(frames=3, size=16))
    manifest = demo_set.manifest
    assert [demo_set[i].frames[:, 0, 0, 0].tolist() for i in range(3)] == [
        [10, 20, 30],
        [40, 50, 60],
        [90, 100, 100],
    ]
    assert [video.length for video in manifest.videos] == [3, 3, 2]
    assert manifest.frames_per_second == RATE
    camera = "observation.images.front"
    assert manifest.videos[1].source == {"file": "lift", "episode": 1, "camera": camera, "first_frame": 0}


def test_an_episode_can_be_resampled(whole: Path, tmp_path: Path) -> None:
    conversion = Conversion(frames=3, size=16, frames_per_second=5)
    demo_set = import_videos([whole], tmp_path / "expert", conversion)
    assert demo_set[1].frames[:, 0, 0, 0].tolist() == [40, 60, 80]


def test_one_of_several_cameras_is_chosen_by_its_key(tmp_path: Path) -> None:
    dataset = write_dataset(tmp_path / "two", ("front", "wrist"))
    with pytest.raises(BootifolError, match=r"2 cameras: choose one with --camera, among front, wrist"):
        lerobot_episodes(dataset)
    with pytest.raises(BootifolError, match=r"no camera 'top'; choose among front, wrist"):
        lerobot_episodes(dataset, "top")
    assert levels_of(dataset, "wrist")[0] == [15, 25, 35]
    write_info(dataset, features={"front": {"dtype": "video"}, "wrist": {"dtype": "image"}})
    assert levels_of(dataset)[0] == [10, 20, 30]


def test_a_camera_of_plain_files_is_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.zeros((3, 4, 4, 3), np.uint8))
    with pytest.raises(BootifolError, match="no camera 'front' to choose: only LeRobot datasets"):
        import_videos([tmp_path / "a.npy"], tmp_path / "out", camera="front")


@pytest.mark.parametrize("version", ["v2.0", "v2.1", "v4.0"])
def test_other_versions_are_told_how_to_convert(dataset: Path, version: str) -> None:
    write_info(dataset, codebase_version=version)
    with pytest.raises(BootifolError, match=rf"of format {version} and bootifol reads v3.0: convert it with"):
        lerobot_episodes(dataset)


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"codebase_version": None}, "names no codebase_version"),
        ({"fps": 0}, "fps is 0"),
        ({"fps": "ten"}, "fps is 'ten'"),
        ({"total_episodes": 4}, "lists 3 episodes and meta/info.json promises 4"),
        ({"features": None}, "it has no features"),
        ({"features": {"action": {"dtype": "float32"}}}, r"no color videos \(its features: action\)"),
        ({"features": {"d": {"dtype": "video", "info": {"is_depth_map": True}}}}, "no color videos"),
        ({"video_path": None}, "video_path is None"),
        ({"video_path": "videos/{camera}.mp4"}, "video_path is"),
        ({"video_path": "../{video_key}.mp4"}, "video_path is"),
        ({"video_path": "/{video_key}.mp4"}, "video_path is"),
        ({"storage_format": "lance"}, "stored as 'lance'"),
    ],
)
def test_a_damaged_description_is_named(dataset: Path, fields: dict[str, Any], sentence: str) -> None:
    write_info(dataset, **fields)
    with pytest.raises(BootifolError, match=sentence):
        lerobot_episodes(dataset)


@pytest.mark.parametrize(
    ("column", "value", "sentence"),
    [
        ("length", 9, "episode 1 has 9 frames and lasts from 0.300 to 0.800 s"),
        ("length", 0, "contradicts itself"),
        (
            "videos/observation.images.front/file_index",
            7,
            r"file-007\.mp4 is missing, and with it 1 episodes",
        ),
        ("videos/observation.images.front/chunk_index", None, "chunk_index is None"),
        ("videos/observation.images.front/from_timestamp", float("nan"), "from_timestamp is nan"),
        ("episode_index", 0, "lists 3 episodes and meta/info.json promises 3, numbered from 0"),
    ],
)
def test_a_damaged_row_is_named(dataset: Path, column: str, value: Any, sentence: str) -> None:
    rows = read_rows(dataset)
    rows[1][column] = value
    write_rows(dataset, rows)
    with pytest.raises(BootifolError, match=sentence):
        lerobot_episodes(dataset)


def test_missing_and_damaged_tables_are_named(dataset: Path) -> None:
    table = dataset / "meta/episodes/chunk-000/file-000.parquet"
    write_rows(dataset, [{"episode_index": 0, "length": 3}])
    with pytest.raises(BootifolError, match=r"has no column videos/observation\.images\.front/chunk_index"):
        lerobot_episodes(dataset)
    table.write_bytes(b"PAR1 and then nothing")
    with pytest.raises(BootifolError, match=r"file-000\.parquet is damaged"):
        lerobot_episodes(dataset)
    table.unlink()
    with pytest.raises(BootifolError, match="holds no parquet files"):
        lerobot_episodes(dataset)
    (dataset / "meta" / "info.json").write_text("{")
    with pytest.raises(BootifolError, match="description cannot be read"):
        lerobot_episodes(dataset)


def test_an_episode_shorter_than_promised_is_refused_and_nothing_is_written(
    dataset: Path, tmp_path: Path
) -> None:
    write_file(
        dataset / "videos/observation.images.front/chunk-000/file-000.mp4", [10, 20, 30, 40, 50, 60, 70]
    )
    with pytest.raises(BootifolError, match=r"episode 1 of .*lift should have 5 frames and .* holds 4 of it"):
        import_videos([dataset], tmp_path / "out" / "expert", Conversion(frames=3, size=16))
    assert not (tmp_path / "out").exists()


def test_a_truncated_video_file_is_refused_by_name(dataset: Path, tmp_path: Path) -> None:
    path = dataset / "videos/observation.images.front/chunk-000/file-001.mp4"
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(BootifolError, match=r"episode 2 of .*lift.*file-001\.mp4") as error:
        import_videos([dataset], tmp_path / "out", Conversion(frames=3, size=16))
    assert "episode 0" not in str(error.value)


def test_without_pyarrow_a_sentence_says_what_to_install(
    whole: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    with pytest.raises(BootifolError, match="pip install pyarrow"):
        lerobot_episodes(whole)


def test_a_folder_of_datasets_is_found(whole: Path, tmp_path: Path) -> None:
    assert video_paths([whole]) == [whole]
    assert video_paths([whole.parent]) == [whole]
    assert len(import_videos(video_paths([whole.parent]), tmp_path / "out", Conversion(3, 16))) == 3
    assert len(DemoSet.open(tmp_path / "out")) == 3


CAMERA = "videos/observation.images.front"


@pytest.mark.parametrize("drift", [-0.4, -0.1, 0.1, 0.4, 1.3])
def test_episodes_are_counted_where_their_times_drift(dataset: Path, drift: float) -> None:
    rows = read_rows(dataset)
    for row in rows:
        for name in ("from_timestamp", "to_timestamp"):
            row[f"{CAMERA}/{name}"] = max(0.0, row[f"{CAMERA}/{name}"] + drift * row["episode_index"] / RATE)
    write_rows(dataset, rows)
    assert levels_of(dataset) == FILES[0] + FILES[1]


def test_times_must_be_those_of_pictures_where_the_file_holds_others(dataset: Path) -> None:
    write_file(dataset / CAMERA / "chunk-000/file-000.mp4", [10, 20, 30, 99, 99, 40, 50, 60, 70, 80])
    rows = read_rows(dataset)
    for name in ("from_timestamp", "to_timestamp"):
        rows[1][f"{CAMERA}/{name}"] += 2 / RATE
    write_rows(dataset, rows)
    assert levels_of(dataset) == FILES[0] + FILES[1], "an episode was taken out of the table alone"
    rows[1][f"{CAMERA}/from_timestamp"] += 0.4 / RATE
    write_rows(dataset, rows)
    with pytest.raises(
        BootifolError, match=r"episode 1 of .*should begin at 0\.540 s of .* where no picture begins"
    ):
        levels_of(dataset)


def test_notes_of_macos_in_a_dataset_are_no_matter(dataset: Path) -> None:
    for folder in ("meta/episodes/chunk-000/._file-000.parquet", f"{CAMERA}/chunk-000/._file-000.mp4"):
        (dataset / folder).write_bytes(b"\x00\x05\x16\x07")
    assert levels_of(dataset) == FILES[0] + FILES[1]


@pytest.mark.parametrize(
    "file", ["meta/info.json", "meta/episodes/chunk-000/file-000.parquet", f"{CAMERA}/chunk-000/file-000.mp4"]
)
def test_pointers_of_git_lfs_say_what_to_type(dataset: Path, file: str) -> None:
    (dataset / file).write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 5\n")
    with pytest.raises(BootifolError, match="git lfs pull"):
        levels_of(dataset)

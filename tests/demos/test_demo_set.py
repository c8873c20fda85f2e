import json
import math
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_demo_sets import FRAMES, SIZE, WriteSet, moving_videos

from bootifol.demos.demo_set import DemoSet
from bootifol.demos.manifest import find_demo_sets, read_manifest, write_manifest
from bootifol.demos.shards import videos_per_shard
from bootifol.errors import BootifolError


def edit_manifest(directory: Path, **fields: object) -> None:
    path = directory / "manifest.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | fields))


def test_it_returns_the_videos_that_were_written_under_unique_names(write_set: WriteSet) -> None:
    videos = moving_videos(7)
    demo_set = DemoSet.open(write_set(videos), verify=True)
    assert len(demo_set) == 7
    for index, video in enumerate(demo_set):  # type: ignore[arg-type]  # iterates by index, ends at IndexError
        assert video.name == f"drawn-expert-{index:06d}"
        assert video.environment_rewards is None
        np.testing.assert_array_equal(video.frames, videos[index])


def test_a_manifest_reads_back_as_it_was_written(write_set: WriteSet) -> None:
    manifest = read_manifest(write_set(moving_videos(4)))
    assert manifest.episodes == 4
    assert [shard.videos for shard in manifest.shards] == [3, 1]
    assert manifest.videos[3].source == {"behavior": "expert", "seed": 3}


def test_a_sample_has_no_repetition_while_there_are_enough_videos(write_set: WriteSet) -> None:
    videos = moving_videos(7)
    demo_set = DemoSet.open(write_set(videos))
    drawn = demo_set.sample(7, np.random.default_rng(0))
    assert drawn.shape == (7, FRAMES, SIZE, SIZE, 3)
    assert {frames.tobytes() for frames in drawn} == {frames.tobytes() for frames in videos}
    assert demo_set.sample(9, np.random.default_rng(0)).shape[0] == 9


def test_a_sample_is_uniform_and_depends_on_the_generator_only(write_set: WriteSet) -> None:
    videos = moving_videos(4)
    demo_set = DemoSet.open(write_set(videos))
    np.testing.assert_array_equal(
        demo_set.sample(3, np.random.default_rng(5)), demo_set.sample(3, np.random.default_rng(5))
    )
    rng = np.random.default_rng(0)
    keys = [frames.tobytes() for frames in videos]
    counts = np.bincount([keys.index(demo_set.sample(1, rng)[0].tobytes()) for _ in range(400)], minlength=4)
    assert counts.min() > 70  # 100 expected, standard deviation 8.7


def test_split_views_share_no_video_and_cover_all(write_set: WriteSet) -> None:
    demo_set = DemoSet.open(write_set(moving_videos(9)))
    training, held_out = demo_set.split(held_out=4, seed=3)
    names = [[view[i].name for i in range(len(view))] for view in (training, held_out)]
    assert (len(names[0]), len(names[1])) == (5, 4)
    assert set(names[0]) | set(names[1]) == {video.name for video in demo_set.manifest.videos}
    assert names == [[view[i].name for i in range(len(view))] for view in demo_set.split(4, seed=3)]
    assert names != [[view[i].name for i in range(len(view))] for view in demo_set.split(4, seed=4)]
    held_out_pixels = {held_out[i].frames.tobytes() for i in range(4)}
    rng = np.random.default_rng(0)
    for _ in range(20):
        assert not held_out_pixels & {frames.tobytes() for frames in training.sample(5, rng)}
        assert {frames.tobytes() for frames in held_out.sample(4, rng)} == held_out_pixels


def test_a_split_that_leaves_nothing_to_train_on_is_refused(write_set: WriteSet) -> None:
    demo_set = DemoSet.open(write_set(moving_videos(3)))
    with pytest.raises(BootifolError, match="3 videos cannot be held out of the 3"):
        demo_set.split(3)


@pytest.mark.parametrize("position", [-1, 130, 700])
def test_one_flipped_byte_is_found_and_its_video_named(write_set: WriteSet, position: int) -> None:
    directory = write_set(moving_videos(7), per_shard=3)
    shard = directory / "shard-00001.npy"
    data = bytearray(shard.read_bytes())
    data[position] ^= 1
    shard.write_bytes(data)
    demo_set = DemoSet.open(directory)
    with pytest.raises(
        BootifolError, match=r"shard-00001.npy is damaged: the pixels of drawn-expert-00000\d "
    ) as e:
        demo_set.verify()
    assert ("000005" if position == -1 else "000003") in str(e.value)


def test_a_flipped_byte_in_a_header_is_found(write_set: WriteSet) -> None:
    directory = write_set(moving_videos(3))
    shard = directory / "shard-00000.npy"
    data = bytearray(shard.read_bytes())
    data[120] ^= 1  # padding after the header's dictionary: the array still loads
    shard.write_bytes(data)
    with pytest.raises(BootifolError, match=r"shard-00000.npy is damaged"):
        DemoSet.open(directory, verify=True)


@pytest.mark.parametrize(("change", "sentence"), [(-1, "truncated"), (+1, "too long")])
def test_a_file_of_the_wrong_size_is_found_on_opening(
    write_set: WriteSet, change: int, sentence: str
) -> None:
    directory = write_set(moving_videos(3))
    shard = directory / "shard-00000.npy"
    data = shard.read_bytes()
    shard.write_bytes(data[:change] if change < 0 else data + b"\0")
    with pytest.raises(BootifolError, match=f"shard-00000.npy is {sentence}"):
        DemoSet.open(directory)


def test_a_missing_file_is_named(write_set: WriteSet) -> None:
    directory = write_set(moving_videos(7))
    (directory / "shard-00001.npy").unlink()
    with pytest.raises(BootifolError, match=r"shard-00001.npy is missing, and with it 3 videos"):
        DemoSet.open(directory)


def test_pickled_arrays_are_never_loaded(write_set: WriteSet) -> None:
    directory = write_set(moving_videos(3))
    shard = directory / "shard-00000.npy"
    np.save(shard, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    manifest = json.loads((directory / "manifest.json").read_text())
    manifest["shards"][0]["bytes"] = shard.stat().st_size
    edit_manifest(directory, **manifest)
    with pytest.raises(
        BootifolError, match=r"shard-00000.npy holds object \[1\] where the manifest says uint8"
    ):
        DemoSet.open(directory)


def replace_shard(directory: Path, data: bytes) -> None:
    """Puts other bytes into the first shard and lets the manifest agree with their number."""
    manifest = json.loads((directory / "manifest.json").read_text())
    manifest["shards"][0]["bytes"] = len(data)
    edit_manifest(directory, shards=manifest["shards"])
    (directory / "shard-00000.npy").write_bytes(data)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda data: b"PK" + data[2:], "is damaged: the magic string is not correct"),
        (lambda data: data[:6] + b"\2\0" + data[8:], "its format is 2.0"),
        (lambda data: data[:40], "is damaged: EOF"),
        (lambda data: data.replace(b"'fortran_order': False", b"'fortran_order': True "), "varies fastest"),
        (lambda data: data.replace(b"{'descr'", b"{('descr"), "is damaged"),
        (lambda data: data[:-5], "bytes follow its header, which promises 2,880"),
    ],
)
def test_a_shard_whose_header_is_not_ours_is_refused(
    write_set: WriteSet, change: Callable[[bytes], bytes], sentence: str
) -> None:
    directory = write_set(moving_videos(3))
    replace_shard(directory, change((directory / "shard-00000.npy").read_bytes()))
    with pytest.raises(BootifolError, match=f"shard-00000.npy .*{sentence}"):
        DemoSet.open(directory)


def test_a_file_cut_short_or_removed_while_in_use_gives_a_sentence(write_set: WriteSet) -> None:
    directory = write_set(moving_videos(3))
    demo_set = DemoSet.open(directory)
    shard = directory / "shard-00000.npy"
    shard.write_bytes(shard.read_bytes()[:-1])
    assert demo_set[1].frames.shape == (FRAMES, SIZE, SIZE, 3)
    with pytest.raises(BootifolError, match=r"shard-00000.npy has become shorter while it was in use"):
        demo_set[2]
    shard.unlink()
    with pytest.raises(BootifolError, match=r"shard-00000.npy cannot be read any more"):
        demo_set[1]


@pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="only Linux limits the address space reliably"
)
def test_a_set_larger_than_memory_is_sampled_in_bounded_memory(write_set: WriteSet) -> None:
    """A set of 2.1 GB (holes in its files cost no disk), in a process that may take 256 MB more than it has."""
    import resource

    directory = write_set(np.zeros((4, FRAMES, SIZE, SIZE, 3), np.uint8), per_shard=1)
    manifest = read_manifest(directory)
    shape = (700, 61, 64, 64, 3)
    shards = []
    for shard in manifest.shards:
        with (directory / shard.file).open("wb") as file:
            header = {"descr": "|u1", "fortran_order": False, "shape": shape}
            np.lib.format.write_array_header_1_0(file, header)
            file.truncate(file.tell() + math.prod(shape))
        shards.append(replace(shard, videos=700, bytes=(directory / shard.file).stat().st_size))
    entries = [replace(manifest.videos[0], name=f"video-{number}", length=61) for number in range(2800)]
    write_manifest(
        directory,
        replace(
            manifest, episodes=2800, frames=61, video_size=64, shards=tuple(shards), videos=tuple(entries)
        ),
    )
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + 256 * 2**20, hard))
    try:
        training, held_out = DemoSet.open(directory).split(10)
        rng = np.random.default_rng(0)
        read = sum(training.sample(32, rng).nbytes for _ in range(16))
        assert held_out[3].frames.shape == shape[1:]
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
    assert read > 256 * 2**20


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"format": 2}, "has format 2 and this bootifol reads format 1"),
        ({"frames": "5"}, "frames must be a whole number"),
        (
            {"frames": 6},
            r"shard-00000.npy holds uint8 \[3, 5, 8, 8, 3\] where the manifest says uint8 \[3, 6",
        ),
        ({"video_size": 4}, "where the manifest says"),
        ({"videos": []}, "its shards hold 4 videos and it lists 0"),
        ({"videos": {}}, "videos must be a list"),
        ({"episodes": 5}, "it lists 4 videos of 5"),
        ({"complete": False, "episodes": 9}, r"unfinished \(4 of 9 videos\)"),
        ({"frames_per_second": 0}, "frames_per_second must be above 0"),
    ],
)
def test_a_wrong_manifest_gives_a_sentence(
    write_set: WriteSet, fields: dict[str, object], sentence: str
) -> None:
    directory = write_set(moving_videos(4))
    edit_manifest(directory, **fields)
    with pytest.raises(BootifolError, match=sentence):
        DemoSet.open(directory)


def test_a_shard_outside_the_directory_is_refused(write_set: WriteSet) -> None:
    directory = write_set(moving_videos(2))
    shards = json.loads((directory / "manifest.json").read_text())["shards"]
    edit_manifest(directory, shards=[shards[0] | {"file": "../shard-00000.npy"}])
    with pytest.raises(BootifolError, match="no shard of its own"):
        DemoSet.open(directory)


def test_missing_places_give_a_sentence(tmp_path: Path, write_set: WriteSet) -> None:
    with pytest.raises(BootifolError, match="there is no demo set at"):
        DemoSet.open(tmp_path / "nowhere")
    directory = write_set(moving_videos(2))
    (directory / "manifest.json").write_text("{")
    with pytest.raises(BootifolError, match="manifest cannot be read"):
        DemoSet.open(directory)
    (directory / "manifest.json").unlink()
    with pytest.raises(BootifolError, match="manifest is missing"):
        DemoSet.open(directory)


def test_a_directory_of_sets_is_found_by_behavior(write_set: WriteSet, tmp_path: Path) -> None:
    expert = write_set(moving_videos(2), name="a", behavior="expert")
    random = write_set(moving_videos(3, seed=1), name="b", behavior="random")
    assert find_demo_sets(tmp_path) == {"expert": expert, "random": random}
    assert find_demo_sets(expert) == {"expert": expert}
    with pytest.raises(BootifolError, match="there is no demo set at"):
        find_demo_sets(tmp_path / "elsewhere")
    write_set(moving_videos(3, seed=1), name="c", behavior="random")
    with pytest.raises(BootifolError, match="both hold random videos"):
        find_demo_sets(tmp_path)


def test_a_set_with_another_one_inside_holds_both(write_set: WriteSet, tmp_path: Path) -> None:
    expert = write_set(moving_videos(2), name="expert")
    random = write_set(moving_videos(2, seed=1), name="random", behavior="random")
    random.rename(expert / "random")
    assert find_demo_sets(expert) == {"expert": expert, "random": expert / "random"}


@pytest.mark.parametrize(
    ("episodes", "video_bytes", "videos"),
    [(5000, 61 * 64 * 64 * 3, 40), (200, 61 * 64 * 64 * 3, 22), (3, 9, 3)],
)
def test_a_paper_sized_set_opens_few_files(episodes: int, video_bytes: int, videos: int) -> None:
    assert videos_per_shard(episodes, video_bytes) == videos
    assert -(-episodes // videos) <= 128

import json
from pathlib import Path

import numpy as np
import pytest
from small_demo_sets import FRAMES, SIZE, WriteSet, moving_videos

from bootifol.demos.demo_set import DemoSet, find_demo_sets
from bootifol.demos.manifest import read_manifest
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
    with pytest.raises(BootifolError, match=r"shard-00000.npy is damaged"):
        DemoSet.open(directory)


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"format": 2}, "has format 2 and this bootifol reads format 1"),
        ({"frames": "5"}, "'frames' should be a whole number"),
        (
            {"frames": 6},
            r"shard-00000.npy holds uint8 \[3, 5, 8, 8, 3\] where the manifest says uint8 \[3, 6",
        ),
        ({"video_size": 4}, "where the manifest says"),
        ({"videos": []}, "its shards hold 4 videos and it lists 0"),
        ({"videos": {}}, "'videos' should be a list"),
        ({"episodes": 5}, "it lists 4 videos of 5"),
        ({"complete": False, "episodes": 9}, r"unfinished \(4 of 9 videos\)"),
        ({"frames_per_second": 0}, "'frames_per_second' should be a positive number"),
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

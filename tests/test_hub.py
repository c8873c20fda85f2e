"""Addresses of the Hugging Face hub: what they name, what is fetched for them, and what is said where nothing is."""

from __future__ import annotations

import sys
from dataclasses import replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bootifol
from bootifol.agents.config import DrQv2Config
from bootifol.agents.drqv2 import DrQv2
from bootifol.agents.policy import PolicyConfig, read_policy, write_policy
from bootifol.cli.main import main
from bootifol.demos.import_videos import Conversion
from bootifol.demos.manifest import read_manifest
from bootifol.envs.pictures import PictureConfig
from bootifol.errors import BootifolError
from bootifol.hub import HubAddress, hub_address, is_hub_address
from bootifol.video_files.lerobot_writing import write_lerobot
from bootifol.video_files.writing import write_video

huggingface_hub = pytest.importorskip("huggingface_hub")
errors = pytest.importorskip("huggingface_hub.errors")


class Hub:
    """Repositories in folders, fetched as huggingface_hub does: linked out of a cache, in a folder of the commit."""

    def __init__(self, root: Path) -> None:
        self.root, self.cache = root, root / "cache"
        self.asked: list[tuple[str, str | None]] = []

    def hf_hub_download(self, repo_id: str, filename: str, *, revision: str | None = None) -> str:
        self.asked.append((f"{repo_id}/{filename}", revision))
        if not (self.root / repo_id / filename).is_file():
            raise errors.LocalEntryNotFoundError("cannot find the requested files in the local cache")
        return str(self.root / repo_id / filename)

    def snapshot_download(
        self, repo_id: str, *, repo_type: str, revision: str | None = None, allow_patterns: list[str]
    ) -> str:
        assert repo_type == "dataset"
        self.asked.append((repo_id, revision))
        if not (self.root / repo_id).is_dir():
            raise errors.HFValidationError("there is no such repository")
        snapshot = self.cache / "snapshots" / "0a1b2c"
        snapshot.mkdir(parents=True)
        for file in sorted((self.root / repo_id).rglob("*")):
            name = str(file.relative_to(self.root / repo_id))
            if file.is_file() and any(fnmatch(name, pattern) for pattern in allow_patterns):
                (snapshot / name).parent.mkdir(parents=True, exist_ok=True)
                (snapshot / name).symlink_to(file)
        return str(snapshot)


@pytest.fixture
def hub(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Hub:
    made = Hub(tmp_path / "hub")
    for name in ("hf_hub_download", "snapshot_download"):
        monkeypatch.setattr(huggingface_hub, name, getattr(made, name))
    return made


def episodes(count: int) -> list[np.ndarray]:
    """Videos of six pictures that move, each another."""
    rng = np.random.default_rng(0)
    first = rng.integers(0, 256, (count, 16, 16, 3), np.uint8)
    return [np.stack([np.roll(one, step, axis=1) for step in range(6)]) for one in first]


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("hf://jane/reach", HubAddress("jane/reach", False, None, "")),
        ("hf:/jane/reach/", HubAddress("jane/reach", False, None, "")),
        ("hf://datasets/jane/reach", HubAddress("jane/reach", True, None, "")),
        (
            "hf://jane/reach@v1.0/best/p.safetensors",
            HubAddress("jane/reach", False, "v1.0", "best/p.safetensors"),
        ),
        ("hf://datasets/jane/re-ach@main/kitchen", HubAddress("jane/re-ach", True, "main", "kitchen")),
    ],
)
def test_an_address_names_a_repository(text: str, address: HubAddress) -> None:
    assert is_hub_address(text) and is_hub_address(Path(text))
    assert hub_address(text) == hub_address(Path(text)) == address
    assert hub_address(str(address)) == address


@pytest.mark.parametrize(
    "text", ["hf://", "hf://jane", "hf://datasets/jane", "hf://jane/re ach", "hf://a/b/../../c"]
)
def test_what_is_no_address_is_a_sentence(text: str) -> None:
    with pytest.raises(BootifolError, match="is no address of the Hugging Face hub: type hf://USER/NAME"):
        hub_address(text)


def test_paths_are_no_addresses() -> None:
    assert not any(map(is_hub_address, ("runs/hf", Path("hf"), "/hf:/a", "http://a/b")))


def test_a_policy_is_read_from_its_repository(hub: Hub) -> None:
    repository = hub.root / "jane" / "reach"
    repository.mkdir(parents=True)
    pictures = PictureConfig(24, 32)
    config = PolicyConfig("drawn_reach", 120, 2, 2, 5.0, pictures)
    agent = DrQv2(DrQv2Config(encoder="strided", feature_dim=8, hidden_dim=16), 24, 3, 2, seed=3)
    write_policy(repository / "policy.safetensors", config, agent)
    write_policy(repository / "second.safetensors", replace(config, agent_steps=7), agent)

    loaded = bootifol.load_policy("hf://jane/reach")
    frame = np.random.default_rng(0).integers(0, 256, (24, 24, 3), np.uint8)
    np.testing.assert_array_equal(
        loaded.act(frame), read_policy(repository / "policy.safetensors").act(frame)
    )
    assert loaded.config == config
    assert bootifol.load_policy("hf://jane/reach@v1/second.safetensors").config.agent_steps == 7
    assert hub.asked == [("jane/reach/policy.safetensors", None), ("jane/reach/second.safetensors", "v1")]


def test_what_lies_there_in_place_of_a_policy_is_not_unpickled(hub: Hub) -> None:
    (hub.root / "eve" / "trap").mkdir(parents=True)
    (hub.root / "eve" / "trap" / "policy.safetensors").write_bytes(b"cos\nsystem\n(S'false'\ntR.")
    with pytest.raises(BootifolError, match="the policy is damaged or incomplete"):
        bootifol.load_policy("hf://eve/trap")


def test_videos_are_imported_from_a_data_set(hub: Hub, tmp_path: Path, capsys: Any) -> None:
    repository = hub.root / "jane" / "kitchen"
    (repository / "left").mkdir(parents=True)
    for number, frames in enumerate(episodes(3)):
        write_video(repository / "left" / f"{number}.{'MP4' if number else 'mp4'}", frames, 10.0)
    for name in ("train.py", "weights.pkl", "left/actions.parquet"):
        (repository / name).write_bytes(b"import os")

    words = [
        "hf://datasets/jane/kitchen@v2",
        "--out",
        str(tmp_path / "demos"),
        "--frames",
        "6",
        "--size",
        "16",
    ]
    assert main(["demos", "import", *words]) == 0
    assert hub.asked == [("jane/kitchen", "v2")]
    fetched = [path.name for path in hub.cache.rglob("*") if path.is_file()]
    assert sorted(fetched) == ["0.mp4", "1.MP4", "2.MP4"], "code, pickles and actions stay where they are"
    videos = read_manifest(tmp_path / "demos" / "expert").videos
    assert [video.source["file"] for video in videos] == ["0.mp4", "1.MP4", "2.MP4"]
    assert {video.source["address"] for video in videos} == {"hf://datasets/jane/kitchen@v2"}
    assert "3 videos of 6 frames" in capsys.readouterr().out


def test_one_file_of_a_data_set_is_imported(hub: Hub, tmp_path: Path) -> None:
    repository = hub.root / "jane" / "kitchen"
    repository.mkdir(parents=True)
    for name, frames in zip(("a[1].mp4", "b.mp4"), episodes(2), strict=True):
        write_video(repository / name, frames, 10.0)
    one = bootifol.import_videos(
        ["hf://datasets/jane/kitchen/a[1].mp4"],
        tmp_path / "demos",
        Conversion(frames=6, size=16),
    )
    assert [video.source["file"] for video in one.manifest.videos] == ["a[1].mp4"]


def test_a_lerobot_dataset_is_imported_without_its_actions(hub: Hub, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    repository = hub.root / "jane" / "pusht"
    repository.mkdir(parents=True)
    write_lerobot(repository, episodes(3), 10.0, "push", lambda: None)
    conversion = Conversion(frames=6, size=16)
    made = bootifol.import_videos(["hf://datasets/jane/pusht"], tmp_path / "demos", conversion)
    assert not list(hub.cache.rglob("data")), "the frames' table, in which actions would be"
    sources = [video.source for video in made.manifest.videos]
    assert [(source["file"], source["episode"]) for source in sources] == [("pusht", n) for n in range(3)]
    assert {source["address"] for source in sources} == {"hf://datasets/jane/pusht"}


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("hf://datasets/jane/nowhere", r"hf://datasets/jane/nowhere cannot be fetched \(there is no such"),
        ("hf://jane/reach", "names a model, which has no videos to import: type hf://datasets/jane/reach"),
        ("hf://datasets/jane/text", "holds no videos or pictures of a kind that bootifol reads"),
    ],
)
def test_what_cannot_be_imported_is_a_sentence_and_leaves_nothing(
    hub: Hub, tmp_path: Path, capsys: Any, address: str, said: str
) -> None:
    (hub.root / "jane" / "text").mkdir(parents=True)
    (hub.root / "jane" / "text" / "README.md").write_text("# Words")
    with pytest.raises(BootifolError, match=said):
        bootifol.import_videos([address], tmp_path / "demos" / "expert")
    assert main(["demos", "import", address, "--out", str(tmp_path / "demos")]) == 2
    assert not (tmp_path / "demos").exists()


def test_a_policy_that_cannot_be_fetched_is_a_sentence(hub: Hub) -> None:
    with pytest.raises(BootifolError, match=r"hf://jane/gone cannot be fetched \(cannot find the requested"):
        bootifol.load_policy("hf://jane/gone")
    with pytest.raises(BootifolError, match="is a data set, not a policy"):
        bootifol.load_policy("hf://datasets/jane/gone")


def test_a_missing_huggingface_hub_is_a_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "huggingface_hub", None)
    for fetch in (
        lambda: bootifol.load_policy("hf://jane/reach"),
        lambda: bootifol.import_videos(["hf://datasets/jane/reach"], tmp_path / "demos"),
    ):
        with pytest.raises(BootifolError, match=r"huggingface_hub, which is missing: .* its extra `hub`"):
            fetch()


def test_the_functions_take_what_they_are_given() -> None:
    """The real ones, of which the tests above have copies that need no network."""
    import inspect

    for name in ("hf_hub_download", "snapshot_download"):
        real = inspect.signature(getattr(huggingface_hub, name)).parameters
        assert set(inspect.signature(getattr(Hub, name)).parameters) - {"self"} <= set(real)

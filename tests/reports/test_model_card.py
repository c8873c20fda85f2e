"""The folder for the Hugging Face hub: what the hub reads of its card, and what a stranger is told and not told."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from made_up_runs import write_run
from PIL import Image
from synthetic_run import EXPERT_RETURN, write_synthetic_run

from bootifol.agents.config import DrQv2Config
from bootifol.agents.drqv2 import DrQv2
from bootifol.agents.policy import PolicyConfig, write_policy
from bootifol.envs.pictures import PictureConfig
from bootifol.errors import BootifolError
from bootifol.reports.model_card import public_command, what_taught, write_model_folder
from bootifol.reports.run_files import read_run
from bootifol.training.policy_export import export_policy

POLICY = PolicyConfig("reacher_hard", 60_000, 2, 2, 25.0, PictureConfig(24, 32))


def with_policy(run_dir: Path) -> Path:
    agent = DrQv2(DrQv2Config(encoder="strided", feature_dim=8, hidden_dim=16), 24, 3, 2, seed=3)
    write_policy(run_dir / "policy.safetensors", POLICY, agent)
    return run_dir


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A run, and the folder made of it."""
    root = tmp_path_factory.mktemp("exported")
    run = with_policy(write_synthetic_run(root / "arm-1"))
    written = export_policy(run, hub=root / "reacher-from-videos")
    assert written.hub is not None and written.onnx is None
    return run, written.hub


def test_the_folder_has_what_a_stranger_needs_and_no_more(exported: tuple[Path, Path]) -> None:
    run, folder = exported
    names = ["README.md", "config.json", "film_strip.png", "policy.safetensors", "replay.mp4", "returns.png"]
    assert sorted(path.name for path in folder.iterdir()) == names
    for copied, original in (("policy.safetensors",) * 2, ("replay.mp4", "videos/agent-0.mp4")):
        assert (folder / copied).read_bytes() == (run / original).read_bytes()
    for picture in ("returns.png", "film_strip.png"):
        width, _ = Image.open(folder / picture).size
        assert width > 700
        assert f"]({picture})" in (folder / "README.md").read_text()
    config = json.loads((folder / "config.json").read_text())
    assert config["policy"]["frames_per_second"] == 25.0
    assert config["training"]["agent"]["batch_size"] == 128
    assert "demos" not in config, "where the videos lay is nobody's business"


def test_the_hub_reads_the_card(exported: tuple[Path, Path]) -> None:
    hub = pytest.importorskip("huggingface_hub")
    card = hub.ModelCard.load(exported[1] / "README.md")
    assert card.data.library_name == "bootifol"
    assert {"imitation-learning", "learning-from-videos", "reacher_hard"} <= set(card.data.tags)
    results = {result.metric_type: result for result in card.data.eval_results}
    assert set(results) == {"mean_reward", "scaled_return"}
    final = read_run(exported[0]).evaluations_of(500)[60_000]
    mean = sum(row.environment_return for row in final) / len(final)
    assert results["mean_reward"].metric_value.startswith(f"{mean:.3g} (95% interval ")
    assert results["mean_reward"].dataset_name == "reacher_hard"


def test_the_card_says_what_the_run_was(exported: tuple[Path, Path]) -> None:
    text = (exported[1] / "README.md").read_text()
    for said in (
        "# Reacher Hard: a policy learned from videos",
        "the newest 3 pictures of 24×24 pixels and answers with 2 numbers, 25 times a second",
        "Over 10 episodes of 500 agent steps, after 60,000 of training; ",
        f"(returns of 9.17 and {EXPERT_RETURN * 500 / 60:.0f})",
        "The policy returns",
        "| `bootifol`, `cpu`, 1 |",
        'bootifol.load_policy("hf://USER/reacher-from-videos")',
        "bootifol train --task reacher_hard --method bootifol --preset cpu --demos demos/reacher_hard",
    ):
        assert said in text


@pytest.mark.parametrize(
    ("changes", "taught"),
    [
        ({}, "The **learned reward alone** taught this policy: a reward that was learned from 30 videos"),
        (
            {"demonstrations__fraction": 0.5},
            "began as a **clone** of the videos, and then **learned by reward**",
        ),
        (
            {"demonstrations__fraction": 0.5, "demonstrations__cloning_updates": 0},
            "with actions that inverse dynamics inferred; nothing was cloned",
        ),
        (
            {"demonstrations__fraction": 0.5, "agent__cloning_weight": 1e6},
            "This policy is a **clone** of 30 videos, without actions",
        ),
        ({"method": "environment"}, "The environment's **true reward** taught this policy"),
    ],
)
def test_the_card_says_what_taught_the_policy(tmp_path: Path, changes: dict[str, Any], taught: str) -> None:
    run = write_run(tmp_path / "run", videos={"expert": {"count": 30, "digest": "0a"}}, **changes)
    assert taught in what_taught(read_run(run))


def test_a_run_without_evaluations_and_pictures_has_a_card_that_says_so(
    bare_run: Path, tmp_path: Path
) -> None:
    write_model_folder(tmp_path / "hub", with_policy(bare_run), POLICY)
    assert sorted(path.name for path in (tmp_path / "hub").iterdir()) == [
        "README.md",
        "config.json",
        "policy.safetensors",
    ]
    text = (tmp_path / "hub" / "README.md").read_text()
    assert "The run has no evaluations." in text and "![" not in text and "model-index" not in text


def test_words_of_a_strangers_run_stay_words(bare_run: Path, tmp_path: Path) -> None:
    config = json.loads((bare_run / "config.json").read_text())
    config["task"] = "b`\n---\nlicense: x\n<script>alert(1)</script> [a](http)"
    config["command"] = "x\n```\n<script>"
    (bare_run / "config.json").write_text(json.dumps(config))
    write_model_folder(tmp_path / "hub", with_policy(bare_run), POLICY)
    text = (tmp_path / "hub" / "README.md").read_text()
    assert [line for line in text.splitlines() if line in ("---", "license: x")] == ["---", "---"]
    (heading,) = [line.lower() for line in text.splitlines() if line.startswith("# ")]
    assert "\\` --- license. x &lt;script&gt;alert(1)&lt;/script&gt; \\[a\\](http)" in heading
    assert text.count("```") == 4


@pytest.mark.parametrize(
    ("command", "shown"),
    [
        ("/home/jane/.venv/bin/bootifol train --out runs/a", "bootifol train --out runs/a"),
        ("bootifol train --demos /data/jane/reach/ --seed 1", "bootifol train --demos reach --seed 1"),
        ("bootifol train --demos=~/secret/reach", "bootifol train --demos=reach"),
        ("bootifol train '--out' 'it", "bootifol train ''\"'\"'--out'\"'\"'' ''\"'\"'it'"),
        ("", "(not recorded)"),
    ],
)
def test_the_command_is_shown_without_the_machines_folders(command: str, shown: str) -> None:
    assert public_command(command) == shown


def test_what_cannot_be_exported_is_a_sentence_and_leaves_nothing(bare_run: Path, tmp_path: Path) -> None:
    hub = tmp_path / "hub"
    for run, changes, said in (
        (bare_run, {}, "say what to export: --onnx FILE, --hub DIRECTORY, or both"),
        (bare_run, {"hub": hub}, r"has no policy\.safetensors: .* unless its agent acts on encodings"),
        (tmp_path / "nowhere", {"hub": hub}, "the policy is missing"),
        (tmp_path, {"hub": hub}, "the configuration of the run .* is missing"),
    ):
        with pytest.raises(BootifolError, match=said):
            export_policy(run, **changes)
    run = with_policy(bare_run)
    for run_or_file, changes, said in (
        (run, {"onnx": tmp_path / "p.bin"}, r"whose name ends in \.onnx"),
        (run / "policy.safetensors", {"hub": hub}, "--hub needs the directory of a run"),
        (run, {"hub": run}, "exists already: choose another directory"),
    ):
        with pytest.raises(BootifolError, match=said):
            export_policy(run_or_file, **changes)
    assert not hub.exists() and not (tmp_path / "p.bin").exists()

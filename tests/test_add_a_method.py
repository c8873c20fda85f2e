"""docs/add_a_method.md as its reader would follow it: the file on the page, trained, resumed, and what goes wrong."""

from __future__ import annotations

import csv
import json
import os
import signal
import sys
from pathlib import Path

import numpy as np
import pytest
from benchmarks.page_modules import ADD_A_METHOD, write_page_modules

import bootifol
from bootifol.cli.main import main
from bootifol.demos.demo_set import DemoSet
from bootifol.envs.pictures import PictureConfig
from bootifol.errors import BootifolError
from bootifol.files import read_arrays
from bootifol.rewards.base import RewardModel
from bootifol.rewards.config import RewardConfig
from bootifol.rewards.references import draw_references
from bootifol.rewards.registry import check_method, make_reward_model
from bootifol.training.build import build_reward_model
from bootifol.training.checkpoint import newest_checkpoint
from bootifol.training.interactive import InteractivePhase
from bootifol.training.run_config import RunConfig
from bootifol.types import StepMetrics, Video

METHOD = "optimal_transport:OptimalTransport"
TINY = [
    *(
        "--task",
        "drawn_home",
        "--preset",
        "smoke",
        "--threads",
        "1",
        "--tracker",
        "none",
        "--demos",
        "demos",
    ),
    *("--pictures.agent-size", "32", "--pictures.video-size", "32", "--agent.encoder", "strided"),
    *("--alignment.gradient-steps", "40", "--interactive.agent-steps", "120", "--evaluation.every", "120"),
    *("--agent.warm-up-steps", "60", "--agent.update-every", "20", "--agent.batch-size", "8"),
    *(
        "--interactive.log-every",
        "60",
        "--demonstrations.fraction",
        "0",
        "--evaluation.showcase-episodes",
        "1",
    ),
]


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A researcher's directory: the page's files, and videos."""
    home = tmp_path_factory.mktemp("add_a_method")
    write_page_modules(ADD_A_METHOD, home)
    bootifol.record_demos("drawn_home", home / "demos", episodes=40, pictures=PictureConfig(32, 32))
    return home


@pytest.fixture(autouse=True)
def at_home(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(home)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setenv("COLUMNS", "400")


@pytest.fixture(scope="module")
def run(home: Path) -> Path:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(home)
        patch.setattr(sys, "path", list(sys.path))
        assert main(["train", *TINY, "--method", METHOD, "--out", "run"]) == 0
    return home / "run"


def trained(run: Path) -> RewardModel:
    model = build_reward_model(RunConfig.read(run))
    newest = newest_checkpoint(run / "checkpoints")
    assert newest is not None
    model.load_state(read_arrays(newest / "reward_model.safetensors", "the reward model"))
    return model


def test_the_page_holds_two_short_files(home: Path) -> None:
    lines = {
        path.name: sum(bool(line.strip()) for line in path.read_text().splitlines())
        for path in sorted(home.glob("*.py"))
    }
    assert list(lines) == ["optimal_transport.py", "variants.py"]
    assert lines["optimal_transport.py"] <= 75


def test_it_trains_to_a_report(run: Path) -> None:
    assert json.loads((run / "config.json").read_text())["method"] == METHOD
    assert METHOD in (run / "report.html").read_text()
    lines = [json.loads(line) for line in (run / "metrics.jsonl").open()]
    logged = {name for line in lines for name in line.get("metrics", line)}
    assert {"loss/near", "loss/far", "loss/total", "episode/learned_reward"} <= logged


def test_it_puts_held_out_expert_videos_above_random_ones(run: Path) -> None:
    rows = [row for row in csv.DictReader((run / "ranking.csv").open()) if row["agent_steps"] == "0"]
    rewards = {
        kind: [float(row["reward"]) for row in rows if row["kind"] == kind] for kind in ("expert", "random")
    }
    assert len(rewards["expert"]) == len(rewards["random"]) == 6
    assert np.mean(rewards["expert"]) > np.mean(rewards["random"])
    above = np.subtract.outer(rewards["expert"], rewards["random"]) > 0
    assert above.mean() > 0.8


def test_its_rewards_are_those_of_a_causal_pass(run: Path) -> None:
    model = trained(run)
    expert, random = (DemoSet.open(run.parent / "demos" / kind) for kind in ("expert", "random"))
    references = draw_references(model, expert, np.random.default_rng(0))
    video = random[0]
    rewards = model.label(video, references)
    assert rewards.shape == (len(video.frames) - 1,) and rewards.dtype == np.float32
    assert (rewards <= 0).all() and np.ptp(rewards) > 0.01
    changed = video.frames.copy()
    changed[20] = 255 - changed[20]
    after = model.label(Video("changed", changed), references)
    np.testing.assert_array_equal(after[:19], rewards[:19])
    assert after[19] != rewards[19]


def test_a_plan_carries_the_newest_frame_to_what_is_like_it(home: Path) -> None:
    """Two places, x and y: the expert is at x, x, y, y; an agent that comes to y a step later pays for that step."""
    import torch

    sys.path.insert(0, str(home))
    from optimal_transport import Config, newest_costs  # type: ignore[import-not-found]

    x, y = torch.tensor([1.0, 0.0]), torch.tensor([0.0, 1.0])
    expert = torch.stack([x, x, y, y])
    settings = Config(epsilon=0.02, iterations=200)
    torch.testing.assert_close(newest_costs(expert, expert, settings), torch.zeros(4), atol=1e-3, rtol=0)
    # At frame 2 a third of the expert's mass lies on y, and the three frames at x share its cost.
    late = newest_costs(torch.stack([x, x, x, y]), expert, settings)
    torch.testing.assert_close(late, torch.tensor([0.0, 0.0, 1 / 3, 0.0]), atol=1e-3, rtol=0)
    # One that never comes pays the fraction of the expert's frames at y.
    never = newest_costs(torch.stack([x, x, x, x]), expert, settings)
    torch.testing.assert_close(never, torch.tensor([0.0, 0.0, 1 / 3, 1 / 2]), atol=1e-3, rtol=0)


def test_a_run_stopped_and_resumed_is_the_uninterrupted_run(
    home: Path, run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    play = InteractivePhase.play_episode

    def play_and_stop(self: InteractivePhase) -> list[StepMetrics]:
        if self.counters.episodes == 2:
            os.kill(os.getpid(), signal.SIGTERM)
        return play(self)

    with monkeypatch.context() as patch:
        patch.setattr(InteractivePhase, "play_episode", play_and_stop)
        assert main(["train", *TINY, "--method", METHOD, "--out", "parts"]) == 130
    assert not (home / "parts" / "report.html").exists()
    assert main(["train", "--resume", "parts"]) == 0
    whole, parts = (trained(home / name).state() for name in ("run", "parts"))
    assert whole.keys() == parts.keys()
    for name, array in whole.items():
        np.testing.assert_array_equal(array, parts[name], err_msg=name)


def test_videos_are_scored(run: Path) -> None:
    rewards = bootifol.score(run, [run.parent / "demos" / "expert"])
    assert len(rewards) == 40
    assert all(len(of_video) == 30 for of_video in rewards.values())


def test_a_variant_is_a_name() -> None:
    assert make_reward_model("variants:one_reference", RewardConfig(), 32, seed=0).reference_count == 1


def test_without_its_module_a_run_says_so_in_a_sentence(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path != str(run.parent)])
    monkeypatch.delitem(sys.modules, "optimal_transport")
    assert main(["train", "--resume", str(run)]) == 2
    said = capsys.readouterr().err
    assert f"there is no module optimal_transport for {METHOD}, neither in {tmp_path}" in said
    assert "Traceback" not in said
    assert bootifol.evaluate(run, episodes=1).episode_steps == 60, "a policy acts without its reward"


BROKEN = """
class Nothing:
    def __init__(self, video_size, seed, device):
        self.version = 0

class Cheat(Nothing):
    reads_environment_reward = True
    keeps_learning, reference_count = False, 0
    def align(self, expert, other): return iter(())
    def update(self, expert, agent): return {}
    def label(self, video, references): return video.environment_rewards
    def state(self): return {}
    def load_state(self, arrays): pass

def without_device(video_size, seed): pass

number = 3
"""


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        (
            "Nothing",
            "no reward method: the Nothing it makes lacks reads_environment_reward, .*label.*says what each",
        ),
        ("Cheat", "asks for the environment's reward, which only evaluation may see"),
        ("without_device", r"failed when called with \(video_size, seed, device\).*takes 2 positional"),
        ("number", "has no reward method number; it has Nothing, Cheat, without_device"),
    ],
)
def test_what_is_no_method_gets_a_sentence(home: Path, name: str, sentence: str) -> None:
    (home / "broken_method.py").write_text(BROKEN)
    try:
        with pytest.raises(BootifolError, match=sentence) as raised:
            make_reward_model(f"broken_method:{name}", RewardConfig(), 32, seed=0)
    finally:
        (home / "broken_method.py").unlink()
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("method", ["gail", "my method:Gail", "optimal_transport:"])
def test_a_method_that_cannot_be_meant_is_refused_before_anything_is_written(
    home: Path, tmp_path: Path, method: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(BootifolError, match=r"no reward method.*MODULE:NAME for one of your own"):
        check_method(method)
    assert main(["train", *TINY, "--method", method, "--out", str(tmp_path / "run")]) == 2
    assert "there is no reward method" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []

import re
from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from dot_videos import DotVideos

from bootifol.cli.train import train
from bootifol.errors import BootifolError
from bootifol.presets import PRESETS, PresetName
from bootifol.rewards.base import RewardModel
from bootifol.rewards.bootifol.config import BootifolConfig
from bootifol.rewards.config import RewardConfig
from bootifol.rewards.context_translation.config import ContextTranslationConfig
from bootifol.rewards.gaifo.config import GaifoConfig
from bootifol.rewards.registry import METHODS, make_reward_model
from bootifol.rewards.virl.config import VirlConfig
from bootifol.types import Video

CONFIG = RewardConfig(
    BootifolConfig(width_divisor=32),
    VirlConfig(width_divisor=32),
    ContextTranslationConfig(width_divisor=32),
    GaifoConfig(width_divisor=32),
)


def test_every_method_that_learns_has_a_section_of_its_name() -> None:
    assert {field.name for field in fields(RewardConfig)} == METHODS.keys() - {"environment"}


@pytest.mark.parametrize("method", list(METHODS))
def test_every_method_can_be_made(method: str) -> None:
    model: RewardModel = make_reward_model(method, CONFIG, 32, seed=0)
    model.load_state(model.state())
    assert model.version == 0
    assert model.reads_environment_reward == (method == "environment")
    assert model.keeps_learning == (method in ("virl", "gaifo"))


# The preset backbone wants a download, and the other methods cannot read its large videos.
@pytest.mark.parametrize("name", [name for name in PRESETS if name != "backbone"])
@pytest.mark.parametrize("method", [method for method in METHODS if method != "environment"])
def test_every_preset_rewards_videos_of_its_size_by_every_method(method: str, name: PresetName) -> None:
    config, size = PRESETS[name], PRESETS[name].pictures.video_size
    model = make_reward_model(method, config.reward, size, seed=0)
    expert, agent = DotVideos("expert", False, 10, size, 5), DotVideos("agent", True, 1, size, 5)
    rewards = model.label(agent[0], [expert[index] for index in range(model.reference_count)])
    assert rewards.shape == (4,) and np.isfinite(rewards).all()


@pytest.mark.parametrize(
    ("config", "field", "sentence"),
    [
        (
            BootifolConfig,
            {"reward": "cosin"},
            r"reward\.bootifol\.reward must be distance, cosine or frames",
        ),
        (BootifolConfig, {"reward_scale": "max"}, r"reward_scale must be none or alignment"),
        (
            ContextTranslationConfig,
            {"reward_unit": "mean"},
            r"reward\.context_translation\.reward_unit must be none or expert",
        ),
        (GaifoConfig, {"precision": "fp16"}, r"reward\.gaifo\.precision must be fp32 or bf16"),
        (
            BootifolConfig,
            {
                f"{loss}_weight": 0.0
                for loss in ("multiview", "triplet", "autoencoder", "prediction", "sequence")
            },
            "are all 0, so nothing would be learned",
        ),
        (
            BootifolConfig,
            {"backbone": "any", "triplet_weight": 0.0, "prediction_weight": 0.0, "sequence_weight": 0.0},
            "bootifol: triplet_weight, prediction_weight, sequence_weight are all 0",
        ),
    ],
)
def test_a_choice_that_is_none_is_refused(config: Any, field: dict[str, Any], sentence: str) -> None:
    with pytest.raises(BootifolError, match=sentence):
        config(**field)


def test_the_command_line_offers_every_method() -> None:
    assert train.__doc__ is not None
    (described,) = re.findall(r"method: (.*?)\n +seed:", train.__doc__, re.DOTALL)
    assert all(method in described for method in METHODS)


def test_unknown_methods_are_refused_with_the_known_ones() -> None:
    with pytest.raises(BootifolError, match=f"no reward method 'gail'; choose one of {', '.join(METHODS)}"):
        make_reward_model("gail", CONFIG, 32, seed=0)


def test_the_upper_bound_passes_on_the_true_reward() -> None:
    model = make_reward_model("environment", CONFIG, 32, seed=0)
    frames = np.zeros((4, 32, 32, 3), np.uint8)
    rewards = np.array([0.0, 1.0, 2.0], np.float32)
    assert model.reference_count == 0
    np.testing.assert_array_equal(model.label(Video("agent-0", frames, rewards), []), rewards)
    with pytest.raises(BootifolError, match="demo-0 has none"):
        model.label(Video("demo-0", frames), [])


def test_the_upper_bound_learns_nothing() -> None:
    model = make_reward_model("environment", CONFIG, 32, seed=0)
    assert list(model.align(None, None)) == []  # type: ignore[arg-type]
    assert model.update(None, None) == {}  # type: ignore[arg-type]
    assert model.state() == {}

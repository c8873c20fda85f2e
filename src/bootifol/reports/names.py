"""What tasks and agents are called in tables and figures."""

from __future__ import annotations

from bootifol.reports.run_files import CLONING, RunFiles, flattened
from bootifol.rewards.config import NAMES
from bootifol.tasks import short_name

METHOD_NAMES = {
    **NAMES,
    "environment": "True reward",
    "random": "Random",
    "expert": "Expert",
}
"""The paper's names of the methods; `environment`, which it does not have, learns from the true reward."""

LEARN_NOTHING = {"random", "expert"}
"""Ends of the scale, which are played but not trained: they have final episodes, no budget and no curve."""

CLONING_ALONE = 1e6
"""From so large a `cloning_weight` on, no reward is heard: the agent is a clone of the videos, whatever the method."""


def task_title(task: str) -> str:
    """Reacher Hard of reacher_hard; names with a colon are other people's and stay as they are."""
    return short_name(task) if ":" in task else task.replace("_", " ").title()


def hears_reward(run: RunFiles) -> bool:
    """Whether the reward has a say in what the policy becomes."""
    try:
        weight = float(dict(flattened(run.config)).get("agent.cloning_weight", 0.0))
    except ValueError:  # somebody wrote no number
        return True
    return weight < CLONING_ALONE


def clones(run: RunFiles) -> bool:
    """Whether the policy was pulled to inferred actions, or began with them; where they are experience alone it was
    not."""
    config = dict(flattened(run.config))
    try:
        updates, weight = (
            float(config.get(name, default))
            for name, default in (("demonstrations.cloning_updates", 1.0), ("agent.cloning_weight", 0.0))
        )
    except ValueError:  # somebody wrote no number
        return True
    return infers_actions(run) and (updates > 0 or weight > 0)


def infers_actions(run: RunFiles) -> bool:
    """Whether expert videos with inferred actions were among what the policy learned from."""
    try:
        fraction = float(dict(flattened(run.config)).get("demonstrations.fraction", 0.0))
    except ValueError:  # somebody wrote no number
        fraction = 0.0
    return fraction > 0 or CLONING in run.phase_seconds


def agent_name(run: RunFiles) -> str:
    """The paper's name of what a run trained, such as `CT (n=10)`; any other method's own name."""
    config = dict(flattened(run.config))
    if not hears_reward(run):
        return "Cloning alone"
    name = METHOD_NAMES.get(run.method, run.method)
    if run.method == "context_translation":
        return f"{name} (n={config.get('reward.context_translation.references', '?')})"
    if run.method == "bootifol":
        backbone = config.get("reward.bootifol.backbone", "None")
        if "efficientnet" in backbone:
            name = f"Eff-{name}"
        elif backbone not in ("", "None", "none"):
            name = f"{name} ({backbone})"
        if config.get("reward.bootifol.reward") == "cosine":
            name = f"{name} (cosine)"
    return name

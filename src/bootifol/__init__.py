"""Videos in, policy out: imitation from observation with bootstrapped contrastive learning.

The same as the command line, from Python:

    import bootifol

    bootifol.record_demos("reacher_hard", "demos/reacher_hard", episodes=200)
    bootifol.train("reacher_hard", "demos/reacher_hard", "runs/first", preset="cpu")
    print(bootifol.evaluate("runs/first", episodes=10).scaled_return)
    policy = bootifol.load_policy("runs/first")  # policy.reset(), then policy.act(picture) once an agent step
    rewards = bootifol.score("runs/first", ["my_video.mp4"])
    bootifol.report(["runs/first"], "report.html")
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bootifol.agents.policy import Policy as Policy
    from bootifol.demos.export_videos import export_videos as export_videos
    from bootifol.demos.import_videos import import_videos as import_videos
    from bootifol.demos.record import record_demos as record_demos
    from bootifol.errors import BootifolError as BootifolError
    from bootifol.presets import preset as preset
    from bootifol.reports.html import report as report
    from bootifol.reports.table_files import table as table
    from bootifol.training.api import continue_run as resume
    from bootifol.training.api import evaluate_run as evaluate
    from bootifol.training.api import score_videos as score
    from bootifol.training.api import train_policy as train
    from bootifol.training.callbacks import Callback as Callback
    from bootifol.training.callbacks import StopTraining as StopTraining
    from bootifol.training.policy_export import export_policy as export_policy
    from bootifol.training.saved_policy import load_policy as load_policy

__version__ = version("bootifol")

_WHERE = {
    "export_videos": ("bootifol.demos.export_videos", "export_videos"),
    "import_videos": ("bootifol.demos.import_videos", "import_videos"),
    "record_demos": ("bootifol.demos.record", "record_demos"),
    "Callback": ("bootifol.training.callbacks", "Callback"),
    "StopTraining": ("bootifol.training.callbacks", "StopTraining"),
    "Policy": ("bootifol.agents.policy", "Policy"),
    "BootifolError": ("bootifol.errors", "BootifolError"),
    "preset": ("bootifol.presets", "preset"),
    "report": ("bootifol.reports.html", "report"),
    "table": ("bootifol.reports.table_files", "table"),
    "resume": ("bootifol.training.api", "continue_run"),
    "evaluate": ("bootifol.training.api", "evaluate_run"),
    "score": ("bootifol.training.api", "score_videos"),
    "train": ("bootifol.training.api", "train_policy"),
    "export_policy": ("bootifol.training.policy_export", "export_policy"),
    "load_policy": ("bootifol.training.saved_policy", "load_policy"),
}
"""Module and name of each public function, imported when first used: `bootifol --help` must not wait for PyTorch."""

__all__ = [
    "BootifolError",
    "Callback",
    "Policy",
    "StopTraining",
    "evaluate",
    "export_policy",
    "export_videos",
    "import_videos",
    "load_policy",
    "preset",
    "record_demos",
    "report",
    "resume",
    "score",
    "table",
    "train",
]


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module 'bootifol' has no attribute '{name}'")
    module, attribute = _WHERE[name]
    return getattr(import_module(module), attribute)

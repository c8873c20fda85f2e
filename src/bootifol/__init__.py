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
    from bootifol.api import evaluate as evaluate
    from bootifol.api import resume as resume
    from bootifol.api import score as score
    from bootifol.api import train as train
    from bootifol.demos.export_videos import export_videos as export_videos
    from bootifol.demos.import_videos import import_videos as import_videos
    from bootifol.demos.record import record_demos as record_demos
    from bootifol.errors import BootifolError as BootifolError
    from bootifol.presets import preset as preset
    from bootifol.reports.html import report as report
    from bootifol.reports.table_files import table as table
    from bootifol.training.callbacks import Callback as Callback
    from bootifol.training.callbacks import StopTraining as StopTraining
    from bootifol.training.policy_export import export_policy as export_policy
    from bootifol.training.saved_policy import load_policy as load_policy

__version__ = version("bootifol")

_MODULES = {
    "BootifolError": "errors",
    "Callback": "training.callbacks",
    "Policy": "agents.policy",
    "StopTraining": "training.callbacks",
    "evaluate": "api",
    "export_policy": "training.policy_export",
    "export_videos": "demos.export_videos",
    "import_videos": "demos.import_videos",
    "load_policy": "training.saved_policy",
    "preset": "presets",
    "record_demos": "demos.record",
    "report": "reports.html",
    "resume": "api",
    "score": "api",
    "table": "reports.table_files",
    "train": "api",
}
"""Where each public name is, imported when first used: `bootifol --help` must not wait for PyTorch."""

__all__ = list(_MODULES)


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'bootifol' has no attribute '{name}'")
    return getattr(import_module(f"bootifol.{_MODULES[name]}"), name)

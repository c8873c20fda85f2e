"""Arguments that are given by their place, as several commands take them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

RunPath = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
RunPaths = Annotated[
    list[Path],
    tyro.conf.Positional,
    tyro.conf.arg(metavar="RUN [RUN ...]", help_behavior_hint="(one or more)"),
]
VideoPaths = Annotated[
    list[Path],
    tyro.conf.Positional,
    tyro.conf.arg(metavar="VIDEO [VIDEO ...]", help_behavior_hint="(one or more)"),
]
Flag = Annotated[
    tyro.conf.UseCounterAction[int], tyro.conf.arg(metavar="", help_behavior_hint="(default: no)")
]
"""A flag without a value."""
Trust = Flag
DemosPath = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DEMOS")]

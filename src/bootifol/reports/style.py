"""The look of every picture: one palette, one style, one color per kind.

The palette (from Okabe and Ito's) can be told apart with any color vision: expert dark blue, half-good light
blue, agent vermilion, random gray.
"""

from __future__ import annotations

import base64
import io
import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from bootifol.errors import BootifolError
from bootifol.files import written_aside

KIND_COLORS = {"expert": "#0B5394", "half_good": "#56B4E9", "agent": "#D55E00", "random": "#7A7F87"}
KIND_NAMES = {"expert": "expert", "half_good": "half-good", "agent": "agent", "random": "random"}
RUN_COLORS = ("#D55E00", "#009E73", "#AA4499", "#E69F00", "#332288", "#661100")
RUN_DASHES = ("-", (0, (5, 2)), (0, (1.5, 1.5)), (0, (6, 2, 1.5, 2)))
INK, FAINT, GRID = "#30363D", "#8B929B", "#E7EAEE"

HALF_WIDTH = (5.1, 3.0)
"""Size in inches of a figure that fills half of the page, or all of a phone."""

# Any, since matplotlib's versions disagree on the type of the keys.
STYLE: Any = {
    "font.size": 9.0,
    "axes.labelsize": 9.0,
    "axes.labelcolor": INK,
    "axes.edgecolor": "#C4C9D0",
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.grid.axis": "y",
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "xtick.major.size": 3.0,
    "ytick.major.size": 0.0,
    "lines.linewidth": 1.7,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "text.color": INK,
    "figure.facecolor": "white",
    "svg.fonttype": "none",
    "svg.hashsalt": "bootifol",
}


@contextmanager
def house_style() -> Iterator[None]:
    """Figures made inside have the report's look; matplotlib's global settings are left alone."""
    with mpl.rc_context(STYLE):
        yield


def svg_data_uri(figure: Figure) -> str:
    """The figure as an SVG data URI. Text stays text, in the reader's own sans-serif font."""
    buffer = io.BytesIO()
    with house_style():
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = re.sub(
        r"(font: [^';\"]*?)'[^;\"]*",
        r"\1system-ui, 'Segoe UI', Roboto, Arial, sans-serif",
        buffer.getvalue().decode(),
    )
    return "data:image/svg+xml;base64," + base64.b64encode(text.encode()).decode("ascii")


def save_png(figure: Figure, out: Path, dots_per_inch: float | None = None) -> Path:
    """Writes the figure, whole or not at all, and returns its path.

    Args:
        figure: what is drawn.
        out: the file.
        dots_per_inch: by default the figure's own.

    Raises:
        BootifolError: the file's name does not end in .png, or it cannot be written.
    """
    require_png(out)
    with house_style(), written_aside(out) as aside:
        figure.savefig(aside, format="png", dpi=dots_per_inch or "figure")
    return out


def require_png(out: Path) -> None:
    """Refuses other names before any work is done.

    Raises:
        BootifolError: the file's name does not end in .png.
    """
    if out.suffix != ".png":
        raise BootifolError(
            f"a figure is written as a PNG file, not as {out.name}; choose a name that ends in .png"
        )


def legend_above(figure: Figure) -> None:
    """One legend above all plots, every label once, in as many columns as its labels leave room for.

    The figure grows by its third line and those that follow, so that the plots keep their height.
    """
    lines: dict[str, Any] = {}
    for axes in figure.axes:
        for line, label in zip(*axes.get_legend_handles_labels(), strict=True):
            lines.setdefault(label, line)
    # A label wants about 0.55 inches for its line and 0.07 a letter.
    inches = 0.55 + 0.07 * max(len(label) for label in lines)
    columns = max(1, int(figure.get_figwidth() / inches))
    figure.set_figheight(figure.get_figheight() + 0.19 * max(math.ceil(len(lines) / columns) - 2, 0))
    figure.legend(
        list(lines.values()),
        list(lines),
        loc="outside upper left",
        ncols=columns,
        handlelength=3.8,
        columnspacing=1.2,
    )


def agent_step_axis(axes: Axes) -> None:
    """A horizontal axis of agent steps."""
    step_axis(axes, "agent steps")


def step_axis(axes: Axes, label: str) -> None:
    """A horizontal axis of counts."""
    axes.set_xlabel(label)
    axes.xaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 5, 10], integer=True))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: thousands(value)))
    axes.margins(x=0.02)


def short_number(value: float) -> str:
    """A value for reading: three digits that count, and a real minus sign."""
    text = f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"
    return text.replace("-", "\N{MINUS SIGN}")


def thousands(value: float) -> str:
    """A count, short: 950, 12K, 1.55M."""
    for size, letter in ((1_000_000, "M"), (1_000, "K")):
        if abs(value) >= size:
            return f"{value / size:.2f}".rstrip("0").rstrip(".") + letter
    return f"{value:g}"

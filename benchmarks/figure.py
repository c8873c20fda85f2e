"""The figures of the paper, and others, from runs: one PNG each.

    python -m benchmarks.figure returns runs/reacher_hard runs/hopper_stand --out docs/images/returns.png
    python -m benchmarks.figure experts --out docs/images/experts.png

What must be said beside a figure (runs left out, unequal terms) is printed. `docs/tables.md` says what a line is.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import tyro
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.command import command
from benchmarks.rows import read_rows
from bootifol.cli.arguments import Flag
from bootifol.cli.help_texts import join_lines
from bootifol.errors import BootifolError
from bootifol.experts import BUNDLED
from bootifol.experts.train import COLUMNS
from bootifol.files import read_json
from bootifol.reports.collection import read_runs
from bootifol.reports.comparison import compare
from bootifol.reports.figures import Loss, ablation_figure, losses_figure, returns_figure
from bootifol.reports.film_strip import expert_above_agent, run_figure
from bootifol.reports.names import LEARN_NOTHING
from bootifol.reports.paper_results import RETURNS
from bootifol.reports.plots import draw_return_curves, looks_of
from bootifol.reports.run_files import ALIGNMENT, INTERACTIVE, RunFiles, flattened
from bootifol.reports.style import (
    FAINT,
    KIND_COLORS,
    RUN_COLORS,
    agent_step_axis,
    house_style,
    legend_above,
    save_png,
    thousands,
)

Runs = Annotated[
    list[Path],
    tyro.conf.Positional,
    tyro.conf.arg(
        metavar="RUN [RUN ...]",
        help="Directories that `bootifol train` wrote, collections, or directories that hold some.",
        help_behavior_hint="(one or more)",
    ),
]
Out = Annotated[Path, tyro.conf.arg(help="A PNG file.")]
Start = Annotated[int, tyro.conf.arg(help="Which start of the showcase, from 0.")]

PREDICTION, SEQUENCE = "loss/prediction", "loss/sequence"
L_SEQ = Loss(r"$\mathcal{L}_{seq} = \mathcal{L}_Z + \mathcal{L}_O$", (PREDICTION, SEQUENCE))
"""As in the paper, whatever the weights of a run."""

POLICIES = {"pictures": "image-based", "encodings": "encoding-based"}
"""What the paper calls policies, by what they see."""


def written(out: Path, figure: Figure, notes: Sequence[str] = ()) -> None:
    """Writes a figure and prints what must be said about it."""
    save_png(figure, out)
    for note in notes:
        print(f"- {note}")
    print(f"figure: {out}")


def returns(runs: Runs, out: Out, by_time: Flag = 0, scaled: Flag = 0) -> None:
    """Figure 4: average return while agents learn, of all methods, a panel a task.

    Mean over seeds, with 95 % bootstrap intervals. Unfinished runs are left out and named.

    Args:
        by_time: Over wall-clock time instead of agent steps.
        scaled: 0 for random actions, 1 for the expert.
    """
    read = read_runs(runs)
    comparison = compare([run for run in read if run.method not in LEARN_NOTHING])
    left_out = [
        f"{run.path} learns nothing, so it has no curve." for run in read if run.method in LEARN_NOTHING
    ]
    written(out, returns_figure(comparison, bool(by_time), bool(scaled)), [*comparison.notes, *left_out])


def alignment(runs: Runs, out: Out) -> None:
    """Figure 5: what the Alignment Phase brings on Reacher Hard.

    Three variants: with it; without (`--alignment.gradient-steps 0`); without and with a reward that learns until the
    run ends (`--interactive.reward-updates-until` as many as `--interactive.agent-steps`).
    """

    def variant(run: RunFiles) -> str:
        config = dict(flattened(run.config))
        if config.get("alignment.gradient_steps") != "0":
            return "alignment"
        to_the_end = trained_until(run) >= int(config.get("interactive.agent_steps", 0))
        return "no-alignment, trained to the end" if to_the_end else "no-alignment"

    compared = ("alignment.gradient_steps", "interactive.reward_updates_until")
    advice = "add one with and one without --alignment.gradient-steps 0"
    written(out, *ablation_figure(read_runs(runs), variant, compared, advice))


def encoding_based(runs: Runs, out: Out) -> None:
    """Figure 6a: a policy on pictures against one on the reward's encodings of them, on Reacher Hard."""

    def variant(run: RunFiles) -> str:
        # Runs from before there was a choice saw pictures.
        seen = dict(flattened(run.config)).get("agent.observations", "pictures")
        return POLICIES.get(seen, seen)

    advice = "add one of the other kind (--agent.observations)"
    written(out, *ablation_figure(read_runs(runs), variant, ("agent.observations",), advice))


def encoder_training(runs: Runs, out: Out) -> None:
    """Figure 6b: for how many agent steps the encoders should learn, on Reacher Hard.

    The paper has `--interactive.reward-updates-until` (N_train) 0, 100000, 375000 and 1550000 of 1550000 agent steps.
    """

    def variant(run: RunFiles) -> str:
        return f"{thousands(trained_until(run))}-step"

    read = sorted(read_runs(runs), key=trained_until)
    advice = "add one with another --interactive.reward-updates-until"
    written(out, *ablation_figure(read, variant, ("interactive.reward_updates_until",), advice))


def trained_until(run: RunFiles) -> int:
    """N_train."""
    return int(dict(flattened(run.config)).get("interactive.reward_updates_until", 0))


def sequence_loss(runs: Runs, out: Out) -> None:
    """Figure 7: L_seq during the Interactive Phase, and L_O, the part of it that tells expert from agent.

    Runs in progress will do.
    """
    comparison = compare(read_runs(runs), unfinished=True)
    losses = (L_SEQ, Loss(r"$\mathcal{L}_O$", (SEQUENCE,)))
    written(out, losses_figure(comparison, INTERACTIVE, losses), comparison.notes)


def alignment_losses(runs: Runs, out: Out) -> None:
    """Figure 8: L_Z, L_seq, L_ae and L_triplet during the Alignment Phase.

    Runs in progress will do.
    """
    comparison = compare(read_runs(runs), unfinished=True)
    losses = (
        Loss(r"$\mathcal{L}_Z$", (PREDICTION,)),
        L_SEQ,
        Loss(r"$\mathcal{L}_{ae}$", ("loss/autoencoder",)),
        Loss(r"$\mathcal{L}_{triplet}$", ("loss/triplet",)),
    )
    written(out, losses_figure(comparison, ALIGNMENT, losses), comparison.notes)


def demonstrations(runs: Runs, out: Out, start: Start = 0) -> None:
    """Figures 3 and 9: film strips of the expert above the agent, from the same start.

    The start is the first of the run's showcase, so that nobody chose it by how it went.
    """
    written(out, expert_above_agent(read_runs(runs), start))


def run(runs: Runs, out: Out, start: Start = 0) -> None:
    """One run on a page: its learning curve, the learned reward along episodes from one start, and their film strips.

    The start is the first of the run's showcase, so that nobody chose it by how it went.
    """
    read = read_runs(runs)
    if len(read) > 1:
        raise BootifolError(f"the figure shows one run, and there are {len(read)}; give the directory of one")
    written(out, run_figure(read[0], start))


def metrics(runs: Runs, out: Out, metrics: tuple[str, ...]) -> None:
    """Any metrics of some runs while the agent acts, beside their returns: a panel each, a line a run.

    Nothing is averaged: means over seeds hide what swings at another time in each. Runs in progress will do.

    Args:
        metrics: As metrics.jsonl names them.
    """
    written(out, *metrics_figure(read_runs(runs), metrics))


def metrics_figure(runs: Sequence[RunFiles], names: Sequence[str]) -> tuple[Figure, list[str]]:
    """The figure, and what must be said about it.

    Raises:
        BootifolError: no run has logged one of the metrics.
    """
    for name in names:
        if not any(each.curve(INTERACTIVE, name) for each in runs):
            logged = sorted({name for each in runs for phase, name in each.curves if phase == INTERACTIVE})
            raise BootifolError(f"no run has logged {name}; choose of {', '.join(logged) or 'none'}")
    looks = looks_of(runs)
    notes = []
    with house_style():
        panels = len(names) + 1
        figure = Figure(figsize=(3.5 * panels, 2.9), layout="constrained", dpi=120)
        first, *others = figure.subplots(1, panels)
        if not draw_return_curves(first, looks, scaled=True):
            notes.append("no run has scaled returns yet")
        first.set_title("return: 0 random, 1 the expert", loc="left", fontsize=9)
        first.set_ylabel("")
        for axes, name in zip(others, names, strict=True):
            for look in looks:
                if (curve := look.run.curve(INTERACTIVE, name)) is None:
                    notes.append(f"{look.run.path} has not logged {name}")
                    continue
                axes.plot(curve.steps, curve.values, color=look.color, linestyle=look.dashes)
            axes.set_title(name, loc="left", fontsize=9)
            agent_step_axis(axes)
        if len(runs) > 1:
            lines, labels = first.get_legend_handles_labels()
            figure.legend(lines, labels, loc="outside lower center", ncols=min(len(runs), 6))
    return figure, notes


def experts(
    out: Out = Path("docs/images/experts.png"),
    bundled: Path = BUNDLED,
    others: Path = Path("results/experts"),
) -> None:
    """How the bundled experts were trained: returns over the training, beside the trainings that did not get there.

    A panel for each task with a trained expert, from the curves that lie beside the experts.

    Args:
        bundled: Where the experts lie.
        others: Of other trainings: TASK_WHAT_WAS_DIFFERENT.csv joins the panel of its task.
    """
    written(out, experts_figure(bundled, others))


def experts_figure(bundled: Path, others: Path) -> Figure:
    """The figure.

    Raises:
        BootifolError: no expert lies there.
    """
    tasks = sorted(path.stem for path in bundled.glob("*.json"))
    if not tasks:
        raise BootifolError(
            f"no expert lies in {bundled}: put one there with python -m benchmarks.bundle_expert"
        )
    with house_style():
        figure = Figure(figsize=(3.6 * len(tasks), 3.2), layout="constrained")
        for number, task in enumerate(tasks):
            axes = figure.add_subplot(1, len(tasks), number + 1)
            taken = read_json(bundled / f"{task}.json", "the expert's training")["expert"]["agent_steps"]
            expert = KIND_COLORS["expert"]
            draw_training(axes, bundled / f"{task}.csv", "the bundled expert's training", expert, taken)
            for color, path in zip(RUN_COLORS, sorted(others.glob(f"{task}_*.csv")), strict=False):
                draw_training(axes, path, path.stem.removeprefix(f"{task}_").replace("_", " "), color)
            if task in RETURNS:
                level = RETURNS[task]["Expert"].absolute
                axes.axhline(level, color=FAINT, ls=":", label="the paper's expert")
            axes.set(title=task, ylim=(0, 1000))
            agent_step_axis(axes)
        figure.axes[0].set_ylabel("mean return")
        legend_above(figure)
    return figure


def draw_training(axes: Axes, path: Path, label: str, color: str, marked: int | None = None) -> None:
    """One training; a dot where the policy was taken from."""
    rows = read_rows(path, COLUMNS)
    steps = [int(row["agent_steps"]) for row in rows]
    means = [float(row["mean_return"]) for row in rows]
    axes.plot(steps, means, color=color, label=label)
    if marked is not None:
        axes.plot(marked, means[steps.index(marked)], "o", color=color)


FIGURES: dict[str, Callable[..., None]] = {
    "returns": returns,
    "alignment": alignment,
    "encoding-based": encoding_based,
    "encoder-training": encoder_training,
    "sequence-loss": sequence_loss,
    "alignment-losses": alignment_losses,
    "demonstrations": demonstrations,
    "run": run,
    "metrics": metrics,
    "experts": experts,
}


@command()
def main(words: Sequence[str] | None = None) -> None:
    for figure in FIGURES.values():
        join_lines(figure)
    tyro.extras.subcommand_cli_from_dict(
        FIGURES,
        prog="python -m benchmarks.figure",
        description=__doc__,
        args=list(sys.argv[1:] if words is None else words) or ["--help"],
    )


if __name__ == "__main__":
    raise SystemExit(main())

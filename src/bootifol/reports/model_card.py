"""A run's policy as a folder for the Hugging Face hub: the policy, its configuration, and a model card with pictures.

    policy.safetensors   what acts
    config.json          of the policy and of its training
    README.md            the model card, with YAML in front
    returns.png, film_strip.png, replay.mp4   where the run has evaluations and a showcase

The card says what the run's report says. Paths of the machine that trained are left out of all of it.
"""

from __future__ import annotations

import dataclasses
import html
import json
import re
import shlex
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from bootifol.agents.policy import PolicyConfig
from bootifol.evaluation.summary import Summary
from bootifol.files import write_json, written_aside
from bootifol.progress import duration
from bootifol.reports.film_strip import reward_above_film_strip, videos_of_start
from bootifol.reports.final_return import FinalReturn, final_return
from bootifol.reports.findings import findings
from bootifol.reports.markdown import markdown_table
from bootifol.reports.names import agent_name, clones, hears_reward, infers_actions, task_title
from bootifol.reports.plots import looks_of, return_curves
from bootifol.reports.result_tables import fixed_number
from bootifol.reports.run_files import RunFiles, read_run
from bootifol.reports.style import KIND_NAMES, save_png, short_number

POLICY = "policy.safetensors"
CARD = "README.md"
DOTS_PER_INCH = 150


def write_model_folder(folder: Path, run_dir: Path, policy: PolicyConfig) -> None:
    """Writes the folder, whole or not at all.

    Args:
        folder: it does not exist.
        run_dir: of a run that has a `policy.safetensors`.
        policy: the configuration in it.

    Raises:
        BootifolError: the run cannot be read, or the folder not be written.
    """
    run = read_run(run_dir)
    with written_aside(folder) as aside:
        aside.mkdir()
        shutil.copyfile(run_dir / POLICY, aside / POLICY)
        write_json(aside / "config.json", _configuration(run, policy))
        pictures = _write_pictures(aside, run)
        if ("agent", 0) in run.video_files:
            shutil.copyfile(run.video_files["agent", 0], aside / "replay.mp4")  # the hub plays it
        (aside / CARD).write_text(model_card(run, policy, folder.resolve().name, pictures))


def model_card(run: RunFiles, policy: PolicyConfig, name: str, pictures: Mapping[str, str]) -> str:
    """The text of the card.

    Args:
        run: from `read_run`.
        policy: of the run.
        name: of the folder, which stands for that of the repository.
        pictures: what `returns.png` and `film_strip.png` show, by their names, where they are.
    """
    environment = Environment(
        loader=PackageLoader("bootifol.reports", "templates"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    final = final_return(run)
    size, stack = policy.pictures.agent_size, policy.pictures.stack
    return environment.get_template("model_card.md").render(
        name=name,
        title=_plain(task_title(run.task)),
        tags=json.dumps(_tags(run)),
        final=final,
        model_index=json.dumps(_model_index(run, name, final)),
        taught=what_taught(run),
        pictures=f"the newest {stack} pictures of {size}×{size} pixels"
        if stack > 1
        else f"one of {size}×{size}",
        actions="a number" if policy.action_dim == 1 else f"{policy.action_dim} numbers",
        action_dim=policy.action_dim,
        rate=f"{policy.frames_per_second:g}",
        returns_picture="returns.png" in pictures,
        scale=pictures.get("returns.png", ""),
        film_picture="film_strip.png" in pictures,
        film=pictures.get("film_strip.png", ""),
        returns="" if final is None else _returns(run, final),
        findings=[_plain(finding.text) for finding in findings(run)],
        facts=_facts(run, policy),
        command=public_command(run.command),
    )


def what_taught(run: RunFiles) -> str:
    """Whether the learned reward taught the policy, or cloning, in sentences that stand alone."""
    count = run.videos.get("expert", {}).get("count")
    videos = f"{count:,} videos" if isinstance(count, int) else "videos"
    if run.method == "environment":
        return (
            "The environment's **true reward** taught this policy, as an upper bound for policies that learn from "
            "videos."
        )
    if not hears_reward(run):
        return (
            f"This policy is a **clone** of {videos}, without actions, states or rewards in them: inverse dynamics "
            "infer the actions (behavioral cloning from observation). No reward was heard."
        )
    reward = f"a reward that was learned from {videos} ({_plain(agent_name(run))})"
    if not infers_actions(run):
        return (
            f"The **learned reward alone** taught this policy: {reward}, without actions, states or rewards in them. "
            "Nothing was cloned."
        )
    if not clones(run):
        return (
            f"This policy **learned by reward**: {reward}, without actions, states or rewards in them. The videos were "
            "among its experience, with actions that inverse dynamics inferred; nothing was cloned."
        )
    return (
        f"This policy began as a **clone** of the videos, and then **learned by reward**: {reward}, without actions, "
        "states or rewards in them. How much of its return each brought, this run alone does not tell."
    )


def public_command(command: str) -> str:
    """A command without the folders of the machine that it was typed on: of absolute paths their last part is left."""
    try:
        words = shlex.split(command)
    except ValueError:  # a quotation mark without its fellow
        words = command.split()
    shown = [re.sub(r"(^|=)(~|/|[A-Za-z]:\\)\S*[/\\]", r"\1", word.rstrip("/")) for word in words]
    return " ".join(shlex.join(shown).replace("`", "'").split()) or "(not recorded)"


def _tags(run: RunFiles) -> list[str]:
    tags = ["reinforcement-learning", "imitation-learning", "learning-from-videos", "bootifol"]
    return list(dict.fromkeys([*tags, run.method, run.task]))


def _model_index(run: RunFiles, name: str, final: FinalReturn | None) -> list[dict[str, Any]]:
    """The evaluation in the hub's words; JSON is YAML."""
    if final is None:
        return []
    metrics = [_metric("mean_reward", "mean return", final.environment_return)]
    if final.scaled_return is not None:
        metrics.append(_metric("scaled_return", "scaled return", final.scaled_return))
    return [
        {
            "name": name,
            "results": [
                {
                    "task": {"type": "reinforcement-learning", "name": "reinforcement learning"},
                    "dataset": {"type": run.task, "name": run.task},
                    "metrics": metrics,
                }
            ],
        }
    ]


def _metric(kind: str, name: str, summary: Summary) -> dict[str, Any]:
    low, high = summary.interval or (summary.mean, summary.mean)
    value = f"{summary.mean:.3g} (95% interval {low:.3g} to {high:.3g})"
    return {"type": kind, "name": name, "value": value, "verified": False}


def _returns(run: RunFiles, final: FinalReturn) -> str:
    levels = run.return_levels(final.episode_steps)
    rows = [["Return", short_number(final.environment_return.mean), _interval(final.environment_return)]]
    if final.scaled_return is not None:
        scaled = final.scaled_return
        rows.append(["Scaled return", fixed_number(scaled.mean, "scaled"), _interval(scaled, scaled=True)])
    count = final.environment_return.count
    text = markdown_table(("", "Mean", "95% interval"), rows, ("---", "---:", "---:"))
    text += f"\n\nOver {count} episodes of {final.episode_steps} agent steps, after {final.agent_steps:,} of training"
    if final.successes is not None:
        text += f"; {final.successes} of them solved the task"
    text += "."
    if final.scaled_return is not None:
        ends = (
            "" if levels is None else f" (returns of {short_number(levels[0])} and {short_number(levels[1])})"
        )
        text += f" Scaled, 0 is random actions and 1 the expert{ends}."
    return text


def _interval(summary: Summary, scaled: bool = False) -> str:
    if summary.interval is None:
        return "one episode"
    low, high = (fixed_number(end, "scaled") if scaled else short_number(end) for end in summary.interval)
    return f"{low} to {high}"


def _facts(run: RunFiles, policy: PolicyConfig) -> str:
    count = {kind: told.get("count") for kind, told in run.videos.items()}
    videos = ", ".join(f"{number:,} {kind}" for kind, number in count.items() if isinstance(number, int))
    rows = [
        ["Task", _code(run.task)],
        ["Method, preset, seed", f"{_code(run.method)}, {_code(run.preset)}, {run.seed}"],
        ["Videos", _plain(videos) or "unknown"],
        ["Agent steps of training", f"{policy.agent_steps:,}"],
        ["Environment steps that an action is repeated for", str(policy.action_repeat)],
    ]
    if run.seconds is not None:
        rows.append(["Wall-clock time of training", duration(run.seconds)])
    if "bootifol" in run.versions:
        rows.append(["Version of bootifol", _code(run.versions["bootifol"])])
    return markdown_table(("", ""), rows)


def _configuration(run: RunFiles, policy: PolicyConfig) -> dict[str, Any]:
    return {
        "library_name": "bootifol",
        "policy": dataclasses.asdict(policy),
        "method": run.method,
        "preset": run.preset,
        "seed": run.seed,
        "time_budget": run.time_budget,
        "training": run.config,
        "videos": run.videos,
        "versions": run.versions,
    }


def _write_pictures(folder: Path, run: RunFiles) -> dict[str, str]:
    """Draws what there is to draw; what the pictures show, by their names."""
    drawn = {}
    scaled = bool(run.episode_lengths(scaled=True))
    curves = return_curves(looks_of([run]), scaled)
    if curves is not None:
        save_png(curves, folder / "returns.png", DOTS_PER_INCH)
        drawn["returns.png"] = " 0 is random, 1 the expert." if scaled else ""
    videos = videos_of_start(run, run.starts()[0]) if run.starts() else {}
    if videos:
        strips = reward_above_film_strip(videos)
        save_png(strips, folder / "film_strip.png", DOTS_PER_INCH)
        names = [KIND_NAMES[kind] for kind in videos]
        text = " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
        drawn["film_strip.png"] = text[0].upper() + text[1:]
    return drawn


def _plain(text: str) -> str:
    """Text that is neither HTML nor a link, whoever chose its words."""
    return re.sub(r"([\[\]`|])", r"\\\1", html.escape(" ".join(text.split()), quote=False))


def _code(text: str) -> str:
    return "`" + " ".join(text.replace("`", "'").replace("|", "/").split()) + "`"

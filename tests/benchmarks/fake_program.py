"""Stands for `bootifol` in tests of the queue: does at once, or fails to do, what the method's name says.

Every call is written to `calls.txt` in the working directory, as are the core and the threads that it was given; where
modules are looked for, to `path.txt`.
"""

from __future__ import annotations

import itertools
import json
import os
import shutil
import signal
import sys
import time
from pathlib import Path

# Written out, since importing the library would take longer than all else here.
COLUMNS = "agent_steps,seconds,episode_steps,episode,seed,environment_return,scaled_return,success"


def main(words: list[str]) -> int:
    values = dict(itertools.pairwise(words))
    if words[:2] == ["demos", "record"]:
        note(f"record {values['--task']} {values['--episodes']} at {values['--video-size']}")
        if values["--task"] == "hopper_stand":
            print("error: no expert is bundled for hopper_stand", file=sys.stderr)
            return 2
        for behavior in words[words.index("--behaviors") + 1 :]:
            shutil.copytree(os.environ["FAKE_DEMOS"], Path(values["--out"]) / behavior, dirs_exist_ok=True)
        return 0
    resumes = "--resume" in values
    out = Path(values["--resume"] if resumes else values["--out"])
    core = ",".join(map(str, sorted(os.sched_getaffinity(0)))) if hasattr(os, "sched_getaffinity") else ""
    note(
        f"{'resume' if resumes else 'train'} {out.parent.name}/{out.name} {os.environ['OMP_NUM_THREADS']} {core}"
    )
    Path("path.txt").write_text(os.environ["PYTHONPATH"])
    out.mkdir(parents=True, exist_ok=True)
    if not resumes:
        header = {name: values[f"--{name}"] for name in ("task", "method", "preset")}
        write_config(out, header | {"seed": int(values["--seed"])})
    method = json.loads((out / "config.json").read_text())["method"]
    if method == "gaifo":
        print("a line before\nerror: the loss is nan\n", file=sys.stderr)
        return 2
    if method == "context_translation" and not resumes:
        return 130  # somebody asked it alone to stop
    if method == "virl" and not resumes:
        return interrupted_twice() if os.environ.get("FAKE_CTRL_C") == "twice" else interrupted_once(out)
    write_end(out, 12.5)
    return 0


def write_config(out: Path, header: dict[str, object]) -> None:
    """With the configuration in the file FAKE_CONFIG, else with the fewest fields that say how long it is."""
    config = {"interactive": {"agent_steps": 240}, "evaluation": {"final_episodes": 1}}
    if "FAKE_CONFIG" in os.environ:
        config = json.loads(Path(os.environ["FAKE_CONFIG"]).read_text())
    (out / "config.json").write_text(json.dumps(header | {"time_budget": None, "config": config}))


def write_end(out: Path, seconds: float) -> None:
    """What a run that has ended leaves."""
    line = {"phase": "interactive", "agent_steps": 240, "seconds": seconds}
    (out / "metrics.jsonl").write_text(json.dumps(line) + "\n")
    (out / "evaluations.csv").write_text(f"{COLUMNS}\n240,{seconds},60,0,7,50.0,1.0,True\n")
    (out / "report.html").write_text("a report")


def note(line: str) -> None:
    with Path("calls.txt").open("a") as file:
        file.write(f"{line}\n")


def interrupted_once(out: Path) -> int:
    """Ctrl-C reaches the queue; waits for it to ask for an end, and writes a checkpoint."""

    def write_checkpoint(*_: object) -> None:
        (out / "checkpoints").mkdir()

    signal.signal(signal.SIGTERM, write_checkpoint)
    os.kill(os.getppid(), signal.SIGINT)
    while not (out / "checkpoints").exists():
        time.sleep(0.01)
    return 130


def interrupted_twice() -> int:
    """Does not listen, so that Ctrl-C is pressed again once the queue has asked for an end."""
    signal.signal(signal.SIGTERM, lambda *_: os.kill(os.getppid(), signal.SIGINT))
    Path("pid.txt").write_text(str(os.getpid()))
    os.kill(os.getppid(), signal.SIGINT)
    while True:
        time.sleep(0.01)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))

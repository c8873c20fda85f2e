"""A few of the texts that `benchmarks.fuzz_run_files` tries by the thousand."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from benchmarks.fuzz_run_files import attack, files_of, fuzz, opened, small_run

from bootifol.reports.html import report


@pytest.fixture(scope="module")
def run_and_demos(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return small_run(tmp_path_factory.mktemp("fuzzed"))


@pytest.mark.parametrize(
    "name", ["config.json", "metrics.jsonl", "checkpoint.json", "manifest.json", "runs.json"]
)
def test_changed_files_are_read_or_refused_with_a_sentence(
    run_and_demos: tuple[Path, Path], name: str
) -> None:
    counted = fuzz(files_of(*run_and_demos)[name], opened(*run_and_demos), examples=40, seed=1)
    assert counted.total() >= 40


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("metrics.jsonl", '{"phase": [1], "gradient_step": 1}\n{"phase": {}, "agent_steps": 1}\n'),
        ("metrics.jsonl", '{"phase": "alignment", "gradient_step": ' + "9" * 5000 + "}\n" + "[" * 100_000),
        (
            "metrics.jsonl",
            '{"phase": "alignment", "gradient_step": 1, "seconds": 1e308, "loss/total": 1e308}\n',
        ),
        (
            "metrics.jsonl",
            '{"phase": "interactive", "agent_steps": ' + "9" * 40 + ', "a": ' + "9" * 40 + "}\n",
        ),
        ("config.json", "[" * 100_000),
        ("config.json", '{"seed": NaN}'),
    ],
)
def test_what_an_attack_found_stays_mended(run_and_demos: tuple[Path, Path], name: str, text: str) -> None:
    attack(files_of(*run_and_demos)[name], text, opened(*run_and_demos))


def test_a_report_of_wild_metrics_is_written(run_and_demos: tuple[Path, Path], tmp_path: Path) -> None:
    run = Path(shutil.copytree(run_and_demos[0], tmp_path / "run"))
    lines = [
        {"phase": "alignment", "gradient_step": step, "seconds": 1e30 * step, "loss/total": value}
        for step, value in enumerate([1e299, -1e299, 0.0, 1e-320, 5])
    ]
    (run / "metrics.jsonl").write_text("\n".join(map(json.dumps, lines)))
    (run / "evaluations.csv").write_text(
        "agent_steps,seconds,episode_steps,episode,seed,environment_return,scaled_return,success\n"
        + f"{'9' * 5000},0,60,0,1,1e308,nan,True\n{'9' * 17},1e308,60,0,1,inf,,\n"
    )
    assert report([run], tmp_path / "report.html").is_file()

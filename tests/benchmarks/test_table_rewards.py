from __future__ import annotations

import json
from pathlib import Path

import pytest
from benchmarks.table_rewards import main, share_of_the_way

from bootifol.evaluation.tables import RankingRow, append_ranking


def write_run(run: Path, seed: int) -> None:
    """The configuration and the end of a run that is done."""
    run.mkdir()
    header = {"task": "drawn_home", "method": "bootifol", "seed": seed, "time_budget": None}
    config = {"interactive": {"agent_steps": 240}, "evaluation": {"final_episodes": 1}}
    (run / "config.json").write_text(json.dumps(header | {"config": config}))
    (run / "metrics.jsonl").write_text('{"phase": "interactive", "agent_steps": 240, "seconds": 9.0}\n')
    columns = "agent_steps,seconds,episode_steps,episode,seed,environment_return,scaled_return,success"
    (run / "evaluations.csv").write_text(f"{columns}\n240,9.0,60,0,7,50.0,1.0,True\n")


def ranked(agent_steps: int, **rewards: tuple[float, ...]) -> list[RankingRow]:
    return [
        RankingRow(agent_steps, kind, f"{kind}{number}", reward)
        for kind, of_kind in rewards.items()
        for number, reward in enumerate(of_kind)
    ]


def test_the_reward_of_a_kind_is_told_by_its_way_from_random_to_expert() -> None:
    moment = ranked(0, random=(0.0, 2.0), half_good=(2.0,), expert=(5.0,))
    assert share_of_the_way(moment, "half_good") == 0.25
    assert share_of_the_way(moment, "agent") is None, "there is none"
    assert share_of_the_way(ranked(0, random=(5.0,), agent=(2.0,), expert=(1.0,)), "agent") is None


def test_a_row_tells_the_ranking_before_acting_and_at_the_end(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    perfect = ranked(0, random=(0.0, 1.0), half_good=(2.0, 3.0), expert=(4.0, 5.0))
    at_chance = ranked(240, random=(0.0, 3.0), half_good=(1.0, 2.0), expert=(0.5, 6.0), agent=(4.125,))
    for seed, rows in ((1, [*perfect, *at_chance]), (2, at_chance)):
        run = tmp_path / f"seed{seed}"
        write_run(run, seed)
        append_ranking(run / "ranking.csv", rows)
    assert main([str(tmp_path)]) == 0
    row = capsys.readouterr().out.splitlines()[2]
    # 15 pairs, 3 of which are ties of kind: a perfect order has 12 / sqrt(12 * 15).
    assert row.startswith("| Drawn Home | BootIfOL | 1, 2 | 0.89, – |")
    assert row.endswith("| 0.50, 0.50 | 0.50, 0.50 | 1.50, 1.50 | 0.00, 0.00 |")

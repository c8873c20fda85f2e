"""Which videos a run learns from, and which it keeps aside."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from tiny_runs import SEEING, TINY, new_run

from bootifol.demos.export_videos import export_videos
from bootifol.demos.import_videos import Conversion, import_videos
from bootifol.errors import BootifolError
from bootifol.evaluation.tables import read_ranking
from bootifol.rewards.config import RewardConfig
from bootifol.types import OtherCamera, Video


def contents(videos: list[Video]) -> tuple[set[str], set[bytes]]:
    """Names, and pixels or, where they are kept alone, features."""
    shown = [video.frames if video.features is None else video.features for video in videos]
    return {video.name for video in videos}, {each.tobytes() for each in shown}


@pytest.mark.parametrize("with_backbone", [False, True])
def test_held_out_videos_are_none_of_training(
    tmp_path: Path, demos: Path, tiny_backbone: str, with_backbone: bool
) -> None:
    backbone = tiny_backbone if with_backbone else None
    config = replace(TINY, reward=RewardConfig(replace(TINY.reward.bootifol, backbone=backbone)))
    opened = new_run(tmp_path / "run", demos, config=config).parts.demos
    assert {kind: len(videos) for kind, videos in opened.held_out.items()} == {
        "expert": 2,
        "random": 2,
        "half_good": 2,
    }
    for kind, training in (("expert", opened.expert), ("random", opened.random)):
        learned = contents([training[index] for index in range(len(training))])
        aside = contents(opened.held_out[kind])
        assert [len(part) for part in (*learned, *aside)] == [10, 10, 2, 2]
        assert not learned[0] & aside[0] and not learned[1] & aside[1]


def test_episodes_longer_than_the_videos_want_a_reward_of_single_frames(tmp_path: Path, demos: Path) -> None:
    with pytest.raises(BootifolError, match="have 31 frames and an episode of drawn_reach has 46"):
        new_run(tmp_path / "sequences", demos, config=replace(TINY, episode_steps=45))
    run = new_run(tmp_path / "frames", demos, config=replace(SEEING, episode_steps=45))
    assert run.learn()
    assert run.counters.agent_steps == 270, "six episodes: the fewest that hold 240 steps"
    assert run.parts.replay.agent_steps_of(0) == 45
    run.evaluator.rank()
    newest = run.parts.agent_videos.newest(1)[0]
    ranked = read_ranking(tmp_path / "frames" / "ranking.csv").rows[-1]
    assert (ranked.kind, ranked.video) == ("agent", newest.name)
    of_first = run.parts.reward_model.label(newest, ())[:30]
    assert ranked.reward == pytest.approx(of_first.sum(), rel=1e-6), "of as many steps as the videos have"


@pytest.mark.parametrize("both", [False, True])
def test_single_frames_of_files_are_not_held_against_recorded_ones(
    tmp_path: Path, demos: Path, both: bool
) -> None:
    mine = tmp_path / "mine"
    for behavior in ("expert", "random"):
        if behavior == "expert" or both:
            export_videos(demos, tmp_path / behavior, behavior=behavior)
            import_videos([tmp_path / behavior], mine / behavior, Conversion(31, 32), behavior)
        else:
            shutil.copytree(demos / behavior, mine / behavior)
    run = new_run(tmp_path / "run", mine, config=SEEING)
    demos_of_run = run.parts.demos
    assert demos_of_run.imported
    assert isinstance(demos_of_run.random, OtherCamera) is not both
    assert run.learn()
    # Where all videos are from files, nothing says how the agent's pictures differ from them.
    assert (run.counters.reward_updates > 0) is not both
    paper = new_run(tmp_path / "paper", mine).parts.demos
    assert not isinstance(paper.random, OtherCamera), "sequences are compared with looks that vary"

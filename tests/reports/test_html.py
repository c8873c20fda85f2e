import base64
import hashlib
import os
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path

import pytest
from made_up_runs import write_run
from synthetic_run import write_synthetic_run

from bootifol.cli.report import report as report_command
from bootifol.errors import BootifolError
from bootifol.reports.html import report
from bootifol.reports.run_files import flattened


class Page(HTMLParser):
    """Collects what a page would load, its text, and whether its tags are balanced."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.source = path.read_text()
        self.loaded: list[tuple[str, str]] = []
        self.words: list[str] = []
        self.open: list[str] = []
        self.feed(self.source)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.loaded += [
            (tag, value or "") for name, value in attrs if name in ("src", "href", "srcset", "poster")
        ]
        if tag not in ("meta", "img", "link", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())


@pytest.fixture(scope="module")
def page(shared_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Page:
    return Page(report([shared_run], tmp_path_factory.mktemp("out") / "report.html"))


def svgs(page: Page) -> list[str]:
    prefix = "data:image/svg+xml;base64,"
    return [base64.b64decode(url[len(prefix) :]).decode() for _, url in page.loaded if url.startswith(prefix)]


def test_the_page_loads_nothing_from_outside(page: Page) -> None:
    assert page.loaded
    assert all(url.startswith(("data:", "#")) for _, url in page.loaded)
    assert not re.search(r"url\(|@import", page.source)
    assert not page.open
    for svg in svgs(page):
        assert not re.search(r'href="(?!data:|#)', svg)


def test_videos_of_expert_and_agent_are_embedded_whole(page: Page, shared_run: Path) -> None:
    videos = [url for tag, url in page.loaded if tag == "video"]
    assert len(videos) == 6
    for url, name in zip(videos, ("expert-0", "agent-0", "expert-1"), strict=False):
        payload = base64.b64decode(url.removeprefix("data:video/mp4;base64,"))
        assert payload == (shared_run / "videos" / f"{name}.mp4").read_bytes()
    assert page.source.count("autoplay muted loop controls") == 6


def test_the_page_says_what_the_issue_asks_for(page: Page) -> None:
    for expected in (
        "Reacher Hard",
        "Scaled return",
        "95% interval",
        "60,000 actions",
        "2 h 20 min",
        "Kendall's τ",
        "L_S: two views agree",
        "L_triplet",
        "L_ae",
        "L_Z",
        "L_O",
        "Learned reward",
        "bootifol train --task reacher_hard",
        "bootifol report",
        "torch 2.13.0",
        "reward.weights.triplet",
    ):
        assert expected in page.text, expected
    assert page.text.count("Healthy:") >= 12


def test_every_loss_is_drawn_in_both_phases(page: Page) -> None:
    both = [svg for svg in svgs(page) if "Alignment Phase" in svg and "Interactive Phase" in svg]
    assert len(both) == 6


def test_a_name_cannot_inject_markup(bare_run: Path, tmp_path: Path) -> None:
    config = bare_run / "config.json"
    config.write_text(config.read_text().replace("demos/reacher_hard", "<script>alert(1)</script>"))
    assert "<script>alert" not in report([bare_run], tmp_path / "report.html").read_text()


def test_several_runs_are_compared(shared_run: Path, tmp_path: Path) -> None:
    other = write_synthetic_run(tmp_path / "upper-1", method="environment", final=1.0)
    page = Page(report([shared_run, other], tmp_path / "both.html"))
    assert "2 runs side by side" in page.text
    compared = [svg for svg in svgs(page) if "bootifol, seed 1" in svg and "environment, seed 1" in svg]
    assert len(compared) == 10  # four curves and six losses
    assert [url for tag, url in page.loaded if tag == "a"] == ["#run-0", "#run-1"]
    assert "Before you compare" in page.text and "older than the record of the library's code" in page.text


def test_what_keeps_runs_from_being_compared_is_said(tmp_path: Path) -> None:
    """The sentences that stand below a table."""
    write_run(tmp_path / "bootifol" / "seed1", time_budget=60.0)
    write_run(tmp_path / "virl" / "seed1", method="virl", time_budget=600.0)
    page = Page(report([tmp_path], tmp_path / "report.html"))
    assert "Budgets on Reacher Hard are unequal (BootIfOL: 1 min 00 s; ViRL: 10 min 00 s)" in page.text
    unfinished = "it has trained for 1 min 00 s of 10 min 00 s"
    assert f"(ViRL on Reacher Hard) is unfinished and counts as far as it has come: {unfinished}" in page.text
    # Both directories are called seed1.
    assert "bootifol/seed1" in page.text and "virl/seed1" in page.text


def test_returns_of_different_tasks_are_drawn_together_only_where_they_are_scaled(tmp_path: Path) -> None:
    curve = {500: [10.0, 20.0], 1000: [30.0, 40.0]}
    first = write_run(tmp_path / "first", curve=curve)
    second = write_run(tmp_path / "second", task="hopper_stand", agent_steps=600, curve=curve)
    page = Page(report([first, second], tmp_path / "report.html"))
    together = [svg for svg in svgs(page) if "first" in svg and "second" in svg]
    assert [("scaled return" in svg, "-step episodes" in svg) for svg in together] == [(True, False)] * 2
    assert (
        "Only scaled returns are drawn together, for these runs share no other measure (Reacher Hard in 60 and 500 "
        "agent steps; Hopper Stand in 60 and 500 agent steps)." in page.text
    )
    assert "second (BootIfOL on Hopper Stand) is unfinished" in page.text
    assert "hopper_stand" in page.text.split("The runs compared")[0]


def test_returns_of_one_task_have_the_levels_of_its_expert(tmp_path: Path) -> None:
    runs = [write_run(tmp_path / name, seed=seed) for seed, name in enumerate(("first", "second"))]
    page = Page(report(runs, tmp_path / "report.html"))
    raw = [svg for svg in svgs(page) if "bootifol, seed 1" in svg and "return of 500-step episodes" in svg]
    assert len(raw) == 1
    assert "expert" in raw[0] and "random" in raw[0]
    assert "Only scaled returns" not in page.text


def test_a_run_is_reported_once(tmp_path: Path) -> None:
    run = write_run(tmp_path / "runs" / "one")
    page = Page(report([run, tmp_path / "runs", run], tmp_path / "report.html"))
    assert "side by side" not in page.text
    assert page.text.count("How to get it again") == 1


def test_a_run_with_nothing_but_its_configuration_has_a_report(bare_run: Path, tmp_path: Path) -> None:
    page = Page(report([bare_run], tmp_path / "report.html"))
    assert "Not in this report" in page.text
    assert "metrics.jsonl is missing" in page.text


def test_damage_is_told_and_the_rest_is_shown(run_dir: Path, tmp_path: Path) -> None:
    (run_dir / "ranking.csv").unlink()
    (run_dir / "showcase.safetensors").write_bytes(b"\x00" * 20)
    (run_dir / "videos" / "agent-0.mp4").write_bytes(b"")
    page = Page(report([run_dir], tmp_path / "report.html"))
    for note in (
        "ranking.csv is missing",
        "showcase.safetensors was left out",
        "videos/agent-0.mp4 is empty",
    ):
        assert note in page.text
    assert "Learning curves" in page.text
    assert len([tag for tag, _ in page.loaded if tag == "video"]) == 5


def test_no_run_is_a_sentence_and_leaves_the_old_report(tmp_path: Path) -> None:
    out = tmp_path / "report.html"
    out.write_text("old")
    with pytest.raises(BootifolError, match="name the directory"):
        report([], out)
    with pytest.raises(BootifolError, match="there is no directory"):
        report([tmp_path / "nowhere"], out)
    assert out.read_text() == "old"


def test_the_command_writes_into_the_run_and_says_where(
    bare_run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert report_command([bare_run]) == 0
    assert (bare_run / "report.html").exists()
    assert str(bare_run / "report.html") in capsys.readouterr().out


def test_nested_configurations_are_flattened() -> None:
    assert list(flattened({"a": {"b": 1, "c": {"d": None}}, "e": [1, 2]})) == [
        ("a.b", "1"),
        ("a.c.d", "None"),
        ("e", "[1, 2]"),
    ]


def test_what_a_link_leads_to_outside_of_the_run_is_not_shown(run_dir: Path, tmp_path: Path) -> None:
    secret = tmp_path / "secret.mp4"
    secret.write_bytes(b"a secret of this machine's")
    for name, target in (("agent-0", secret), ("agent-1", Path("agent-1.mp4")), ("agent-2", Path("nowhere"))):
        (run_dir / "videos" / f"{name}.mp4").unlink()
        (run_dir / "videos" / f"{name}.mp4").symlink_to(target)
    (run_dir / "videos" / "expert-0.mp4").unlink()
    os.mkfifo(run_dir / "videos" / "expert-0.mp4")
    shutil.move(run_dir / "showcase.safetensors", tmp_path / "showcase.safetensors")
    (run_dir / "showcase.safetensors").symlink_to(tmp_path / "showcase.safetensors")
    page = Page(report([run_dir], tmp_path / "report.html"))
    assert base64.b64encode(secret.read_bytes()).decode() not in page.source
    assert page.text.count("it is a link that leaves the run") == 4
    assert "videos/expert-0.mp4 was left out" in page.text
    assert len([tag for tag, _ in page.loaded if tag == "video"]) == 2


def test_the_page_runs_its_own_script_alone_and_asks_for_nothing(page: Page) -> None:
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page.source)
    assert policy is not None and "default-src 'none'" in policy[1]
    (script,) = re.findall(r"<script>(.*?)</script>", page.source, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in policy[1]

"""How benchmarks end, and that all of them end so."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from benchmarks.command import command

from bootifol.errors import BootifolError

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
PROGRAMS = [path for path in sorted(BENCHMARKS.glob("*.py")) if "__main__" in path.read_text()]


@pytest.mark.parametrize(("returned", "code"), [(None, 0), (0, 0), (1, 1)])
def test_a_benchmark_that_ends_has_its_own_code(returned: int | None, code: int) -> None:
    @command()
    def main() -> int | None:
        return returned

    assert main() == code


def test_bad_input_is_one_sentence_and_code_2(capsys: pytest.CaptureFixture[str]) -> None:
    @command()
    def main(words: list[str]) -> None:
        raise BootifolError(f"there is no task '{words[0]}': choose another")

    assert main(["reacher_harder"]) == 2
    assert capsys.readouterr() == ("", "error: there is no task 'reacher_harder': choose another\n")


@pytest.mark.parametrize(
    ("resumes", "sentence"),
    [(True, "stopped; the same command goes on with what is done already\n"), (False, "stopped\n")],
)
def test_ctrl_c_is_code_130(capsys: pytest.CaptureFixture[str], resumes: bool, sentence: str) -> None:
    @command(resumes=resumes)
    def main() -> None:
        raise KeyboardInterrupt

    assert main() == 130
    assert capsys.readouterr().err == sentence


def test_a_mistake_of_ours_keeps_its_traceback() -> None:
    @command()
    def main() -> None:
        raise ValueError("a bug")

    with pytest.raises(ValueError, match="a bug"):
        main()


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_every_benchmark_ends_so(path: Path) -> None:
    module = ast.parse(path.read_text())
    (main,) = [each for each in module.body if isinstance(each, ast.FunctionDef) and each.name == "main"]
    assert [ast.unparse(each).partition("(")[0] for each in main.decorator_list] == ["command"]
    assert ast.unparse(module.body[-1]) == "if __name__ == '__main__':\n    raise SystemExit(main())"
    assert "sys.exit" not in path.read_text()

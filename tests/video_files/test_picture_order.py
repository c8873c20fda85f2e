import random
import warnings
from pathlib import Path

import pytest

from bootifol.errors import BootifolWarning
from bootifol.video_files.picture_order import in_order


def ordered(names: list[str]) -> tuple[list[str], list[str]]:
    """Names after shuffling and ordering, and what was said."""
    shuffled = [Path("take") / name for name in names]
    random.Random(0).shuffle(shuffled)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        return [path.name for path in in_order(shuffled)], [str(found.message) for found in caught]


@pytest.mark.parametrize(
    "names",
    [
        ["frame1.png", "frame2.png", "frame10.png"],
        ["frame 1.png", "frame 02.png", "frame 3.png"],
        ["Frame1.png", "frame2.png"],
        ["frame٣.png", "frame٤.png", "frame١٠.png"],
        ["1²3.png", "1²4.png", "1²10.png"],
        ["2024.01.2.png", "2024.01.10.png"],
        ["-2.png", "-1.png", "0.png", "1.png"],
        [f"{1700000000123456789 + t}.png" for t in range(5)],
        [f"a{1700000000123456789 + t}.png" for t in range(5)],
        [f"{1700000000 + t / 30:.3f}.png" for t in range(40)],
        ["a1_2.png", "a1_10.png", "a2_1.png"],
    ],
)
def test_names_without_doubt_are_taken_in_natural_order(names: list[str]) -> None:
    right, said = ordered(names)
    assert right == names
    assert said == [] or names[0] == "-2.png"


@pytest.mark.parametrize(
    "names",
    [
        ["1700000000.05.png", "1700000000.175.png", "1700000000.3.png", "1700000001.05.png"],
        [f"{t / 25:g}.jpg" for t in range(60)],
        [f"{t / 60}.png" for t in range(90)],
        ["1e-05.png", "0.033.png", "0.0667.png", "0.1.png"],
        ["12,25.png", "12,5.png", "13.png"],
        ["left_12.25_a.png", "left_12.5_a.png"],
    ],
)
def test_times_with_dropped_zeros_are_decimal_numbers(names: list[str]) -> None:
    right, said = ordered(names)
    assert right == names
    assert len(said) == 1 and "decimal numbers" in said[0] and names[0] in said[0]


@pytest.mark.parametrize(
    "names",
    [
        ["1.9.png", "1.10.png", "1.11.png"],
        [f"v{a}.{b}.png" for a in (1, 2) for b in range(1, 13)],
        [f"f1700000000.{50_000_000 * t}.png" for t in range(19)],
    ],
)
def test_counters_with_a_point_are_two_numbers(names: list[str]) -> None:
    right, said = ordered(names)
    assert right == names
    assert len(said) == 1 and "two counters" in said[0]


def test_doubts_are_told() -> None:
    assert "by the alphabet" in ordered(["a.png", "b.png"])[1][0]
    assert "are they there twice" in ordered(["1.jpg", "1.png", "2.jpg", "2.png"])[1][0]
    with pytest.warns(BootifolWarning, match="take: its pictures were taken in the order 1.25.png, 1.5.png"):
        in_order([Path("take/1.5.png"), Path("take/1.25.png")])

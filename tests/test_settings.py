"""Bounds in annotations: what they let pass, and the sentence for what they do not."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Literal

import pytest

from bootifol.errors import BootifolError
from bootifol.settings import (
    AtLeastTwo,
    BelowOne,
    Count,
    CountOrZero,
    Flag,
    Fraction,
    Number,
    Positive,
    as_settings,
    settings,
)


@dataclass(frozen=True)
@settings("engine.wheel")
class Wheel:
    spokes: AtLeastTwo = 8
    slip: BelowOne = 0.0


@dataclass(frozen=True)
@settings("engine")
class Engine:
    cylinders: Count = 4
    faults: CountOrZero = 0
    load: Fraction = 0.5
    weight: Number = 1.0
    rate: Positive = 0.1
    running: Flag = False
    fuel: Literal["gas", "coal", "wood"] = "gas"
    limit: Count | None = None
    wheel: Wheel = field(default_factory=Wheel)

    def __post_init__(self) -> None:
        if self.cylinders < self.faults:
            raise BootifolError(f"engine has {self.cylinders} cylinders and {self.faults} faults")


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("cylinders", 0, "engine.cylinders must be at least 1, not 0"),
        ("cylinders", 10**10, "engine.cylinders must be at most 1,000,000,000, not 10000000000"),
        ("cylinders", 1.5, "engine.cylinders must be a whole number, not 1.5"),
        ("cylinders", True, "engine.cylinders must be a whole number, not True"),
        ("cylinders", "4", "engine.cylinders must be a whole number, not '4'"),
        ("cylinders", None, "engine.cylinders must be a whole number, not None"),
        ("faults", -1, "engine.faults must be at least 0, not -1"),
        ("load", 1.01, "engine.load must be at most 1, not 1.01"),
        ("load", True, "engine.load must be a number, not True"),
        ("weight", float("nan"), "engine.weight must be a finite number, not nan"),
        ("weight", float("inf"), "engine.weight must be a finite number, not inf"),
        ("rate", 0.0, "engine.rate must be above 0, not 0.0"),
        ("rate", 1e10, "engine.rate must be at most 1,000,000,000, not 10000000000.0"),
        ("running", 1, "engine.running must be true or false, not 1"),
        ("fuel", "oil", "engine.fuel must be gas, coal or wood, not 'oil'"),
        ("limit", 0, "engine.limit must be at least 1, not 0"),
        ("wheel", 3, "engine.wheel must be a section, with fields of its own, not 3"),
        ("faults", 5, "engine has 4 cylinders and 5 faults"),
    ],
)
def test_what_a_field_cannot_have_is_a_sentence(name: str, value: Any, sentence: str) -> None:
    for make in (lambda: Engine(**{name: value}), lambda: replace(Engine(), **{name: value})):
        with pytest.raises(BootifolError) as raised:
            make()
        assert str(raised.value) == sentence
    with pytest.raises(BootifolError) as raised:
        as_settings(Engine, {name: value})
    assert str(raised.value) == sentence.replace("engine.", "")


def test_what_a_field_can_have_is_kept_and_whole_numbers_become_fractions() -> None:
    made = Engine(cylinders=2, load=1, weight=0, limit=3, wheel=Wheel(slip=0))
    assert made == as_settings(
        Engine, {"cylinders": 2, "load": 1, "weight": 0, "limit": 3, "wheel": {"slip": 0}}
    )
    assert [type(value) for value in (made.load, made.weight, made.wheel.slip)] == [float] * 3
    assert replace(made, limit=None).limit is None


def test_fields_of_sections_are_named_dotted() -> None:
    with pytest.raises(BootifolError, match=r"^wheel\.spokes must be at least 2, not 1$"):
        as_settings(Engine, {"wheel": {"spokes": 1}})
    with pytest.raises(BootifolError, match=r"^engine\.wheel\.spokes must be at least 2, not 1$"):
        Wheel(1)
    with pytest.raises(BootifolError, match=r"^wheel\.slip must be below 1, not 1\.0$"):
        as_settings(Engine, {"wheel": {"slip": 1.0}})


def test_unknown_and_missing_fields_are_named() -> None:
    @dataclass(frozen=True)
    class Plain:
        name: str

    with pytest.raises(BootifolError, match=r"^there is no field 'wheel\.tyre'$"):
        as_settings(Engine, {"wheel": {"tyre": 1}})
    with pytest.raises(BootifolError, match=r"^name is missing$"):
        as_settings(Plain, {})
    with pytest.raises(BootifolError, match=r"^name must be a text, not 3$"):
        as_settings(Plain, {"name": 3})

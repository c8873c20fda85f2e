"""What environments of other people answer, brought to the form of today's Gymnasium.

Older ones, and ones made from vector environments, answer a little differently. What can only mean one thing is taken
so; the rest gets a sentence.
"""

from __future__ import annotations

import inspect
import random
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any

import gymnasium
import numpy as np

from bootifol.errors import BootifolError
from bootifol.plugins import told, where

Environment = gymnasium.Env[Any, Any]


class TodaysAnswers(gymnasium.Wrapper[Any, Any, Any, Any]):
    """The innermost wrapper: `reset` takes a seed, and answers are those of Gymnasium 1.

    Args:
        environment: without any wrapper.
    """

    def __init__(self, environment: Environment) -> None:
        super().__init__(environment)
        parameters = inspect.signature(environment.reset).parameters
        self._takes_all = any(kind.kind is kind.VAR_KEYWORD for kind in parameters.values())
        self._takes = set(parameters)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Starts an episode; an environment whose `reset` takes no seed is given it as it wishes, if it does."""
        given: dict[str, Any] = {"seed": seed, "options": options}
        words = {name: value for name, value in given.items() if self._takes_all or name in self._takes}
        seed_it = getattr(self.env, "seed", None)
        if "seed" not in words and seed is not None and callable(seed_it):
            seed_it(seed)
        answer = self.env.reset(**words)
        if isinstance(answer, tuple) and len(answer) == 2 and isinstance(answer[1], Mapping | None):
            return answer[0], dict(answer[1] or {})
        return answer, {}

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """One step; of the older answer of four, `done` is an end unless it says that time was up."""
        answer = self.env.step(action)
        if len(answer) == 4:
            observation, reward, done, info = answer
            known = info if isinstance(info, Mapping) else {}
            time_up = bool(known.get("TimeLimit.truncated", False))
            return observation, reward, bool(done) and not time_up, time_up, dict(known)
        if len(answer) != 5:
            raise BootifolError(
                f"step() returns {len(answer)} values where Gymnasium has 5: observation, reward, terminated, "
                "truncated, info"
            )
        observation, reward, terminated, truncated, info = answer
        return observation, reward, terminated, truncated, info if isinstance(info, Mapping) else {}


def with_todays_answers(environment: Environment) -> Environment:
    """The environment with `TodaysAnswers` below its other wrappers."""
    if not isinstance(environment, gymnasium.Wrapper):
        return TodaysAnswers(environment)
    wrapper = environment
    while isinstance(wrapper.env, gymnasium.Wrapper):
        wrapper = wrapper.env
    wrapper.env = TodaysAnswers(wrapper.env)
    return environment


@contextmanager
def seeded(environment: Environment, seed: int) -> Iterator[None]:
    """Within the block everything that environments commonly draw from follows from `seed`.

    Some draw before they seed, or from numpy's and Python's own generators, which are put back afterwards.
    """
    with suppress(AttributeError, TypeError):  # some keep theirs to themselves
        environment.unwrapped.np_random = np.random.default_rng(seed)
    numpys, pythons = np.random.get_state(), random.getstate()
    np.random.seed(seed % 2**32)
    random.seed(seed)
    try:
        yield
    finally:
        np.random.set_state(numpys)
        random.setstate(pythons)


@contextmanager
def told_as_a_sentence(name: str, doing: str) -> Iterator[None]:
    """Turns whatever an environment raises into one sentence.

    Raises:
        BootifolError: names the environment, and the file and line the exception comes from.
    """
    try:
        yield
    except BootifolError as error:
        raise BootifolError(f"{name}: {error}") from error
    except Exception as error:  # an environment may do anything
        raise BootifolError(f"{name} failed in {doing}: {told(error)}{where(error)}") from error


def one_number(name: str, what: str, value: Any) -> float:
    """A number, be it of an array of one.

    Raises:
        BootifolError: it is none, or there are several.
    """
    try:
        # None would become NaN.
        numbers = np.asarray([] if value is None else value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise BootifolError(f"{name}: {what} is {type(value).__name__} where a number is wanted") from error
    if numbers.size != 1:
        found = "is None" if value is None else f"has shape {list(numbers.shape)}"
        raise BootifolError(
            f"{name}: {what} {found} where one number is wanted: is it several environments in "
            "one? Make a single one"
        )
    return float(numbers.reshape(()))


def success_of(name: str, info: Mapping[str, Any]) -> bool | None:
    """Whether a step succeeded; None where the environment does not say.

    Raises:
        BootifolError: it says something else than yes or no.
    """
    for key in ("is_success", "success"):
        if info.get(key) is not None:
            return bool(one_number(name, f'info["{key}"]', info[key]))
    return None

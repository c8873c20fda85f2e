"""What the sight command shows of what a reward confuses."""

from __future__ import annotations

import numpy as np
from benchmarks.sight import confused

from bootifol.evaluation.sight import Performance, sight


def performance(who: str, true: float, learned: float) -> Performance:
    return Performance(who, np.full(4, true / 4, np.float32), np.full(4, learned / 4, np.float32))


def test_the_failures_that_are_rewarded_most_stand_below_the_median_expert() -> None:
    played = [
        *(performance("expert", 10, learned) for learned in (7, 8, 9)),
        *(performance("late", true, learned) for true, learned in ((1, 6), (9, 9), (1, 8.5))),
        *(performance("still", 0, learned) for learned in (1, 2, 3)),
    ]
    # The late episode of true return 9 did not fail, however it is rewarded.
    assert confused(played, sight(played)) == [1, 5, 8]

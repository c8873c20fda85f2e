"""Checks every byte of large demo sets beside the learning from them, so that nobody waits for it."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from bootifol.demos.demo_set import DemoSet
from bootifol.errors import BootifolError


class Verification:
    """Compares the checksums of demo sets in a thread of its own, which ends with the process.

    Args:
        demo_sets: that were opened and not verified; there may be none.
    """

    def __init__(self, demo_sets: Sequence[DemoSet] = ()) -> None:
        self._error: BootifolError | None = None
        self._thread = threading.Thread(target=self._verify, args=(list(demo_sets),), daemon=True)
        self._thread.start()

    def check(self) -> None:
        """Costs nothing; for a loop that learns from the videos.

        Raises:
            BootifolError: damage was found by now.
        """
        if self._error is not None:
            raise self._error

    def wait(self) -> None:
        """Returns when every byte was read.

        Raises:
            BootifolError: damage was found.
        """
        self._thread.join()
        self.check()

    def _verify(self, demo_sets: Sequence[DemoSet]) -> None:
        try:
            for demo_set in demo_sets:
                for _ in demo_set.verified_shards():
                    pass
        except BootifolError as error:
            self._error = error
        except OSError as error:
            self._error = BootifolError(f"the videos cannot be read any more: {error}; restore them")

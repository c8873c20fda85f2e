"""Ctrl-C, SIGTERM and a closed terminal (SIGHUP) ask a run to stop where it can be resumed; a second Ctrl-C stops it
at once."""

from __future__ import annotations

import signal
import threading
from contextlib import suppress
from types import FrameType, TracebackType

_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")


class Stopped(Exception):  # noqa: N818
    """A run that was asked to stop leaves off what it measures; nothing that learns raises it."""


class Interruption:
    """While entered, signals set `requested` instead of ending the process."""

    def __init__(self) -> None:
        self.requested = False
        self._previous: dict[int, object] = {}

    def stop_if_requested(self) -> None:
        """For the middle of what can be left off and done again.

        Raises:
            Stopped: it was requested.
        """
        if self.requested:
            raise Stopped

    def __enter__(self) -> Interruption:
        if threading.current_thread() is threading.main_thread():
            for number in (getattr(signal, name) for name in _SIGNALS if hasattr(signal, name)):
                if (
                    number not in (signal.SIGINT, signal.SIGTERM)
                    and signal.getsignal(number) == signal.SIG_IGN
                ):
                    continue  # started with nohup, to outlive its terminal
                self._previous[number] = signal.signal(number, self._handle)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)  # type: ignore[arg-type]
        self._previous.clear()

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self.requested and number == signal.SIGINT:
            raise KeyboardInterrupt
        self.requested = True
        with suppress(OSError, ValueError, RuntimeError):  # nobody may be there to read it
            print(
                "\nstopping after this step and writing a checkpoint; Ctrl-C again stops at once", flush=True
            )

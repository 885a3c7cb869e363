"""SIGINT and SIGTERM as an exception, so that outputs are closed."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Final, NoReturn

from roadeval.cli.exit_codes import ExitCode

EXIT_CODES: Final = {signal.SIGINT: ExitCode.INTERRUPTED, signal.SIGTERM: ExitCode.TERMINATED}
GRACE_S: Final = 0.05
"""Seconds in which further signals count as the first one: ``timeout`` sends one to the process and
another to its group."""


class Stopped(BaseException):
    """A request of the user or the system to stop; code from outside may raise `SystemExit`."""

    def __init__(self, exit_code: ExitCode) -> None:
        super().__init__(int(exit_code))
        self.exit_code = exit_code


@contextmanager
def as_exceptions() -> Iterator[None]:
    """Turn the first SIGINT or SIGTERM into `Stopped`; a later one ends the process at once.

    Python accepts handlers from the main thread only; in any other thread nothing changes.
    """

    def stop(number: int, _frame: FrameType | None) -> NoReturn:
        for stopping in EXIT_CODES:
            signal.signal(stopping, signal.SIG_IGN)
        time.sleep(GRACE_S)
        for stopping in EXIT_CODES:
            signal.signal(stopping, signal.SIG_DFL)
        raise Stopped(EXIT_CODES[signal.Signals(number)])

    earlier = {}
    # `signal.signal` raises a ValueError outside the main thread.
    with suppress(ValueError):
        for number in EXIT_CODES:
            earlier[number] = signal.signal(number, stop)
    try:
        yield
    finally:
        for number, handler in earlier.items():
            signal.signal(number, handler)

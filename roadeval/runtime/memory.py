"""Returning freed memory to the system, where the C library would keep it."""

from __future__ import annotations

import sys
from contextlib import suppress
from typing import Final

OFTEN: Final = 256
"""Frames between two calls of `give_back`: a call takes ten milliseconds, in which no other thread
can allocate memory."""


def give_back() -> None:
    """Return free memory to the system: between the phases of a run, and every `OFTEN` frames.

    Each phase allocates blocks of other sizes: those of training, kept for a replay that cannot use
    them, made up an eighth of a run's peak. Fragments between the blocks that stay in use grow for
    hours: by 100 MiB in 16,000 frames of 1280x720.

    Only glibc, the C library of most Linux systems, keeps so much. Elsewhere this does nothing.
    """
    if sys.platform == "linux":
        # Python may be built without ctypes, and another C library has no such function.
        with suppress(ImportError, OSError, AttributeError):
            import ctypes

            ctypes.CDLL(None).malloc_trim(0)

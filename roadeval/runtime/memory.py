"""Memory that was freed goes back to the system, where the C library would keep it."""

from __future__ import annotations

import ctypes
import sys
from typing import Final

OFTEN: Final = 256
"""Frames after which it is worth the ten milliseconds, in which nobody else gets memory."""


def give_back() -> None:
    """Return what is free to the system: between the phases of a run, and every `OFTEN` frames.

    Each phase uses memory in pieces of other sizes: training's, kept for a replay that cannot use
    it, made up an eighth of a run's peak. And what frames leave between the pieces that stay grows
    for hours: by 100 MiB in 16,000 frames of 1280x720. Only glibc, the C library of most Linux
    systems, has to be asked.
    """
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)

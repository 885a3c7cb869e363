"""Memory: freed memory returned to the system, and a message if there is not enough."""

from __future__ import annotations

import ctypes
import mmap
import re
import sys
from pathlib import Path
from typing import Final

from roadeval.runtime.sentence import Sentence

NOT_ENOUGH: Final = Sentence(
    "not enough memory: take fewer {run.jobs}, a smaller {frames.scale}, or a larger machine"
)
_LACKING: Final = re.compile(
    "(allocat|map segment|new thread|create thread|Insufficient memory|out of memory|bad_alloc)",
    re.IGNORECASE,
)
"""Words of libraries' errors about memory."""
LARGEST: Final = 32 << 20
"""Bytes of the largest arrays that `reuse` keeps in memory."""
M_TRIM_THRESHOLD: Final = -1
M_MMAP_THRESHOLD: Final = -3
"""Numbers of the parameters that `reuse` sets, from glibc's ``malloc.h``."""
TRIM_EVERY: Final = 256
"""Items of a long loop between two calls of `trim`, which takes ten milliseconds."""


def trim() -> None:
    """Return freed memory to the system: between the phases of a run, and every `TRIM_EVERY` items.

    Training frees an eighth of a run's peak. Without this call the gaps between live arrays grow
    for hours: by 100 MiB in 16,000 images of 1280x720. Only glibc needs it.
    """
    if sys.platform == "linux":
        malloc_trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if malloc_trim is not None:
            malloc_trim(0)


def reuse() -> None:
    """Keep the memory of a frame's freed arrays, up to `LARGEST` bytes each, for the next frame.

    By default glibc returns it at once, and the system clears each page before it gives it out
    again, which takes a tenth of a replay's CPU time. `trim` returns the kept memory.
    """
    if sys.platform == "linux" and (mallopt := getattr(ctypes.CDLL(None), "mallopt", None)):
        for parameter in (M_TRIM_THRESHOLD, M_MMAP_THRESHOLD):
            mallopt(parameter, LARGEST)


def resident() -> int:
    """Return the bytes of memory that the process holds; 0 if the system does not say."""
    if sys.platform != "linux":
        return 0
    return int(Path("/proc/self/statm").read_text().split()[1]) * mmap.PAGESIZE


def is_lacking(error: BaseException) -> bool:
    """Return whether an error, of Python or of a library, means that there is not enough memory.

    >>> is_lacking(RuntimeError("can't start new thread"))
    True
    """
    may_tell = isinstance(error, ImportError | RuntimeError) or type(error).__module__ == "cv2"
    return isinstance(error, MemoryError) or (may_tell and bool(_LACKING.search(str(error))))

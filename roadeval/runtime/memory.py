"""Memory: what was freed returned to the system, and what to say where there is not enough."""

from __future__ import annotations

import ctypes
import gc
import re
import sys
from contextlib import suppress
from pathlib import Path
from typing import Final

LACKING: Final = (
    "not enough memory: give it more, or let it take less, by fewer `run.jobs` or a smaller "
    "`frames.scale`"
)
_LACKING: Final = re.compile(
    "(allocat|map segment|new thread|create thread|Insufficient memory|out of memory|bad_alloc)",
    re.IGNORECASE,
)
COLLECT_EVERY: Final = 400_000
"""Objects that are new between two searches for cycles; Python's own choice is 700. A run of 100
frames with the default preset makes fewer, nearly all of which stay; of a long one 10 to 50 a frame
stay."""
TRIM_EVERY: Final = 256
"""Items of a long loop between two trims: one takes ten milliseconds, in which no other thread gets
memory."""


def collect_rarely() -> None:
    """Let Python search for cycles rarely: for a process that imports much and ends soon.

    The imports of a run make some 300,000 objects, nearly all of which stay. To search them again
    and again, and once more at the end, takes a sixth of a short run, and searching every 50,000
    objects still a twentieth.
    """
    gc.set_threshold(COLLECT_EVERY)


def collect_no_more() -> None:
    """Let Python leave out the search for cycles at its end, when the system frees all at once."""
    gc.freeze()


def trim() -> None:
    """Return freed memory to the system: between the phases of a run, and every `TRIM_EVERY` items.

    Each phase allocates pieces of other sizes: training's, kept for a replay that cannot use them,
    made up an eighth of a run's peak. And what is freed between pieces that stay grows for hours:
    by 100 MiB in 16,000 images of 1280x720. Only glibc, the C library of most Linux systems, has to
    be asked.
    """
    if sys.platform == "linux":
        malloc_trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if malloc_trim is not None:
            malloc_trim(0)


def is_lacking(error: BaseException) -> bool:
    """Return whether an error, of Python or of a library, says that there is not enough memory.

    >>> is_lacking(RuntimeError("can't start new thread"))
    True
    """
    said = isinstance(error, ImportError | RuntimeError) or type(error).__module__ == "cv2"
    return isinstance(error, MemoryError) or (said and bool(_LACKING.search(str(error))))


def forget_peak() -> None:
    """Let `peak_mib` count anew, where the system can; Linux can."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def peak_mib() -> float | None:
    """Return the most memory that the process has held since `forget_peak`, in MiB.

    None where the system does not tell. Where it cannot forget, it is since the process began.
    """
    try:
        status = Path("/proc/self/status").read_text()
    except OSError:
        return None
    found = re.search(r"VmHWM:\s*(\d+) kB", status)
    return int(found[1]) / 1024 if found else None

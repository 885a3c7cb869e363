"""A harness: what is tried on bytes, and what counts as a finding."""

from __future__ import annotations

import atexit
import os
import re
import shutil
import stat
import sys
import tempfile
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from time import monotonic
from typing import Final

NAMES: Final = ("logs", "damage", "images", "results", "models", "networks", "configurations")
"""The harnesses, each a module in `tests.fuzz.harnesses`."""

SLOW: Final = 10.0
"""Seconds that a case may take."""
BIG: Final = 1_500_000_000
"""Bytes of memory that a case may take."""

PROC: Final = Path("/proc/self")


@dataclass(frozen=True)
class Harness:
    """Something to try."""

    check: Callable[[bytes], None]
    """Try it on bytes: return, or raise a `RoadevalError`. Any other exception is a finding."""
    seeds: Callable[[], Sequence[bytes]]
    """Return the corpus: what cases are made from."""
    random: bool = False
    """Whether `check` chooses what to do by a case's random bytes; else cases are changed seeds."""
    quick: int = 200
    """Cases that the test command tries, about a second's worth."""


class Lost(AssertionError):  # noqa: N818  (what became of a frame)
    """A frame that is missing, and nothing told of it."""


class Wrong(AssertionError):  # noqa: N818
    """A frame that is another than was logged, and nothing told of it."""


@dataclass(frozen=True)
class Outcome:
    """What became of a case: what is wrong, or empty, and where; seconds, and bytes of memory."""

    kind: str
    where: str
    seconds: float
    memory: int


def harness_of(name: str) -> Harness:
    """Return a harness by its name."""
    harness: Harness = import_module(f"tests.fuzz.harnesses.{name}").HARNESS
    return harness


def run_case(harness: Harness, data: bytes) -> Outcome:
    """Try one case."""
    from roadeval.errors import RoadevalError

    before, said = _memory(forget=True), _said()
    begin = monotonic()
    kind, where = "", ""
    try:
        harness.check(data)
    except RoadevalError:
        pass
    except KeyboardInterrupt:
        raise
    except (Lost, Wrong) as error:
        kind, where = type(error).__name__.lower(), str(error)
    except BaseException as error:
        kind, where = "uncaught", _place(error)
    seconds, memory = monotonic() - begin, _memory() - before
    if not kind and seconds > SLOW:
        kind, where = "slow", f"{seconds:.0f} s"
    if not kind and memory > BIG:
        kind, where = "big", f"{memory / 1e9:.1f} GB"
    if not kind and _said() > said:
        kind, where = "printed", _text(said)
    return Outcome(kind, where, seconds, memory)


@cache
def scratch() -> Path:
    """Return a folder of this process for the files of its cases, in memory where there is one."""
    memory = Path("/dev/shm")
    folder = tempfile.mkdtemp("", "roadeval-fuzz-", memory if memory.is_dir() else None)
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


def _memory(*, forget: bool = False) -> int:
    """Return the greatest resident memory since it was last forgotten, in bytes; 0 if unknown."""
    try:
        if forget:
            (PROC / "clear_refs").write_text("5")
        return int(re.search(r"VmHWM:\s*(\d+) kB", (PROC / "status").read_text())[1]) * 1024
    except (OSError, TypeError):
        return 0


def _said() -> int:
    """Return how many bytes standard error holds, which a C library may have written.

    0 where it is not a file: in a worker and in the tests it is one.
    """
    status = os.fstat(2)
    return status.st_size if stat.S_ISREG(status.st_mode) else 0


def _text(begin: int) -> str:
    """Return the begin of what was written to standard error after so many bytes."""
    sys.stderr.flush()
    written = (PROC / "fd/2").read_bytes()[begin:] if PROC.exists() else b""
    return " ".join(written.decode(errors="replace").split())[:120]


def _place(error: BaseException) -> str:
    """Return the error, and the last place of the package that it passed."""
    frames = traceback.extract_tb(error.__traceback__)
    last = ([frame for frame in frames if "/roadeval/" in frame.filename] or frames)[-1]
    file = re.sub(r".*/(?=roadeval/|tests/)", "", last.filename)
    said = " ".join(str(error).replace(str(scratch()), "").split())[:120]
    return f"{type(error).__name__} at {file}:{last.lineno} ({said})"

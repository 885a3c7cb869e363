"""Work in a process of its own that ends, or finds its disk full, at a given step."""

from __future__ import annotations

import errno
import os
import resource
import sys
from collections.abc import Callable
from typing import Any, Final

from roadeval import RoadevalError

ADDING: Final = ("os.mkdir", "os.link", "os.rename")
"""Steps for which a disk may lack room."""
OTHERS: Final = ("os.remove", "os.rmdir", "os.chmod", "os.chown", "os.truncate", "fcntl.flock")
WRITES: Final = os.O_WRONLY | os.O_RDWR | os.O_CREAT
DONE, FAILED, KILLED, BROKEN = 0, 1, 9, 70


def run(work: Callable[[], object], hook: Callable[[str], None]) -> int:
    """Run work in a child, with ``hook`` called before each of its steps on the file system.

    Returns `DONE`; `FAILED`, if it ended by an error that people are told; `KILLED`; or `BROKEN`.
    """
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])

    def audit(event: str, given: tuple[Any, ...]) -> None:
        if event in (*ADDING, *OTHERS) or (event == "open" and given[2] & WRITES):
            hook(event)

    code = BROKEN
    try:
        sys.addaudithook(audit)
        work()
        code = DONE
    except (OSError, RoadevalError):
        code = FAILED
    finally:
        os._exit(code)


class KilledAt:
    """Ends the process before its step of this number, from 1."""

    def __init__(self, number: int) -> None:
        self._left = number

    def __call__(self, _event: str) -> None:
        self._left -= 1
        if self._left == 0:
            os._exit(KILLED)


class FullFrom:
    """Lets every step that needs room fail, from the one of this number on."""

    def __init__(self, number: int) -> None:
        self._before = number - 1

    def __call__(self, event: str) -> None:
        if event not in (*ADDING, "open"):
            return
        if self._before == 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        self._before -= 1


def undisturbed(_event: str) -> None:
    """Do nothing at any step."""


def in_small_files(size: int, work: Callable[[], object]) -> None:
    """Do some work whose files have room for so many bytes each."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))
    work()

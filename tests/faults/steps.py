"""Work in a process of its own that ends, or finds its disk full, at a given step."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable
from typing import Any, Final

from roadeval.errors import RoadevalError

ADDING: Final = ("os.mkdir", "os.link", "os.rename", "ctypes.dlsym")
"""Steps for which a disk may lack room; the last one looks up the call that exchanges folders."""
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


def killed_at(number: int) -> Callable[[str], None]:
    """End the process before its step of this number, from 1."""
    steps = iter(range(1, number))

    def hook(_event: str) -> None:
        if next(steps, None) is None:
            os._exit(KILLED)

    return hook


def full_from(number: int) -> Callable[[str], None]:
    """Let every step that needs room fail, from the one of this number on."""
    steps = iter(range(1, number))

    def hook(event: str) -> None:
        if event in (*ADDING, "open") and next(steps, None) is None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    return hook

"""Claims: of the runs that would write one output, one at a time may.

A claim is a lock of the system on a file beside the output, and ends with its process, however that
ends. The library ``filelock`` locks files, too, but it cannot tell who holds a lock, and leaves its
files behind.
"""

from __future__ import annotations

import errno
import os
import platform
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import Final

from roadeval.runtime.files import own_names

PATIENCE_S: Final = 0.2
"""Between two looks whether another run has ended with a file."""


@contextmanager
def alone(*files: Path) -> Iterator[None]:
    """Hold files by the first of them, whose folder is made, once whoever has it has ended.

    What a run that was killed has left of them is removed.

    Raises
    ------
    OSError
        If nothing can be written to the folder.
    """
    home = files[0].parent
    home.mkdir(parents=True, exist_ok=True)
    with ExitStack() as claims:
        while True:
            try:
                certain = claims.enter_context(claimed(files[0], home))
                break
            except BlockingIOError:
                time.sleep(PATIENCE_S)
        for file in files if certain else ():
            with suppress(OSError):
                for left in own_names(file):
                    left.unlink()
        yield


@contextmanager
def claimed(path: Path, home: Path) -> Iterator[bool]:
    """Hold the claim on an output; yield whether it is certain that no other run has it.

    It is not where the system or the disk has no locks: what lies there may be another run's then.

    Parameters
    ----------
    path
        The output.
    home
        Folder of the file that is locked: the same for every run that writes this output.

    Raises
    ------
    BlockingIOError
        If another run has it; says which, and since when.
    OSError
        If nothing can be written to the folder.
    """
    name = home / f".{path.name}.lock"
    lock = _lock_at(name)
    if lock is None:
        yield False
        return
    try:
        yield True
    finally:
        # While it is locked: once it is not, it may be another run's.
        with suppress(OSError):
            name.unlink()
        os.close(lock)


def _lock_at(name: Path) -> int | None:
    """Lock a file and write into it who did; return it open, or None where there are no locks."""
    while True:
        lock = _open(name)
        try:
            if not _lock(lock):
                os.close(lock)
                name.unlink(missing_ok=True)
                return None
        except BlockingIOError:
            os.close(lock)
            raise
        if _is_at(lock, name):
            _sign(lock)
            return lock
        # The run that had it has removed it in the meantime, and the next one would not see it.
        os.close(lock)


def _lock(file: int) -> bool:
    """Lock a file and return True; False where there are no locks."""
    try:
        import fcntl
    except ImportError:
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError) as error:
        who = os.pread(file, 200, 0).decode(errors="replace") or "it has just begun"
        raise BlockingIOError(errno.EAGAIN, f"another run is writing it ({who})") from error
    except OSError:  # the disk has none
        return False
    return True


def _is_at(file: int, name: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(file), name.stat())
    except FileNotFoundError:
        return False


def _open(name: Path) -> int:
    # A folder from elsewhere may have a link there: what it leads to would be overwritten.
    here = getattr(os, "O_NOFOLLOW", 0)
    try:
        return os.open(name, os.O_RDWR | os.O_CREAT | here, 0o666)
    except PermissionError:
        if not name.exists():
            raise
        return os.open(name, os.O_RDONLY | here)  # a dead run's of another user


def _sign(lock: int) -> None:
    """Write whose lock it is; only for people."""
    now = datetime.now().astimezone().isoformat(" ", "seconds")
    with suppress(OSError):
        os.ftruncate(lock, 0)
        os.pwrite(lock, f"process {os.getpid()} on {platform.node()}, since {now}".encode(), 0)

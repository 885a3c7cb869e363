"""Folders that are replaced as one.

A new folder is built beside the one of its name, and then the two change places in one step, which
Linux can do. At every moment the name bears the whole old content or the whole new one.

Where that cannot be done (no such call, a mount point, the current folder, a parent that may not be
written to, folders of others inside) the new files are moved into the folder one by one. Its *seal*
is removed first and comes last, so that nobody takes what is between for whole, and whoever writes
the folder next first ends what a killed run had begun (`recover`).
"""

from __future__ import annotations

import ctypes
import errno
import json
import os
import shutil
import stat
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from roadeval.runtime.files import check_folder, own_name, own_names

_COMPLETE: Final = "-complete"
_MOVING: Final = "-moving"
"""Endings of a complete folder's name inside the one that it replaces: while the old files are
removed, and while its own are moved."""
_REPLACED: Final = ".replaced"
"""A file of such a folder with the names of the old files."""


@dataclass(frozen=True, slots=True)
class Content:
    """What belongs to a folder's content; all else in it is of others, and stays."""

    seal: str
    """The file without which nobody takes the folder for whole."""
    names: Callable[[Path], frozenset[str]]
    """Returns the names of the files that belong to the content of a folder."""


class NewFolder:
    """A folder that is built under a name of its own, and takes its place when it is complete.

    Parameters
    ----------
    path
        The name that it will have. Where it is a link, what it leads to is replaced.
    content
        What is replaced in a folder that is there.
    """

    def __init__(self, path: Path, content: Content) -> None:
        self.path: Final = path
        self._content: Final = content
        self._target: Final = Path(os.path.realpath(path))
        self.partial: Final = own_name(home_of(self._target) / self._target.name)

    def begin(self) -> None:
        """Make it, empty.

        Raises
        ------
        OSError
            If it cannot be made, or something else than a folder bears its name.
        """
        check_folder(self.path)
        self.partial.mkdir(parents=True)

    def publish(self) -> None:
        """Let it take its place.

        Raises
        ------
        OSError
            If it cannot; then the earlier content is there, or the next `recover` ends what has
            begun.
        """
        if not self._target.exists():
            self.partial.rename(self._target)
        elif _exchanged(self.partial, self._target, self._content):
            self.discard()  # it has the earlier content now
        else:
            _move_in(self.partial, self._target, self._content)

    def discard(self) -> None:
        """Remove what lies under its own name: what was begun, or has been replaced.

        What cannot be removed is left for `recover`.
        """
        with suppress(OSError):
            _remove(self.partial, self._target, self._content)


def home_of(target: Path) -> Path:
    """Return the folder for what a run keeps beside an output: its parent where that will do.

    What lies beside a mount point is elsewhere, and perhaps not seen by all who share it.
    """
    if not os.path.isdir(target):  # noqa: PTH112 - for a name that is too long it is False
        return target.parent
    apart = os.path.ismount(target) or not os.access(target.parent, os.W_OK | os.X_OK)
    return target if apart else target.parent


def recover(path: Path, content: Content) -> None:
    """End what killed runs had begun with a folder, and remove what they left.

    Nobody else may be writing it.

    Raises
    ------
    OSError
        If a run was killed while it moved its files, and the rest of them cannot be moved.
    """
    target = Path(os.path.realpath(path))
    for left in _folders(target / target.name):
        if left.name.endswith((_COMPLETE, _MOVING)):
            _settle(left, content)
        else:
            shutil.rmtree(left, ignore_errors=True)
    for left in _folders(target):
        with suppress(OSError):
            _remove(left, target, content)


def _folders(path: Path) -> list[Path]:
    return [each for each in own_names(path) if each.is_dir()] if path.parent.is_dir() else []


def _exchanged(new: Path, target: Path, content: Content) -> bool:
    """Let two folders change places in one step, if that can be done.

    Files of others in the target get a second name in the new folder before.
    """
    if home_of(target) == target or not (target / content.seal).exists() or _is_in_use(target):
        return False
    linked = []
    try:
        for other in _of_others(target, content):
            # It fails for a folder, and where the new folder has a file of that name.
            os.link(other, new / other.name, follow_symlinks=False)
            linked.append(new / other.name)
        _copy_rights(target, new)
        _exchange(new, target)
    except OSError:
        for link in linked:
            link.unlink()
        return False
    return True


def _is_in_use(target: Path) -> bool:
    """Whether a folder is one that many use, as /tmp, or the one in which this process stands."""
    if target.stat().st_mode & stat.S_ISVTX:
        return True
    try:
        return target.samefile(os.curdir)
    except FileNotFoundError:  # somebody has removed the current folder
        return False


def _copy_rights(source: Path, to: Path) -> None:
    there = source.stat()
    with suppress(OSError, AttributeError):  # Windows has no such function
        os.chown(to, there.st_uid, there.st_gid)
    to.chmod(stat.S_IMODE(there.st_mode))


def _exchange(one: Path, other: Path) -> None:
    """Exchange the names of two folders in one step; an OSError where that cannot be done."""
    renameat2 = None
    if sys.platform == "linux":
        renameat2 = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if renameat2 is None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    here, exchange = -100, 2  # AT_FDCWD and RENAME_EXCHANGE in the kernel's headers
    if renameat2(here, os.fsencode(one), here, os.fsencode(other), exchange):
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))


def _remove(old: Path, target: Path, content: Content) -> None:
    """Remove a folder that has been replaced, or was never complete.

    A complete one may still hold files of others that the target lacks: they move there.
    """
    if (old / content.seal).exists() and target.is_dir():
        for other in _of_others(old, content):
            place = target / other.name
            if not os.path.lexists(place) or _is_newer(other, place):
                other.replace(place)
    for each in _seal_last(old, content):
        if each.is_dir() and not each.is_symlink():
            shutil.rmtree(each)
        else:
            each.unlink()
    old.rmdir()


def _is_newer(one: Path, other: Path) -> bool:
    return one.lstat().st_mtime_ns > other.lstat().st_mtime_ns


def _move_in(new: Path, target: Path, content: Content) -> None:
    """Move the files of a new folder one by one into the one of its name."""
    for each in new.iterdir():
        if (target / each.name).is_dir():
            raise IsADirectoryError(errno.EISDIR, "is a folder", str(target / each.name))
    inside = new
    if new.parent != target:
        inside = own_name(target / target.name)
        try:
            shutil.move(new, inside)
        except OSError:
            shutil.rmtree(inside, ignore_errors=True)
            raise
    # Written down, for without its seal an earlier content may not know its own files.
    (inside / _REPLACED).write_text(json.dumps(sorted(content.names(target))))
    _settle(inside.rename(inside.with_name(inside.name + _COMPLETE)), content)


def _settle(complete: Path, content: Content) -> None:
    """Move the files of a complete folder into its parent; after a kill, those that are left."""
    target = complete.parent
    if complete.name.endswith(_COMPLETE):
        (target / content.seal).unlink(missing_ok=True)
        for name in json.loads((complete / _REPLACED).read_text()):
            if name == Path(name).name and not (target / name).is_dir():
                (target / name).unlink(missing_ok=True)
        complete = complete.rename(
            complete.with_name(complete.name.removesuffix(_COMPLETE) + _MOVING)
        )
    (complete / _REPLACED).unlink(missing_ok=True)
    for each in _seal_last(complete, content):
        each.replace(target / each.name)
    complete.rmdir()


def _of_others(folder: Path, content: Content) -> list[Path]:
    """List what does not belong to a folder's content; a folder never does."""
    own = content.names(folder)
    return [
        each
        for each in folder.iterdir()
        if each.name not in own or (each.is_dir() and not each.is_symlink())
    ]


def _seal_last(folder: Path, content: Content) -> list[Path]:
    return sorted(folder.iterdir(), key=lambda each: (each.name == content.seal, each.name))

"""Files that appear under their name only when they are complete."""

from __future__ import annotations

import errno
import os
import re
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

_TOKEN: Final = 4
"""Random bytes in the name of a run's own."""
_KINDS: Final = {
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
}


def check_file(path: Path) -> None:
    """Raise an OSError if no file can take this name, for what bears it is none.

    Nothing may bear it yet. A link counts as what it leads to.
    """
    mode = _mode(path)
    with suppress(FileNotFoundError):
        own_name(path).lstat()  # longer than its own name: too long, perhaps
    if mode is not None and stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "is a folder; name a file in it", str(path))
    if mode is not None and not stat.S_ISREG(mode):
        kind = _KINDS.get(stat.S_IFMT(mode), "something else")
        raise OSError(errno.ENOTSUP, f"is {kind}, not a file; name another", str(path))


def check_input(path: str | Path) -> None:
    """Raise an OSError if a path leads to no file that can be read from its begin to its end.

    A pipe may never give anything, and a device never end, so what is read as a whole is asked
    this before it is opened.
    """
    mode = Path(path).stat().st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "is a folder, not a file", str(path))
    if not stat.S_ISREG(mode):
        kind = _KINDS.get(stat.S_IFMT(mode), "something else")
        problem = f"is {kind}, not a file; write what it gives to a file first"
        raise OSError(errno.ENOTSUP, problem, str(path))


def check_folder(path: Path) -> None:
    """Raise an OSError if no folder can take this name, for what bears it is none."""
    mode = _mode(path)
    if mode is not None and not stat.S_ISDIR(mode):
        kind = _KINDS.get(stat.S_IFMT(mode), "a file")
        raise NotADirectoryError(errno.ENOTDIR, f"is {kind}, not a folder; name another", str(path))


def _mode(path: Path) -> int | None:
    try:
        return path.stat().st_mode
    except FileNotFoundError:
        return None
    except ValueError as error:  # a name with a null character
        raise OSError(errno.EINVAL, str(error), str(path)) from error


def own_name(path: Path, *, hidden: bool = True) -> Path:
    """Return a name beside an output's that no other run has, for what is not complete yet.

    ``out.rrd`` may become ``.out.5d1c02fe.partial.rrd``.
    """
    dot = "." if hidden else ""
    return path.parent / f"{dot}{path.stem}.{secrets.token_hex(_TOKEN)}.partial{path.suffix}"


def own_names(path: Path, *, hidden: bool = True) -> list[Path]:
    """List what lies there under an `own_name` of an output, the newest last.

    Names that go on with a hyphen are among them, for what a run keeps beside such a file.
    """
    stem, suffix = re.escape(path.stem), re.escape(path.suffix)
    dot, token = r"\." if hidden else "", rf"\.[0-9a-f]{{{2 * _TOKEN}}}"
    pattern = re.compile(rf"{dot}{stem}{token}\.partial{suffix}(-\w+)?")
    found = [each for each in path.parent.iterdir() if pattern.fullmatch(each.name)]
    return sorted(found, key=lambda each: each.lstat().st_mtime_ns)


class NewFile:
    """A file that is written under a name of its own, and takes its place when it is complete.

    Where ``path`` is a link, what it leads to is replaced.

    Parameters
    ----------
    path
        The name that it will have.
    hidden
        Whether its name begins with a dot meanwhile.
    """

    def __init__(self, path: Path, *, hidden: bool = True) -> None:
        self.path: Final = path
        self._target: Final = target_of(path)
        self.partial: Final = own_name(self._target, hidden=hidden)

    def begin(self) -> None:
        """Make its folder.

        Raises
        ------
        OSError
            If that cannot be made, or the file cannot have its name (see `check_file`).
        """
        check_file(self.path)
        self._target.parent.mkdir(parents=True, exist_ok=True)

    def publish(self) -> None:
        """Give the file its name; what bore it is replaced."""
        self.partial.replace(self._target)

    def discard(self) -> None:
        """Remove what was begun; nothing, if the file has its name already."""
        with suppress(OSError):
            self.partial.unlink(missing_ok=True)


def leads_outside(path: Path, folder: Path) -> bool:
    """Return whether a path in a folder leads out of it, by links or by its name."""
    return not Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder))


def target_of(path: Path) -> Path:
    """Return where a link leads; any other path as it is."""
    return Path(os.path.realpath(path)) if os.path.islink(path) else path  # noqa: PTH114


@contextmanager
def made(folder: Path) -> Iterator[None]:
    """Make a folder and its parents; those that are empty when the block ends are removed again.

    Raises
    ------
    OSError
        If it cannot be made.
    """
    missing = [each for each in (folder, *folder.parents) if not each.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    finally:
        for each in missing:
            with suppress(OSError):
                each.rmdir()


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Write a file atomically: under a name of its own, and then under its path.

    Yields the temporary path, in the folder of ``path``, which is made if it does not exist. When
    the block ends the file takes its name and replaces what bore it; if the block fails it is
    removed, and what bore the name stays.

    Raises
    ------
    OSError
        If the folder cannot be made or the file cannot take its name.
    """
    file = NewFile(path)
    file.begin()
    try:
        yield file.partial
        file.publish()
    finally:
        file.discard()


def put(path: Path, content: bytes) -> None:
    """Write a file atomically, and make its folder.

    Raises
    ------
    OSError
        If it cannot be written; then nothing is left behind.
    """
    with replacing(path) as temporary:
        temporary.write_bytes(content)

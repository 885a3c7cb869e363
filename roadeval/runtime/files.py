"""Files and folders that are replaced as one, by one run at a time.

An output is written under a temporary name and renamed when it is complete, so that a file with the
final name is never partial. A run claims its outputs before it computes, and removes the partial
files of killed runs.
"""

from __future__ import annotations

import errno
import hashlib
import os
import platform
import re
import secrets
import shutil
import stat
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Final

AnyPath = str | Path
Paths = AnyPath | Sequence[AnyPath]
"""One path, or some."""

_MOVING: Final = "-moving"
"""Suffix of a complete folder's name while its files are moved into the target folder."""
_REPLACED: Final = ".replaced"
"""Name under which that folder keeps the old result's seal until the old files are removed."""
_PATIENCE_S: Final = 0.2
"""Time between two attempts to claim an output."""

LFS_HEAD: Final = b"version https://git-lfs"
LFS: Final = "is a pointer to a file in Git LFS: git lfs pull"

_KINDS: Final = {
    stat.S_IFDIR: "a folder",
    stat.S_IFREG: "a file",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
}


def list_paths(paths: Paths) -> list[AnyPath]:
    """Return one path or some as a list; a text is a path, not a sequence of letters."""
    return [paths] if isinstance(paths, str | Path) else list(paths)


@contextmanager
def reading(place: object, kind: Callable[..., Exception], problem: str = "") -> Iterator[None]:
    """Turn an OSError inside the block into the error that ``kind`` makes."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise kind(f"{problem}: {reason}" if problem else reason, where=place) from error


def writing(place: object, kind: Callable[..., Exception]) -> AbstractContextManager[None]:
    """Turn an OSError inside the block into an error that says that ``place`` cannot be written."""
    return reading(place, kind, "cannot be written")


def check_input(path: str | Path) -> None:
    """Raise an OSError if a path does not lead to a file that can be read to its end.

    A pipe may never give a byte, a device may never end, and a pointer of Git LFS stands for a file
    that is elsewhere.
    """
    _check_kind(Path(path), "a file", "")
    with Path(path).open("rb") as file:
        if file.read(len(LFS_HEAD)) == LFS_HEAD:
            raise OSError(errno.EINVAL, LFS, str(path))


def check_output(path: Path, *, folder: bool = False) -> None:
    """Raise an OSError if no file, or folder, can be written under a name."""
    with suppress(FileNotFoundError):
        _check_kind(path, "a folder" if folder else "a file", "; name another")
    with suppress(FileNotFoundError):
        partial_name(path).lstat()  # it is longer, and may be too long


def _check_kind(path: Path, expected: str, advice: str) -> None:
    if "\0" in str(path):
        raise OSError(errno.EINVAL, "its name has a null character", str(path))
    mode = stat.S_IFMT(path.stat().st_mode)
    kind = _KINDS.get(mode, "a device")
    if kind != expected:
        number = errno.EISDIR if mode == stat.S_IFDIR else errno.ENOTSUP
        raise OSError(number, f"is {kind}, not {expected}{advice}", str(path))


def partial_name(path: Path, *, hidden: bool = True) -> Path:
    """Return a unique name beside an output's, for a file that is not complete yet.

    ``out.rrd`` may become ``.out.5d1c02fe.partial.rrd``.
    """
    dot = "." if hidden else ""
    return path.parent / f"{dot}{path.stem}.{secrets.token_hex(4)}.partial{path.suffix}"


def find_partial(path: Path, *, hidden: bool = True) -> list[Path]:
    """List the files and folders with a `partial_name` of an output, the newest last.

    A hyphen and a word, such as ``-moving``, may follow the name.
    """
    dot, stem, suffix = r"\." if hidden else "", re.escape(path.stem), re.escape(path.suffix)
    pattern = re.compile(rf"{dot}{stem}\.[0-9a-f]{{8}}\.partial{suffix}(-\w+)?")
    entries = path.parent.iterdir() if path.parent.is_dir() else ()
    partial = [entry for entry in entries if pattern.fullmatch(entry.name)]
    return sorted(partial, key=lambda entry: entry.lstat().st_mtime_ns)


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def leads_outside(path: Path, folder: Path) -> bool:
    """Return whether a path in a folder leads out of it, by links or by its name."""
    return not Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder))


def target_of(path: Path) -> Path:
    """Return the target of a link; any other path unchanged."""
    return Path(os.path.realpath(path)) if os.path.islink(path) else path  # noqa: PTH114


def remove(path: Path) -> None:
    """Remove a file or folder if that is possible; an error leaves only clutter."""
    with suppress(OSError):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)


class NewFile:
    """A file that is written as ``partial`` and takes its place when it is complete.

    If ``path`` is a link, its target is replaced.
    """

    def __init__(self, path: Path, *, hidden: bool = True) -> None:
        self._target: Final = target_of(path)
        self.partial: Final = partial_name(self._target, hidden=hidden)

    def begin(self) -> None:
        """Make its folder; an OSError if that fails, or if no file can have this name."""
        check_output(self._target)
        self._target.parent.mkdir(parents=True, exist_ok=True)

    def publish(self) -> None:
        """Give the complete file its name."""
        self.partial.replace(self._target)

    def discard(self) -> None:
        """Remove the partial file, if there is one."""
        remove(self.partial)


def put(path: Path, content: bytes) -> None:
    """Write a file atomically, and make its folder; an OSError leaves nothing behind."""
    file = NewFile(path)
    file.begin()
    try:
        file.partial.write_bytes(content)
        file.publish()
    finally:
        file.discard()


@dataclass(frozen=True)
class Content:
    """The files of a folder that are replaced; all others stay."""

    seal: str
    """Name of the file that makes the folder a complete result."""
    names: Callable[[Path], frozenset[str]]
    """A function that reads the names of the files from a seal, which may be missing."""


class NewFolder:
    """A folder that is written as ``partial``; its files take their places together.

    It is written inside the target folder. `publish` removes the old seal first and moves the new
    one last; `claim_folder` completes the moves of a killed run. If ``path`` is a link, its target
    is written; ``content`` lists the files that are replaced.
    """

    def __init__(self, path: Path, content: Content) -> None:
        self.path: Final = path
        self._content: Final = content
        self._target: Final = Path(os.path.realpath(path))
        self._is_new: Final = not self._target.exists()
        self.partial: Final = partial_name(self._target / self._target.name)

    def begin(self) -> None:
        """Make the empty folder; an OSError if that fails, or if no folder can have this name."""
        check_output(self.path, folder=True)
        self.partial.mkdir(parents=True)

    def publish(self) -> None:
        """Move the files to their places.

        After an OSError the old content is there, or the next `claim_folder` completes the new.
        """
        for file in self.partial.iterdir():
            if (self._target / file.name).is_dir():
                raise IsADirectoryError(errno.EISDIR, "is a folder", str(self._target / file.name))
        _settle(self.partial.rename(f"{self.partial}{_MOVING}"), self._content)

    def discard(self) -> None:
        """Remove the partial folder, and the empty folder that was made for it, if any."""
        remove(self.partial)
        if self._is_new:
            with suppress(OSError):
                self._target.rmdir()


def _settle(moving: Path, content: Content) -> None:
    """Move the files of a complete folder, or those that a killed run left, into its parent."""
    target, seal, replaced = moving.parent, moving / content.seal, moving / _REPLACED
    if seal.exists():
        with suppress(FileNotFoundError):  # without an old seal, no file belongs to an old result
            (target / content.seal).replace(replaced)
        if replaced.exists():
            for name in content.names(replaced):
                if not (target / name).is_dir():
                    (target / name).unlink(missing_ok=True)
            replaced.unlink()
        for file in moving.iterdir():
            if file != seal:
                file.replace(target / file.name)
        seal.replace(target / content.seal)
    remove(moving)


@contextmanager
def claim_file(path: Path, *, wait: bool = False) -> Iterator[bool]:
    """Hold the claim on a file to be written, see `claim`; earlier partial files are removed.

    An OSError if the file cannot be written.
    """
    check_output(path)
    target = target_of(path)
    with new_folder(target.parent), claim(target, target.parent, wait=wait) as certain:
        for left in find_partial(target) if certain else ():
            remove(left)
        yield certain


@contextmanager
def claim_files(*paths: Path) -> Iterator[None]:
    """Hold the claims on files; wait while other runs have them."""
    with ExitStack() as claims:
        for path in paths:
            claims.enter_context(claim_file(path, wait=True))
        yield


@contextmanager
def claim_folder(path: Path, content: Content) -> Iterator[bool]:
    """Hold the claim on a folder to be replaced, as `claim_file` does on a file.

    The moves that a killed run had begun are completed.
    """
    check_output(path, folder=True)
    target = Path(os.path.realpath(path))
    with new_folder(target), claim(target, target) as certain:
        for left in find_partial(target / target.name) if certain else ():
            _settle(left, content) if left.name.endswith(_MOVING) else remove(left)
        yield certain


@contextmanager
def claim(path: Path, home: Path, *, wait: bool = False) -> Iterator[bool]:
    """Hold the claim on an output: a lock of the system on a file in a folder.

    The lock ends with the process. All runs that write the output name the same folder. While
    another run has the claim, wait, or raise a BlockingIOError that names the run.

    Yields whether it is certain that no other run has the claim: False if the system or the disk
    has no locks. The library ``filelock`` names no owner of a lock, and leaves its files behind.
    """
    name = home / f".{path.name}.lock"
    file, certain = open_locked(name, wait=wait)
    try:
        yield certain
    finally:
        # Before the lock ends: after that the file may be another run's.
        with suppress(OSError):
            name.unlink(missing_ok=True)
        os.close(file)


def is_claimed(path: Path) -> bool:
    """Return whether a run claims a file, or was killed while it did."""
    return path.with_name(f".{path.name}.lock").exists()


def open_locked(name: Path, *, wait: bool) -> tuple[int, bool]:
    """Open and lock a file; return it, and whether there are locks."""
    # A link in a folder from elsewhere is not followed: its target would be overwritten.
    no_links = getattr(os, "O_NOFOLLOW", 0)
    while True:
        try:
            file = os.open(name, os.O_RDWR | os.O_CREAT | no_links, 0o666)
        except PermissionError:
            if not name.exists():
                raise
            file = os.open(name, os.O_RDONLY | no_links)  # a killed run of another user left it
        try:
            certain = lock(file)
            # The last owner may have removed the file meanwhile: then it protects nothing.
            if not certain or os.path.samestat(os.fstat(file), name.stat()):
                return file, certain
        except FileNotFoundError:
            pass
        except BlockingIOError:
            if not wait:
                os.close(file)
                raise
            time.sleep(_PATIENCE_S)
        os.close(file)


def lock(file: int) -> bool:
    """Lock a file, write the owner into it, and return True; False if there are no locks."""
    try:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError) as error:
        owner = os.pread(file, 200, 0).decode(errors="replace") or "it has just begun"
        raise BlockingIOError(errno.EAGAIN, f"another run is writing it ({owner})") from error
    except (ImportError, OSError):  # the system has none, or the disk
        return False
    now = datetime.now().astimezone().isoformat(" ", "seconds")
    with suppress(OSError):
        os.ftruncate(file, 0)
        os.pwrite(file, f"process {os.getpid()} on {platform.node()}, since {now}".encode(), 0)
    return True


@contextmanager
def new_folder(folder: Path) -> Iterator[None]:
    """Make a folder and its parents; those that stay empty are removed at the end."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    finally:
        for path in missing:
            with suppress(OSError):
                path.rmdir()

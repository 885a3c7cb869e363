"""Outputs and their folders: made where missing, and gone again if nothing came to stand there."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


def make(folder: Path) -> list[Path]:
    """Make a folder and those above it.

    Returns
    -------
    list of Path
        Those that it made, the innermost first.

    Raises
    ------
    OSError
        If it cannot be made; what was made on the way is gone again.
    """
    missing = [each for each in (folder, *folder.parents) if not each.exists()]
    new: list[Path] = []
    try:
        for each in reversed(missing):
            # Another process may make one meanwhile, which is its own then.
            with suppress(FileExistsError):
                each.mkdir()
                new.insert(0, each)
        folder.mkdir(exist_ok=True)
    except OSError:
        remove(new)
        raise
    return new


def remove(new: Iterable[Path]) -> None:
    """Remove folders that `make` made, but those in which something stands by now."""
    for folder in new:
        with suppress(OSError):
            folder.rmdir()


@contextmanager
def made(folder: Path) -> Iterator[list[Path]]:
    """Make a folder and those above it; if the block fails they are gone again.

    Yields those that it made, as `make` gives them. An OSError if it cannot be made.
    """
    new = make(folder)
    try:
        yield new
    except BaseException:
        remove(new)
        raise


def put(path: Path, content: bytes) -> None:
    """Write a file, which bears its name only when it is complete, and its folder.

    An OSError if it cannot be written; then nothing is left behind.
    """
    temporary = path.with_name(f".{path.name}.partial")
    with made(path.parent):
        try:
            temporary.write_bytes(content)
            temporary.replace(path)
        finally:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)

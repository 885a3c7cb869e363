"""Files that appear under their name only when they are complete."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Write a file atomically: under a temporary name, and then under its own.

    Yields the temporary path, in the folder of ``path``, which is made if it does not exist. When
    the block ends the file takes its name and replaces what bore it; if the block fails it is
    removed, and what bore the name stays.

    Raises
    ------
    OSError
        If the folder cannot be made or the file cannot take its name.
    """
    temporary = path.with_name(f".{path.name}.partial")
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        yield temporary
        temporary.replace(path)
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def put(path: Path, content: bytes) -> None:
    """Write a file atomically, and make its folder.

    Raises
    ------
    OSError
        If it cannot be written; then nothing is left behind.
    """
    with replacing(path) as temporary:
        temporary.write_bytes(content)

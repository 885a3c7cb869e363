"""A file with a folder of files beside it, both replaced as one.

The folder's name holds a digest of what is in it, as ``page.files-0a1b2c3d`` beside ``page.html``.
It is complete before the file, which names it, takes its place; then the one before is removed. At
every moment the file finds what belongs to it.
"""

from __future__ import annotations

import hashlib
import re
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from roadeval.runtime.files import own_name, own_names, put, target_of

_DIGITS: Final = 8


def folder_name(path: Path, files: Mapping[str, bytes]) -> str:
    """Return the name of the folder beside a file, from its content."""
    digest = hashlib.blake2b(digest_size=_DIGITS // 2)
    for name, content in sorted(files.items()):
        digest.update(f"{name}\0{len(content)}\0".encode() + content)
    return f"{path.stem}.files-{digest.hexdigest()}"


def put_with(path: Path, content: bytes, files: Mapping[str, bytes]) -> None:
    """Write a file and the folder beside it; what was there before goes with the old file.

    Parameters
    ----------
    path
        The file.
    content
        Of the file; it names the folder by `folder_name`.
    files
        What the folder holds, by name; where there is nothing no folder is.

    Raises
    ------
    OSError
        If they cannot be written; then the earlier ones are there.
    """
    target = target_of(path)
    folder = target.with_name(folder_name(target, files))
    made = bool(files) and not folder.exists()
    if made:
        _build(folder, files)
    try:
        put(path, content)
    except OSError:
        if made:
            shutil.rmtree(folder, ignore_errors=True)
        raise
    for other in _folders(target):
        if other != folder or not files:
            shutil.rmtree(other, ignore_errors=True)


def _build(folder: Path, files: Mapping[str, bytes]) -> None:
    for left in own_names(folder) if folder.parent.is_dir() else ():
        shutil.rmtree(left, ignore_errors=True)
    partial = own_name(folder)
    try:
        partial.mkdir(parents=True)
        for name, content in files.items():
            (partial / name).write_bytes(content)
        partial.rename(folder)
    except OSError:
        shutil.rmtree(partial, ignore_errors=True)
        raise


def _folders(path: Path) -> list[Path]:
    """List the folders that were put beside a file."""
    pattern = re.compile(rf"{re.escape(path.stem)}\.files-[0-9a-f]{{{_DIGITS}}}")
    return [each for each in path.parent.iterdir() if pattern.fullmatch(each.name)]

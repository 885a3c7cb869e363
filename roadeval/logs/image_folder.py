"""Folders of image files: which files count, their order, and what their names tell."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Final

from roadeval.logs.errors import LogError
from roadeval.logs.files import natural
from roadeval.logs.times import NS

IMAGES: Final = frozenset(
    {".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp", ".ppm", ".pgm"}
)
"""Endings of image files, in lower case."""
_LABEL_SUFFIX: Final = re.compile(
    r"[_.-]?(labelids|labels?|masks?|gt|truth|road|seg|segmentation|annotations?|L)$"
)
_TIME: Final = re.compile(r"(\d{10})(?:[._](\d{1,9}))?|(\d{13})|(\d{16})|(\d{19})")


def listed(folder: Path, endings: Collection[str]) -> list[Path]:
    """Return the files of a folder that have one of these endings, in natural order.

    Raises
    ------
    LogError
        If there is no such folder, or no such file in it.
    """
    try:
        found = [file for file in folder.iterdir() if file.suffix.lower() in endings]
    except NotADirectoryError as error:
        raise LogError(f"{folder}: a file, not a folder") from error
    except FileNotFoundError as error:
        raise LogError(f"{folder}: no such folder") from error
    except OSError as error:
        raise LogError(f"{folder}: {error.strerror}") from error
    if not found:
        raise LogError(f"{folder}: no image in it ({', '.join(sorted(endings))})")
    return sorted(found, key=natural)


def ordered(files: Sequence[Path]) -> tuple[list[Path], list[int] | None]:
    """Return files in the order of the times that their names are, with these in nanoseconds.

    As they are, and None, if not every name is a time of its own.
    """
    times = {file: time for file in files if (time := time_in(file.stem)) is not None}
    if len(times) < len(files) or len(set(times.values())) < len(files):
        return list(files), None
    in_order = sorted(files, key=times.__getitem__)
    return in_order, [times[file] for file in in_order]


def by_name(images: Sequence[Path], masks: Sequence[Path]) -> Mapping[Path, Path]:
    """Find for each image the mask of its name, or of its name with a label's ending."""
    exact = {mask.stem: mask for mask in masks}
    loose = {bare(mask): mask for mask in masks}
    found = {image: exact.get(image.stem) or loose.get(image.stem) for image in images}
    return {image: mask for image, mask in found.items() if mask is not None}


def bare(file: Path) -> str:
    """Return a file's name without its ending, and without a label's, as ``_mask``."""
    return _LABEL_SUFFIX.sub("", file.stem)


def time_in(name: str) -> int | None:
    """Return nanoseconds since 1970, if the whole name is a time."""
    match = _TIME.fullmatch(name)
    if match is None:
        return None
    seconds, fraction, milli, micro, nano = match.groups()
    if seconds is not None:
        return int(seconds) * NS + int((fraction or "").ljust(9, "0"))
    scales = ((milli, 1_000_000), (micro, 1000), (nano, 1))
    return next(int(digits) * scale for digits, scale in scales if digits is not None)

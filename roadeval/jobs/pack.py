"""A log of a folder of images, or of a video."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from roadeval import logs
from roadeval.jobs.outputs import AnyPath, holding

NAMED: Final = 3
"""Files that a warning names, at most."""


@dataclass(frozen=True, slots=True)
class PackOutcome:
    """The log that was written, and what a user should know of it.

    Parameters
    ----------
    path
        The log.
    images, masks
        How many of each it holds.
    stamps
        Where the stamps come from, in words.
    warnings
        Files without a counterpart, and what `roadeval.replay` would have to be told.
    """

    path: Path
    images: int
    masks: int
    stamps: str
    warnings: tuple[str, ...]


def pack(
    images: AnyPath,
    output: AnyPath,
    *,
    truth: AnyPath | None = None,
    rate_hz: float | None = None,
) -> PackOutcome:
    """Write a folder of images, or a video, as a log that Foxglove and Rerun open too.

    Parameters
    ----------
    images
        A folder, taken in natural order (``2.png`` before ``10.png``), or a video file.
    output
        The log to write.
    truth
        A folder of label images, for a folder of images; paired by name.
    rate_hz
        Images a second; by default the times in the names, a video's own, or 10.

    Raises
    ------
    RoadevalError
        If there is nothing to pack, a file is unreadable, or no mask belongs to an image.

    Examples
    --------
    >>> import roadeval
    >>> from pathlib import Path
    >>> from PIL import Image
    >>> Path("images").mkdir()
    >>> Image.new("RGB", (64, 48)).save("images/1718445600.png")
    >>> roadeval.pack("images", "packed.mcap").stamps
    "the times in the files' names"
    """
    with holding(output, inputs=(images, truth)):
        written = logs.pack(images, output, masks=truth, rate_hz=rate_hz)
    warnings = tuple(_warnings(written)) if truth is not None else ()
    return PackOutcome(written.path, written.frames, written.labelled, written.stamps, warnings)


def _warnings(written: logs.PackResult) -> Iterator[str]:
    yield from _unpaired("images without a mask", written.without_mask)
    yield from _unpaired("masks without an image", written.without_image)
    if problem := logs.describe(written.path).problem:
        yield f"packed, but replay needs to be told more: {problem}"


def _unpaired(what: str, names: Sequence[str]) -> Iterator[str]:
    if names:
        some = ", ".join(names[:NAMED]) + (", ..." if len(names) > NAMED else "")
        yield f"{what}: {some} ({len(names)} in all)"

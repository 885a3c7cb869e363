"""A log of a folder of images, or of a video."""

from __future__ import annotations

from dataclasses import replace

from roadeval import logs
from roadeval.jobs.outputs import holding
from roadeval.runtime.files import AnyPath


def pack(
    images: AnyPath,
    output: AnyPath,
    *,
    truth: AnyPath | None = None,
    rate_hz: float | None = None,
) -> logs.PackResult:
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
        packed = logs.pack(images, output, masks=truth, rate_hz=rate_hz)
    problem = logs.describe(packed.path).problem if truth is not None else ""
    if not problem:
        return packed
    warning = f"packed, but replay needs more settings: {problem}"
    return replace(packed, warnings=(*packed.warnings, warning))

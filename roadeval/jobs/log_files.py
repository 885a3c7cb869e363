"""Log files: their description, the packing of images or a video, and the demo drive."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

from roadeval.errors import RoadevalError
from roadeval.fleet.remote import open_source
from roadeval.jobs.outputs import holding
from roadeval.jobs.progress import OnProgress, Progress, ignore
from roadeval.logs.log import LogDescription, describe, open_log
from roadeval.logs.settings import LogConfig
from roadeval.logs.writing.writer import PackResult
from roadeval.logs.writing.writer import pack as pack_messages
from roadeval.runtime.files import AnyPath, put, writing
from roadeval.runtime.sentence import Sentence

MB: Final = 1_000_000


def info(
    drive: str | Path,
    config: LogConfig | None = None,
    *,
    verify: bool = False,
    on_progress: OnProgress = ignore,
) -> LogDescription:
    """Describe a log: topics, rates, gaps, damage, and what a replay would pick and why.

    Parameters
    ----------
    drive
        The log.
    config
        The configuration of the replay that is planned.
    verify
        Whether the whole log is read, so that all damage is found; a log of at most 50 MB on a disk
        is always read whole. If it is false, and a log at a URL has a summary, only the summary and
        the first messages are read.
    on_progress
        Called now and then while the whole log is read, with megabytes.

    Raises
    ------
    RoadevalError
        If it is not a log, or cannot be read.
    """

    def step(done: int, total: int) -> None:
        on_progress(Progress(done // MB, total // MB, "verifying", unit="MB"))

    source = open_source(drive)
    described = describe(source, config, verify=verify, on_bytes=step)
    if config is None or not config.truth.path or described.problem:
        return described
    from roadeval.jobs.run.summary import misfits_of_truth

    with open_log(source, config) as log:
        return replace(described, misfits=(*misfits_of_truth(log),))


def pack(
    images: AnyPath, output: AnyPath, *, truth: AnyPath | None = None, rate_hz: float | None = None
) -> PackResult:
    """Write a folder of images, or a video, as a log that Foxglove and Rerun open too.

    The readable frames of a damaged video are packed; ``losses`` says what is not.
    A `RoadevalError` if there is nothing to pack, a file is unreadable, or no mask belongs to an
    image.

    Parameters
    ----------
    images
        A folder in natural order (``2.png`` before ``10.png``), KITTI's ``training``, or a video.
    output
        The log to write.
    truth
        A folder of label images for a folder of images, paired by name.
    rate_hz
        Images a second. By default the times in the names or in the video are taken, else 10.

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
        packed = pack_messages(images, output, masks=truth, rate_hz=rate_hz)
    problem = describe(packed.path).problem if truth is not None else ""
    if not problem:
        return packed
    warning = Sentence("packed, but replay needs more settings: {}", problem)
    return replace(packed, warnings=(*packed.warnings, warning))


_PACKAGE: Final = Path(__file__).parents[1]
_PLACES: Final = (_PACKAGE / "demo.mcap", _PACKAGE.parent / "recordings" / "demo.mcap")
"""The places of the drive: in an installation, and in a checkout (see ``setup.py``)."""


def demo(output: AnyPath) -> Path:
    """Write the demo drive, which ships with roadeval, to a file.

    100 frames of 640x480 pixels at 10 Hz of a synthetic road, with the truth of road and shadow. A
    `RoadevalError` if it cannot be written.

    Examples
    --------
    >>> import roadeval
    >>> log = roadeval.demo("road.mcap")
    >>> [topic.name for topic in roadeval.info(log).topics]
    ['/camera/image', '/truth/road', '/truth/shadow']
    """
    path = Path(output)
    source = next((place for place in _PLACES if place.is_file()), None)
    if source is None:
        raise RoadevalError("this installation lacks the demo drive; install roadeval again")
    with holding(path), writing(path, RoadevalError):
        put(path, source.read_bytes())
    return path

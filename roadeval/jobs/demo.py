"""The demo drive that ships with roadeval."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from roadeval.errors import RoadevalError
from roadeval.jobs.outputs import holding
from roadeval.runtime.files import AnyPath, put

_PACKAGE: Final = Path(__file__).parents[1]
_PLACES: Final = (_PACKAGE / "demo.mcap", _PACKAGE.parent / "recordings" / "demo.mcap")
"""Where the drive is: in an installation, and in a checkout (see ``setup.py``)."""


def demo(output: AnyPath) -> Path:
    """Write the demo drive, which ships with roadeval, to a file.

    100 frames of 640x480 pixels at 10 Hz of a synthetic road, with the truth of road and shadow.

    Parameters
    ----------
    output
        The log to write.

    Returns
    -------
    Path
        The log.

    Raises
    ------
    RoadevalError
        If it cannot be written.

    Examples
    --------
    >>> import roadeval
    >>> log = roadeval.demo("road.mcap")
    >>> [topic.name for topic in roadeval.info(log).topics]
    ['/camera/image', '/truth/road', '/truth/shadow']
    """
    path = Path(output)
    source = next((each for each in _PLACES if each.is_file()), None)
    if source is None:
        raise RoadevalError("this installation lacks the demo drive; install roadeval again")
    with holding(path):
        try:
            put(path, source.read_bytes())
        except OSError as error:
            raise RoadevalError(f"{path}: cannot be written: {error.strerror}") from error
    return path

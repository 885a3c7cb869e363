"""What a label format is. All that a new one needs is a module in `roadeval.logs.truth.formats`."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from roadeval.logs.truth.drawn import Drawn, Size


@dataclass(frozen=True, slots=True)
class LabelFormat:
    """A kind of files that hold labels.

    `roadeval.logs.truth.beside` parses a file once by its ending: ``.json`` to lists and dicts,
    ``.xml`` to its root element, ``.txt`` to a text.
    """

    name: str
    """For people."""
    ending: str
    """Of its files, in lower case."""
    holds: Callable[[Path, Any], bool]
    """Whether a parsed file is of this format."""
    read: Callable[[Path, Any, Size | None], Iterable[Drawn]]
    """Return the label of each image in a parsed file of this format, given the size of the log's
    images. A `LogError` says what cannot be used; a KeyError, TypeError or ValueError means that
    the file is not as the format asks."""

"""The two streams: results on stdout, everything said to the person on stderr."""

from __future__ import annotations

import re
import sys
import textwrap
from typing import IO, TYPE_CHECKING, Any, Final, TextIO, cast

if TYPE_CHECKING:
    from rich.console import Console

_PADDING: Final = re.compile(r" +((?:\x1b\[0m)?\n)")


def diagnostics() -> Console:
    """Return a console on stderr, for progress, warnings and errors."""
    from rich.console import Console

    return Console(stderr=True, highlight=False, markup=False, emoji=False)


def results() -> Console:
    """Return a console on stdout, for what the user asked for."""
    from rich.console import Console

    out = cast("IO[str]", _Trimmed(sys.stdout))
    return Console(file=out, highlight=False, markup=False, emoji=False)


class _Trimmed:
    """A stream without the spaces at the ends of lines that tables and wrapped sentences leave."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        return self._stream.write(_PADDING.sub(r"\1", text))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def emit(text: str) -> None:
    """Write a line to stdout as it is, however long: for machines, and for paths to copy."""
    sys.stdout.write(f"{text}\n")


def wrapped(sentence: str, width: int, indent: int, hang: int = 0) -> str:
    """Wrap a sentence between words only, so that names and paths stay whole.

    ``indent`` is the left margin, ``hang`` what is added to it from the second line on.
    """
    return textwrap.fill(
        sentence,
        width,
        initial_indent=" " * indent,
        subsequent_indent=" " * (indent + hang),
        break_long_words=False,
        break_on_hyphens=False,
    )

"""The two streams: results on stdout, everything said to the person on stderr."""

from __future__ import annotations

import os
import re
import sys
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, TYPE_CHECKING, Any, Final, TextIO, cast

from roadeval.errors import RoadevalError
from roadeval.runtime.text import visible, visible_lines

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text

_PADDING: Final = re.compile(r" +((?:\x1b\[0m)?\n)")


class OutputError(RoadevalError):
    """Standard output cannot be written: it is closed, or on a full disk."""


def diagnostics() -> Console:
    """Return a console on stderr, for progress, warnings and errors."""
    from roadeval.cli.terminal import Terminal

    return Terminal()


def results() -> Console:
    """Return a console on stdout, for what the user asked for."""
    from roadeval.cli.terminal import Terminal

    return Terminal(cast("IO[str]", _Trimmed(sys.stdout)))


class _Trimmed:
    """A stream without the spaces at the ends of lines that tables and wrapped sentences leave."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        with _explained():
            return self._stream.write(_PADDING.sub(r"\1", text))

    def flush(self) -> None:
        with _explained():
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def emit(text: str) -> None:
    """Write lines to stdout, however long: for machines, and for paths to copy."""
    with _explained():
        sys.stdout.write(f"{visible_lines(text)}\n")


def flush() -> None:
    """Write what waits for stdout; an `OutputError` if that fails."""
    with _explained():
        sys.stdout.flush()


def drop() -> None:
    """Send nowhere what still waits for stdout: the interpreter flushes it as it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def wrapped(sentence: str, width: int, indent: int, hang: int = 0) -> Text:
    """Wrap a sentence between words only, so that names and paths stay whole.

    ``indent`` is the left margin, ``hang`` what is added to it from the second line on.
    """
    from rich.text import Text

    lines = textwrap.fill(
        visible(sentence),
        width,
        initial_indent=" " * indent,
        subsequent_indent=" " * (indent + hang),
        break_long_words=False,
        break_on_hyphens=False,
    )
    return Text(lines)


@contextmanager
def _explained() -> Iterator[None]:
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OutputError(f"standard output cannot be written: {error.strerror}") from error

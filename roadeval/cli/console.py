"""The two streams: results on stdout, messages to the person on stderr."""

from __future__ import annotations

import os
import re
import shutil
import sys
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Final, TextIO, cast

from roadeval.errors import RoadevalError
from roadeval.runtime.text import visible, visible_lines

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text

NARROWEST: Final = 20
STANDARD: Final = 80
"""Columns. No terminal is narrower than the first, whatever ``COLUMNS`` says; the second is taken
then."""
_PADDING: Final = re.compile(r" +((?:\x1b\[0m)?\n)")


class OutputError(RoadevalError):
    """Standard output cannot be written: it is closed, or on a full disk."""


def diagnostics() -> Console:
    """Return a console on stderr, for progress, warnings and errors."""
    return _terminal()


def results() -> Console:
    """Return a console on stdout, for what the user asked for."""
    return _terminal(cast("IO[str]", _Trimmed(sys.stdout)))


def show_next(out: Console, *commands: str) -> None:
    """Print commands to type next; each names a program as it can be typed here."""
    for command in commands:
        name, _, rest = command.partition(" ")
        beside = Path(sys.executable).with_name(name)
        if shutil.which(name) is None and beside.exists():
            name = os.path.relpath(beside) if beside.is_relative_to(Path.cwd()) else str(beside)
        out.print(f"next       {name} {rest}", soft_wrap=True)


def _terminal(file: IO[str] | None = None) -> Console:
    """Return Rich's console on a stream, standard error by default, with every string escaped.

    A `Text` is not escaped: only the program itself makes one.
    """
    from rich.console import Console

    class Terminal(Console):
        def render_str(self, text: str, **options: Any) -> Text:
            return super().render_str(visible(text), **options)

    made = Terminal(file=file, stderr=file is None, highlight=False, markup=False, emoji=False)
    if made.width < NARROWEST:
        made.width = STANDARD
    return made


class _Trimmed:
    """A stream that drops the spaces at the ends of lines, which tables and sentences leave."""

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
    """Write lines to stdout without wrapping: for machines, and for paths to copy."""
    with _explained():
        sys.stdout.write(f"{visible_lines(text)}\n")


def flush() -> None:
    """Flush stdout; an `OutputError` if that fails."""
    with _explained():
        sys.stdout.flush()


def drop() -> None:
    """Drop what is still buffered for stdout: the interpreter would flush it at its end."""
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

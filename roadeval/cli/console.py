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
"""Columns. A terminal that claims fewer than `NARROWEST`, for example because of ``COLUMNS``, is
taken to have `STANDARD` columns."""
_PADDING: Final = re.compile(r" +((?:\x1b\[0m)?\n)")


class OutputError(RoadevalError):
    """Standard output cannot be written: it is closed, or on a full disk."""


def diagnostics() -> Console:
    """Return a console on stderr, for progress, warnings and errors."""
    return _terminal()


def results() -> Console:
    """Return a console on stdout, for the results of a command."""
    return _terminal(cast("IO[str]", _TrimmedStream(sys.stdout)))


def from_here(path: Path) -> Path:
    """Return a path as it can be typed here: relative if it lies in the current folder."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


def show_next(out: Console, *commands: str) -> None:
    """Print the commands to type next; each begins with a program as it can be called here."""
    for command in commands:
        name, _, rest = command.partition(" ")
        beside = Path(sys.executable).with_name(name)
        if shutil.which(name) is None and beside.exists():
            name = str(from_here(beside))
        out.print(f"next       {name} {rest}", soft_wrap=True)


def _terminal(file: IO[str] | None = None) -> Console:
    """Return Rich's console on a stream, by default stderr; it escapes every string.

    A `Text` is not escaped, because only the program itself makes one.
    """
    from rich.console import Console

    class Terminal(Console):
        def render_str(self, text: str, **options: Any) -> Text:
            return super().render_str(visible(text), **options)

    terminal = Terminal(file=file, stderr=file is None, highlight=False, markup=False, emoji=False)
    if terminal.width < NARROWEST:
        terminal.width = STANDARD
    return terminal


class _TrimmedStream:
    """A stream that drops spaces at the ends of lines, such as the padding of tables."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write a text without the spaces at the ends of its lines."""
        with _output_errors():
            return self._stream.write(_PADDING.sub(r"\1", text))

    def flush(self) -> None:
        """Write the buffered text."""
        with _output_errors():
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def emit(text: str) -> None:
    """Write lines to stdout without wrapping, for machines and for paths to copy."""
    with _output_errors():
        sys.stdout.write(f"{visible_lines(text)}\n")


def flush() -> None:
    """Flush stdout; an `OutputError` if that fails."""
    with _output_errors():
        sys.stdout.flush()


def drop() -> None:
    """Drop what is still buffered for stdout, which the interpreter would flush at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def wrap(sentence: str, width: int, indent: int, hang: int = 0) -> Text:
    """Wrap a sentence between words only, so that no name or path is broken.

    ``indent`` is the left margin; ``hang`` is added to it from the second line on.
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


def break_lines(sentence: str, out: Console) -> Text:
    """Break a sentence between words at a terminal, and nowhere in a file."""
    return wrap(sentence, out.width if out.is_terminal else sys.maxsize, 0, hang=4)


def say(sentence: str, out: Console | None = None) -> None:
    """Print a sentence, by default on stdout; at a terminal it breaks between words."""
    out = out or results()
    out.print(break_lines(sentence, out), soft_wrap=True)


@contextmanager
def _output_errors() -> Iterator[None]:
    """Turn an OSError inside the block into an `OutputError`; a broken pipe stays one."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OutputError(f"standard output cannot be written: {error.strerror}") from error

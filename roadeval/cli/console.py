"""The two streams: results on stdout, everything said to the person on stderr."""

from __future__ import annotations

import sys
import textwrap
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console


def diagnostics() -> Console:
    """Return a console on stderr, for progress, warnings and errors."""
    from rich.console import Console

    return Console(stderr=True, highlight=False, markup=False, emoji=False)


def results() -> Console:
    """Return a console on stdout, for what the user asked for."""
    from rich.console import Console

    return Console(highlight=False, markup=False, emoji=False)


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

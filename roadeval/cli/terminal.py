"""Rich's console, in which text from elsewhere can do no harm."""

from __future__ import annotations

from typing import IO, Any, Final

from rich.console import Console
from rich.text import Text

from roadeval.runtime.text import visible

NARROWEST: Final = 20
STANDARD: Final = 80
"""Columns. No terminal is narrower than the first, where somebody says so, as ``COLUMNS=0``: the
second is meant."""


class Terminal(Console):
    """A console that escapes every string; a `Text` is what the program itself has set.

    Parameters
    ----------
    file
        The stream; standard error if None.
    """

    def __init__(self, file: IO[str] | None = None) -> None:
        super().__init__(file=file, stderr=file is None, highlight=False, markup=False, emoji=False)
        if self.width < NARROWEST:
            self.width = STANDARD

    def render_str(self, text: str, **options: Any) -> Text:
        """Make a `Text` of a string, as of a table's cell, a column's title or a line."""
        return super().render_str(visible(text), **options)

"""What an option of the command line is, and how the words after it are read."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

import typer


def color(text: str) -> tuple[int, ...]:
    """Read ``R,G,B``, 0..255 each."""
    parts = text.split(",")
    if len(parts) != 3 or not all(part.strip().isdecimal() for part in parts):
        raise typer.BadParameter(f"{text!r} is not R,G,B (as 128,64,128)")
    return tuple(int(part) for part in parts)


def named(text: str) -> tuple[str, str]:
    """Read ``NAME=VALUE``."""
    name, _, value = text.partition("=")
    if not name or not value:
        raise typer.BadParameter(f"{text!r} is not NAME=...")
    return name, value


def variant(text: str) -> tuple[str, str | None]:
    """Read ``NAME=FILE.toml`` or ``NAME=PRESET``, or the name of a preset alone."""
    return named(text) if "=" in text else (text, None)


@dataclass(frozen=True, slots=True)
class Option:
    """An option of the command line that gives a setting its value.

    Parameters
    ----------
    setting
        ``table.key`` in a run's configuration; ``preset``, ``config``, ``variants``, ``nets``,
        ``masks`` and ``drives`` are read by `roadeval.cli.arguments`.
    flags
        As they are typed; the last one is named in messages.
    metavar
        Stands for the value in the help; none for a switch.
    help
        One line or two.
    kind
        The type of what is typed; a list for an option that can be repeated.
    read
        Turns a word of such a list into a value.
    """

    setting: str
    flags: tuple[str, ...]
    metavar: str | None
    help: str
    kind: Any = str
    read: Callable[[str], Any] | None = None

    @property
    def argument(self) -> str:
        """The name of the Python argument that receives the value."""
        return self.setting.replace(".", "_")

    def parameter(self) -> inspect.Parameter:
        """Return the parameter that Typer makes the option of."""
        # Whoever opens a file tells whether it can be read, as of any other problem with it.
        option = typer.Option(
            *self.flags,
            metavar=self.metavar,
            show_default=False,
            help=self.help,
            readable=False,
        )
        return inspect.Parameter(
            self.argument,
            inspect.Parameter.KEYWORD_ONLY,
            default=None,
            annotation=Annotated[self.kind | None, option],
        )


def switch(setting: str, flag: str, text: str) -> Option:
    """Return an option without a value that turns a setting on."""
    return Option(setting, (flag,), None, text, bool)

"""Sentences for the person at the terminal: one line each, on stderr."""

from __future__ import annotations

from typing import Final

from roadeval.cli import console

PROGRAM: Final = "roadeval"


def error(sentence: object) -> None:
    """Say what went wrong: ``roadeval: error: ...``."""
    _say("error", "bold red", sentence)


def warning(sentence: object) -> None:
    """Say what the user should know although the work goes on: ``roadeval: warning: ...``."""
    _say("warning", "bold yellow", sentence)


def lost(sentence: object) -> None:
    """Say which part of a log could not be read: ``roadeval: lost: ...``."""
    _say("lost", "bold yellow", sentence)


def interrupted(sentence: object) -> None:
    """Say what is left after a signal: ``roadeval: interrupted: ...``."""
    _say("interrupted", "bold yellow", sentence)


def one_line(sentence: object) -> str:
    """Join the lines of a message, so that a script can count on one line a message."""
    return " ".join(line.strip() for line in str(sentence).splitlines())


def _say(kind: str, style: str, sentence: object) -> None:
    from rich.text import Text

    line = Text.assemble(f"{PROGRAM}: ", (f"{kind}:", style), " ", one_line(sentence))
    console.diagnostics().print(line, soft_wrap=True)

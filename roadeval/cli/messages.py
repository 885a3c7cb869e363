"""Messages to the person at the terminal: one line each, on stderr."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Final

from roadeval import kernels
from roadeval.cli import console
from roadeval.cli.exit_codes import ExitCode
from roadeval.cli.options import with_flags
from roadeval.runtime.text import debug, visible, visible_lines, without_secrets

if TYPE_CHECKING:
    from roadeval.evaluation.comparison.conditions import Judgement

PROGRAM: Final = "roadeval"


def error(sentence: str, draft: str = "") -> None:
    """Write an error, ``roadeval: error: ...``, and below it a draft of a file that solves it."""
    _write("error", "bold red", sentence)
    if draft:
        sys.stderr.write(f"\n{visible_lines(draft)}\n")


def warning(*sentences: str) -> None:
    """Write warnings: ``roadeval: warning: ...``."""
    for sentence in sentences:
        _write("warning", "bold yellow", sentence)


def note(sentence: str) -> None:
    """Write a note, such as on work that takes long: ``roadeval: note: ...``."""
    _write("note", "bold", sentence)


def losses(sentences: Sequence[str]) -> ExitCode:
    """Write which parts of a log were lost, ``roadeval: lost: ...``, and return the exit code."""
    for sentence in sentences:
        _write("lost", "bold yellow", sentence)
    return ExitCode.LOSS if sentences else ExitCode.DONE


def conditions(judgements: Iterable[Judgement]) -> ExitCode:
    """Write which conditions hold and which could not be judged; return the exit code."""
    from roadeval.results.comparison import describe_judgement

    codes = [ExitCode.DONE]
    for judgement in judgements:
        if judgement.holds is not False:
            exceeded = "limit exceeded: " if judgement.holds else ""
            error(f"{exceeded}{describe_judgement(judgement)}")
            codes.append(ExitCode.CONDITION_HELD if judgement.holds else ExitCode.FAILED)
    return max(codes)


def traceback(text: str) -> None:
    """Write a traceback, if ``ROADEVAL_DEBUG`` asks for it."""
    if debug():
        sys.stderr.write(visible_lines(text))


def warn_of_missing_loops() -> None:
    """Warn if frames take long because the package was installed without its compiled loops."""
    if kernels.missing():
        warning(
            "the compiled loops are missing, so a frame takes several times as long: there was no "
            "C compiler when roadeval was installed, or the build is outdated; reinstall roadeval"
        )


def interruption(sentence: str) -> None:
    """Write that a signal ended the command: ``roadeval: interrupted: ...``."""
    _write("interrupted", "bold yellow", sentence)


def _write(kind: str, style: str, sentence: str) -> None:
    """Write a line on stderr, with settings named by their flags."""
    text = visible(without_secrets(with_flags(sentence)))
    try:
        stderr = console.diagnostics()
        shown = console.break_lines(f"{PROGRAM}: {kind}: {text}", stderr)
        begin = len(PROGRAM) + 2
        shown.stylize(style, begin, begin + len(kind) + 1)
        stderr.print(shown, soft_wrap=True)
    except (ImportError, MemoryError):
        # Rich cannot be loaded, for example because memory is short.
        sys.stderr.write(f"{PROGRAM}: {kind}: {text}\n")

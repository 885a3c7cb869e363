"""The command line: its commands, and the place where errors become messages."""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Callable, Sequence
from typing import Annotated

import typer

from roadeval.cli import commands, messages, signals
from roadeval.cli.exit_codes import ExitCode
from roadeval.cli.options import with_flags
from roadeval.errors import RoadevalError
from roadeval.runtime.discovery import found_in

FIRST = ("replay", "report", "inspect", "compare", "info", "train", "config", "pack", "demo")
"""The order of the commands in the help; others follow by their names."""

app = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _place(command: Callable[..., int]) -> int:
    """Return the place of a command in the help."""
    name = command.__name__
    return FIRST.index(name) if name in FIRST else len(FIRST)


for _command in sorted(found_in(commands, "COMMAND"), key=_place):
    app.command()(_command)


def _show_version(wanted: bool) -> None:
    if wanted:
        from roadeval.cli import console
        from roadeval.version import VERSION

        console.emit(f"{messages.PROGRAM} {VERSION}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    _version: Annotated[
        bool,
        typer.Option("--version", is_eager=True, callback=_show_version, help="Show the version."),
    ] = False,
) -> None:
    """Flight recorder and scoreboard for road recognition.

    Exit codes: 0 done; 1 a file cannot be used; 2 wrong usage; 3 done, but part of the log was
    lost; 4 a --fail-if condition held; 70 a defect of the program; 130, 143 interrupted.
    """
    if context.invoked_subcommand is None:
        typer.echo(context.get_help(), err=True)
        raise typer.Exit(ExitCode.USAGE)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Parameters
    ----------
    arguments
        Words after the program's name; those of the process if None.
    """
    try:
        with signals.raised():
            code = app(args=arguments, prog_name=messages.PROGRAM, standalone_mode=False)
            sys.stdout.flush()
            return int(code or ExitCode.DONE)
    except (Exception, SystemExit) as error:
        return explain(error)


def explain(error: Exception | SystemExit) -> int:
    """Write in one line what ended the command, and return the exit code for it.

    With ``ROADEVAL_DEBUG=1`` in the environment the traceback stands above the line.
    """
    if os.environ.get("ROADEVAL_DEBUG") == "1":
        traceback.print_exception(error)
    match error:
        case signals.Stopped():
            messages.interrupted(_with_notes("stopped before the end", error))
            return error.exit_code
        case typer.TyperException():
            messages.error(_usage(error))
            return error.exit_code
        case RoadevalError():
            messages.error(with_flags(_with_notes(str(error), error)))
            return ExitCode.FAILED
        case BrokenPipeError() | SystemExit(__context__=BrokenPipeError()):
            _drop_stdout()
            return ExitCode.BROKEN_PIPE
        case OSError(strerror=str(reason)):
            where = f": {error.filename}" if error.filename else ""
            messages.error(_with_notes(f"{reason}{where}", error))
            return ExitCode.FAILED
        case _:
            defect = (
                f"{type(error).__name__}: {error} (a defect of {messages.PROGRAM}, not of your "
                "input: run again with ROADEVAL_DEBUG=1 to see where, and please report it)"
            )
            messages.error(_with_notes(defect, error))
            return ExitCode.DEFECT


def _with_notes(sentence: str, error: BaseException) -> str:
    """Add what the rooms noted on an error on its way out, as where a partial output lies."""
    return "; ".join([sentence, *getattr(error, "__notes__", ())])


def _usage(error: typer.TyperException) -> str:
    sentence = error.format_message().replace("Value error, ", "").rstrip(".")
    # Where options do not go together, no single one's value is the invalid one.
    sentence = sentence.removeprefix("Invalid value: ")
    context = getattr(error, "ctx", None)
    return f"{sentence}; see '{context.command_path} --help'" if context else sentence


def _drop_stdout() -> None:
    """Send what is still buffered nowhere: the interpreter flushes stdout as it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())

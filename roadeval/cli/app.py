"""The command line: its commands, and the place where errors become messages."""

from __future__ import annotations

import gc
import os
import re
import traceback
from collections.abc import Sequence
from importlib import import_module
from pkgutil import iter_modules
from typing import Annotated, Any, Final

import typer
from typer.core import TyperCommand

from roadeval.cli import commands, console, messages, signals, streams
from roadeval.cli.exit_codes import ExitCode
from roadeval.errors import RoadevalError
from roadeval.runtime import memory
from roadeval.runtime.sentence import Sentence
from roadeval.runtime.text import debug, defect

FIRST: Final = (
    *("replay", "fleet", "report", "inspect", "compare"),
    *("pick", "info", "train", "config", "pack", "demo"),
)
"""The order of the commands in the help; others follow by their names."""
COLLECT_EVERY: Final = 400_000
"""New objects between two searches for cycles. The imports of a run make some 300,000, nearly all
of which stay; with Python's own threshold the searches take a sixth of a short run."""
THREADS: Final = {"OPENBLAS_NUM_THREADS", "GOTO_NUM_THREADS", "OMP_NUM_THREADS"}
"""The variables that OpenBLAS reads, in its order."""
_NO_NUMBER: Final = re.compile(r"Input should be a valid (number|integer), .*")
_NUMBERS: Final = {"number": "number, as 0.5", "integer": "whole number"}

app = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


class Command(TyperCommand):
    """A command whose help shows the options part by part."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments and options, each part below its title."""
        parts: dict[str, list[tuple[str, str]]] = {}
        for param in self.get_params(ctx):
            if record := param.get_help_record(ctx):
                own = "Arguments" if param.param_type_name == "argument" else "Options"
                part = getattr(param, "rich_help_panel", None) or own
                parts.setdefault(part, []).append(record)
        for part, records in parts.items():
            with formatter.section(part):
                formatter.write_dl(records)


_others = sorted({module.name for module in iter_modules(commands.__path__)} - {*FIRST})
for _name in (*FIRST, *_others):
    # A command is the function that bears its file's name.
    app.command(cls=Command)(getattr(import_module(f"{commands.__name__}.{_name}"), _name))


def _show_version(wanted: bool) -> None:
    if wanted:
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
    """Run the words after the program's name, by default the process', and return the exit code."""
    if arguments is not None:
        return _run(arguments)
    streams.take_over(debug=debug())
    gc.set_threshold(COLLECT_EVERY)
    # NumPy and SciPy bring an OpenBLAS each, whose threads spin for a twentieth of a second of a
    # core before they first sleep, and reserve 40 MB of addresses each. No matrix here needs them.
    if not THREADS & os.environ.keys():
        os.environ["OPENBLAS_NUM_THREADS"] = "1"
    code = _run(None)
    gc.freeze()  # no search for cycles at the end, when the system frees all at once
    return code


def _run(arguments: Sequence[str] | None) -> int:
    try:
        with signals.raised():
            code = app(args=arguments, prog_name=messages.PROGRAM, standalone_mode=False)
            console.flush()
            return int(code or ExitCode.DONE)
    except BaseException as error:
        return explain(error)


def explain(error: BaseException) -> int:
    """Write why the command ended, in one line, and return its exit code.

    With ``ROADEVAL_DEBUG=1`` in the environment the traceback comes first.
    """
    messages.traceback("".join(traceback.format_exception(error)))
    match error:
        case signals.Stopped() | KeyboardInterrupt():
            messages.interrupted(_with_notes("stopped before the end", error))
            return getattr(error, "exit_code", ExitCode.INTERRUPTED)
        case typer.TyperException():
            messages.error(_usage(error))
            return error.exit_code
        case BrokenPipeError() | SystemExit(__context__=BrokenPipeError()):
            console.drop()
            return ExitCode.BROKEN_PIPE
    known, sentence = _known(error)
    messages.error(_with_notes(sentence, error))
    if isinstance(error, console.OutputError):
        console.drop()
    return ExitCode.FAILED if known else ExitCode.DEFECT


def _known(error: BaseException) -> tuple[bool, str]:
    """Return whether the user can mend an error, and the message."""
    match error:
        case RoadevalError():
            return True, error.sentence
        case OSError(strerror=str(reason)):
            return True, f"{reason}: {error.filename}" if error.filename else reason
        case _ if memory.is_lacking(error):
            return True, memory.LACKING
        case _:
            return False, defect(error)


def _with_notes(sentence: str, error: BaseException) -> str:
    """Add the notes of an error, as the place of a partial output."""
    return Sentence("; ").join([sentence, *getattr(error, "__notes__", ())])


def _usage(error: typer.TyperException) -> str:
    sentence = error.format_message().replace("Value error, ", "").rstrip(".")
    # No single value is invalid where options do not go together.
    sentence = sentence.removeprefix("Invalid value: ")
    sentence = _NO_NUMBER.sub(lambda found: f"must be a {_NUMBERS[found[1]]}", sentence)
    context = getattr(error, "ctx", None)
    sentence = " ".join(line.strip() for line in sentence.splitlines())
    return f"{sentence}; see '{context.command_path} --help'" if context else sentence

"""The command line: its commands, and messages about errors."""

from __future__ import annotations

import gc
import os
import traceback
from collections.abc import Sequence
from importlib import import_module
from pkgutil import iter_modules
from typing import Annotated, Final, cast

import typer

from roadeval.cli import commands, console, messages, signals, streams
from roadeval.cli.exit_codes import ExitCode
from roadeval.cli.help import WIDEST, GroupedCommand, Program
from roadeval.errors import RoadevalError
from roadeval.runtime import discovery, memory
from roadeval.runtime.sentence import Sentence
from roadeval.runtime.text import debug, defect, likely

FIRST: Final = (
    *("replay", "fleet", "report", "inspect", "clip", "compare", "history"),
    *("pick", "audit", "info", "train", "config", "pack", "demo"),
)
"""The order of the commands in the help; others follow by name."""
COLLECT_EVERY: Final = 400_000
"""New objects between two searches for cycles. The imports of a run make some 300,000, nearly all
of which stay; with Python's own threshold the searches take a sixth of a short run."""
THREADS: Final = {"OPENBLAS_NUM_THREADS", "GOTO_NUM_THREADS", "OMP_NUM_THREADS"}
"""The variables that OpenBLAS reads, in its order."""

app = typer.Typer(
    cls=Program,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": WIDEST},
)

_others = sorted({module.name for module in iter_modules(commands.__path__)} - {*FIRST})
for _name in (*FIRST, *_others):
    # A command is the function that has the name of its file.
    _module = import_module(f"{commands.__name__}.{_name}")
    app.command(cls=GroupedCommand)(getattr(_module, _name))


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Show the version.")] = False,
) -> None:
    """Flight recorder and scoreboard for road recognition."""
    if version:
        from roadeval.version import VERSION

        console.emit(f"{messages.PROGRAM} {VERSION}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        formatter = context.make_formatter()
        cast("Program", context.command).format_start(context, formatter)
        typer.echo(formatter.getvalue().rstrip(), err=True)
        raise typer.Exit(ExitCode.USAGE)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return the exit code; the arguments are the process's by default."""
    if arguments is not None:
        return _run(arguments)
    streams.take_over(debug=debug())
    gc.set_threshold(COLLECT_EVERY)
    # NumPy and SciPy each load an OpenBLAS. Its threads use a core for a twentieth of a second
    # before they first sleep, and each reserves 40 MB of addresses. No matrix here needs them.
    if not THREADS & os.environ.keys():
        os.environ["OPENBLAS_NUM_THREADS"] = "1"
    code = _run(None)
    gc.freeze()  # the system frees all memory at the end, so no search for cycles is needed
    return code


def _run(arguments: Sequence[str] | None) -> int:
    try:
        with signals.as_exceptions():
            code = app(args=arguments, prog_name=messages.PROGRAM, standalone_mode=False)
            console.flush()
            return int(code or ExitCode.DONE)
    except BaseException as error:
        return explain(error)


def explain(error: BaseException) -> int:
    """Write in one line why the command ended, and a draft that helps; return the exit code.

    With ``ROADEVAL_DEBUG=1`` in the environment, the traceback comes first.
    """
    messages.traceback("".join(traceback.format_exception(error)))
    sentence: str
    match error:
        case signals.Stopped() | KeyboardInterrupt():
            messages.interruption(_with_notes("stopped before the end", error))
            return getattr(error, "exit_code", ExitCode.INTERRUPTED)
        case typer.TyperException():
            messages.error(_usage_message(error))
            return error.exit_code
        case BrokenPipeError() | SystemExit(__context__=BrokenPipeError()):
            console.drop()
            return ExitCode.BROKEN_PIPE
        case SystemExit(code=int(code)):
            return code  # as Typer's completion ends
        case RoadevalError():
            code, sentence = ExitCode.FAILED, error.sentence
        case OSError(strerror=str(reason)):
            code = ExitCode.FAILED
            sentence = f"{reason}: {error.filename}" if error.filename else reason
        case _ if sentence := _fault_of_a_package(error):
            code = ExitCode.FAILED
        case _ if memory.is_lacking(error):
            code, sentence = ExitCode.FAILED, memory.NOT_ENOUGH
        case _:
            code, sentence = ExitCode.DEFECT, defect(error)
    messages.error(_with_notes(sentence, error), getattr(error, "draft", ""))
    if isinstance(error, console.OutputError):
        console.drop()
    return code


def _fault_of_a_package(error: BaseException) -> str:
    """Return a sentence if a package from outside fails or is missing; else an empty text."""
    if isinstance(error, ModuleNotFoundError) and not f"{error.name}".startswith("roadeval"):
        return f"{error.name} is not installed: install roadeval with all that it depends on"
    package = discovery.failed_package(error)
    return f"the package {package} failed: {discovery.one_line(error)}" if package else ""


def _with_notes(sentence: str, error: BaseException) -> str:
    """Return a sentence with the notes of an error, such as the path of a partial output."""
    return Sentence("; ").join([sentence, *getattr(error, "__notes__", ())])


def _usage_message(error: typer.TyperException) -> str:
    from pydantic import ValidationError

    from roadeval.config.tables import describe_problem

    if isinstance(error.__cause__, ValidationError):
        error.message = describe_problem(error.__cause__.errors()[0])
    # If options do not go together, no single parameter is wrong.
    is_alone = isinstance(error, typer.BadParameter) and error.param is None
    # For an unknown option Typer guesses none that begins like it, so the guess is made here.
    is_unknown = hasattr(error, "possibilities")
    text = error.message if is_alone or is_unknown else error.format_message()
    sentence = " ".join(text.split()).rstrip(".")
    context = getattr(error, "ctx", None)
    if context is None:
        return sentence
    flags = [flag for param in context.command.get_params(context) for flag in param.opts]
    meant = likely(str(getattr(error, "option_name", "")), flags) if is_unknown else ""
    return f"{sentence}; {meant}see '{context.command_path} --help'".replace("?;", "?")

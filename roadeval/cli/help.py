"""The texts of ``--help``: examples first, options group by group, exit codes last."""

from __future__ import annotations

import re
import textwrap
from typing import Any, Final

from typer.core import TyperCommand, TyperGroup

from roadeval.cli.options import MOST_USED

WIDEST: Final = 160
"""Greatest number of columns of a help text, because longer lines are hard to read."""
FLAGS_WIDTH: Final = 27
"""Columns for flags; the meaning of a longer one begins on the next line."""
START: Final = (
    ("roadeval demo -o demo.mcap", "a drive with truth that ships"),
    ("roadeval replay demo.mcap --save demo.rrd", "verdict, tables, figures"),
    ("roadeval report demo.rrd -o demo.html", "a page to browse"),
)
"""The first commands of a new user, and what they produce."""
READ_ON: Final = "Read on: 'roadeval COMMAND --help', README.md, and docs/tutorial.md."
EXIT_CODES: Final = (
    "Exit codes: 0 done; 1 a file cannot be used; 2 wrong usage; 3 done, but part of a log is "
    "lost; 4 a --fail-if held; 70 a defect; 130, 143 interrupted."
)


class Program(TyperGroup):
    """The program; its help begins with commands to copy."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the whole help."""
        self.format_start(ctx, formatter, with_options=True)

    def format_start(self, ctx: Any, formatter: Any, *, with_options: bool = False) -> None:
        """Write what to type first, the commands, and where to read on.

        Without options it fits a screen of 24 lines.
        """
        with formatter.section(f"{self.help} Start here"):
            formatter.write_dl(START, WIDEST)
        self.format_commands(ctx, formatter)
        if with_options:
            _write_groups(self, ctx, formatter)
            formatter.write_paragraph()
        formatter.write_text(READ_ON)
        formatter.write_text(EXIT_CODES)


class GroupedCommand(TyperCommand):
    """A command; its docstring has a line, indented examples, and explanations."""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Return the placeholders of the options and of each argument."""
        arguments = [p for p in self.get_params(ctx) if p.param_type_name == "argument"]
        return ["[OPTIONS]", *(str(argument.metavar) for argument in arguments)]

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write what the command does, examples, the options, explanations, and exit codes."""
        line, examples, *explanations = str(self.help).split("\n\n")
        self.format_usage(ctx, formatter)
        formatter.write_paragraph()
        with formatter.indentation():
            formatter.write_text(f"{line}\n\n\b\n{textwrap.dedent(examples)}")
        _write_groups(self, ctx, formatter)
        formatter.write_paragraph()
        with formatter.indentation():
            formatter.write_text("\n\n".join([*explanations, EXIT_CODES]))


def _write_groups(command: Any, ctx: Any, formatter: Any) -> None:
    """Write arguments and options, each group below its title."""
    groups: dict[str, list[tuple[str, str]]] = {}
    for param in command.get_params(ctx):
        if record := param.get_help_record(ctx):
            flags, meaning = record
            group = getattr(param, "rich_help_panel", None) or "Options"
            if param.param_type_name == "argument":
                group, flags = "Arguments", param.metavar
            # Each name in a meaning, such as the name of a preset, has a line of its own.
            lines, names = re.subn(r"; (?=\w+: )", "\n", meaning)
            groups.setdefault(group, []).append((flags, f"\b\n{lines}" if names > 1 else meaning))
    if MOST_USED in groups:
        groups = {MOST_USED: groups.pop("Arguments", []) + groups.pop(MOST_USED)} | groups
    for group, records in groups.items():
        with formatter.section(group):
            formatter.write_dl(records, FLAGS_WIDTH)

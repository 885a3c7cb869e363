"""What the pages take from the code: ``python docs/generated.py`` writes it between their marks.

A mark is ``<!-- generated exit_codes: ... -->``; what it names ends at ``<!-- end -->``. The site
also takes pages from other files of the project, and adds the links that only it can have. The
schemas and the requirements of a gate are written as well.
"""

from __future__ import annotations

import os
import re
import runpy
import textwrap
import tomllib
from collections.abc import Callable, Iterable, Iterator
from inspect import getdoc, getsource
from pathlib import Path
from typing import Any, Final

import typer.main

import roadeval
from roadeval.cli.app import app
from roadeval.cli.exit_codes import ExitCode
from roadeval.config.variants import PRESETS
from roadeval.evaluation.metrics import METRICS
from roadeval.results import schema

DOCS: Final = Path(__file__).resolve().parent
ROOT: Final = DOCS.parent
COPIES: Final = {
    "contributing": ROOT / "CONTRIBUTING.md",
    "changelog": ROOT / "CHANGELOG.md",
    "explanation/measured": ROOT / "benchmarks" / "PRESETS.md",
    "explanation/intervals": ROOT / "benchmarks" / "INTERVALS.md",
    "explanation/benchmarks": ROOT / "benchmarks" / "README.md",
}
"""Pages that are a file elsewhere in the project, by their names on the site."""
PAGES: Final = {path: DOCS / f"{name}.md" for name, path in COPIES.items()}
LINK: Final = re.compile(r"(!?)\[([^\]]+)\]\((?!https?:|#)([^)#\s]+)(#[^)\s]*)?\)")
COMMENT: Final = re.compile(r"(^# (?!\w+ =).*\n)+", re.MULTILINE)
"""The meaning of a setting; a setting without a value is none."""
END: Final = "<!-- end -->"
BLOCK: Final = re.compile(rf"^<!-- generated (\w+):[^\n]*-->\n.*?^{END}$", re.DOTALL | re.MULTILINE)
PUBLIC: Final = re.compile(r"^\| `(\w+)` \|", re.MULTILINE)
"""A name in the table of `python`."""


def written(text: str) -> str:
    """Return a page's text with everything between marks made anew."""
    return BLOCK.sub(lambda block: _between_marks(block[1]), text)


def _between_marks(name: str) -> str:
    made = GENERATED[name]().strip()
    return f"<!-- generated {name}: python docs/generated.py -->\n\n{made}\n\n{END}"


def page(name: str, text: str) -> str:
    """Return a page's text as the site shows it."""
    path = COPIES.get(name, DOCS / f"{name}.md")
    text = path.read_text(encoding="utf-8") if name in COPIES else text
    here = (DOCS / name).parent
    if name == "reference/python":
        text = PUBLIC.sub(r'| <a href="../api/roadeval.html#\1"><code>\1</code></a> |', text)
    return LINK.sub(lambda link: _linked(link, path.parent, here), text)


def _linked(link: re.Match[str], origin: Path, here: Path) -> str:
    """Lead a link to a page of the site; of one to a source file the words remain.

    ``origin`` is the folder of the file that the link is written in, ``here`` that of its page.
    """
    picture, words, target, place = link.groups(default="")
    path = Path(os.path.normpath(origin / target))
    path = PAGES.get(path, path)
    if picture or (path.suffix == ".md" and path.is_relative_to(DOCS)):
        return f"{picture}[{words}]({os.path.relpath(path, here)}{place})"
    return words


# --- The command line -----------------------------------------------------------------------------


def commands() -> str:
    """Return every command with its arguments and options, as ``--help`` prints them."""
    group: Any = typer.main.get_command(app)
    return "\n".join(line for name in group.commands for line in _command(group, name))


def _command(group: Any, name: str) -> Iterator[str]:
    command = group.commands[name]
    context = command.make_context(name, [], resilient_parsing=True)
    text, examples, *others = command.help.split("\n\n")
    shown = f"```console\n{textwrap.dedent(examples)}\n```"
    yield from (f"## {name}", "", "\n\n".join([_plain(text), shown, *map(_plain, others)]), "")
    part = ""
    for param in command.get_params(context):
        flags, words = param.get_help_record(context) or ("", "")
        of = getattr(param, "rich_help_panel", None) or "Options"
        if param.param_type_name == "argument":
            of, flags = "Arguments", param.metavar
        if of != part:
            yield from ("", f"| {of} | |", "| --- | --- |")
        part = of
        yield f"| {_code(flags)} | {_cell(_plain(words))} |"
    yield ""


def _code(text: str) -> str:
    return f"`{_cell(text)}`"


def _plain(text: str) -> str:
    """Let a text of the terminal mean nothing to Markdown."""
    return re.sub(r"([<*_`\[])", r"\\\1", text)


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", r"\|")


def exit_codes() -> str:
    """Return the exit codes with their meaning."""
    described = re.findall(r' = (\d+)\n    """(.*?)"""', getsource(ExitCode), re.DOTALL)
    assert len(described) == len(ExitCode)
    return _table(("code", "meaning"), described)


# --- Settings -------------------------------------------------------------------------------------


def settings() -> str:
    """Return every setting of every preset, in the form of ``roadeval config``."""
    tables: dict[str, str] = {}
    for preset in PRESETS:
        text = roadeval.config_toml(roadeval.configure({"preset": preset}))
        text = COMMENT.sub(_narrow, text)
        for part in re.split(r"\n\n(?=(?:#[^\n]*\n)*\[)", text):
            head = re.search(r"^\[(.+)\]$", part, re.MULTILINE)
            tables.setdefault(head[1] if head else "", part.strip())
    first = tables.pop("")
    parts = {"At the top": first, **{f"\\[{name}\\]": part for name, part in tables.items()}}
    return "\n".join(f"## {name}\n\n```toml\n{part}\n```\n" for name, part in parts.items())


def _narrow(comment: re.Match[str]) -> str:
    """Return a comment in lines that fit the page."""
    words = comment[0].replace("\n# ", " ").removeprefix("# ")
    return textwrap.fill(words, 80, initial_indent="# ", subsequent_indent="# ") + "\n"


# --- Packages -------------------------------------------------------------------------------------


NOT_OF_A_GATE: Final = {"av", "dask", "distributed", "matplotlib", "rerun-sdk", "typst"}
"""What `replay` without a recording and `compare` do without: video, fleets, figures, PDF."""


def gate() -> str:
    """Return the requirements of a job that replays without a recording, and compares."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    names = ((line, re.split("[<>=]", line)[0]) for line in project["dependencies"])
    return "".join(f"{line}\n" for line, name in names if name not in NOT_OF_A_GATE)


# --- Results --------------------------------------------------------------------------------------


def tables_of_a_drive() -> str:
    """Return the tables of a drive with their columns."""
    return documentation(schema.OF_A_DRIVE, "csv")


def tables_of_a_fleet() -> str:
    """Return the tables of a fleet with their columns."""
    return documentation((*schema.OF_DRIVES, "frames"), "parquet")


def documentation(tables: Iterable[str], ending: str) -> str:
    """Return the documentation of tables in files of an ending, in Markdown."""
    parts = []
    for table in (schema.TABLES[name] for name in tables):
        columns = (*table.columns, *(table.of_a_fleet if ending == "parquet" else ()))
        parts += [f"### {table.name}.{ending}", "", table.doc, ""]
        parts += ["| column | holds | unit | meaning |", "| --- | --- | --- | --- |"]
        parts += [f"| `{c.name}` | {c.kind} | {c.unit} | {c.doc} |" for c in columns]
        parts.append("")
    return "\n".join(parts)


def rates() -> str:
    """Return the rates with their formulas."""
    rows = ((name, each.title, f"`{each.formula}`") for name, each in METRICS.items())
    return _table(("rate", "meaning", "formula"), rows)


# --- Python ---------------------------------------------------------------------------------------


def python() -> str:
    """Return the public names with the first sentence of each."""
    return _table(("name", "what it is"), map(_name, roadeval.__all__))


def _name(name: str) -> tuple[str, str]:
    first = (getdoc(getattr(roadeval, name)) or "").partition("\n\n")[0]
    return _code(name), first


# --- Findings -------------------------------------------------------------------------------------


def findings() -> str:
    """Return the software that each finding is about, in order, and its first sentence."""
    rows = []
    for path in sorted((ROOT / "findings").glob("*.sh")):
        header, _, _ = path.read_text(encoding="utf-8").partition("\nset -")
        comment = header.replace("#!/usr/bin/env bash\n", "").replace("#", "")
        first, software, *_ = (" ".join(part.split()) for part in comment.split("\n\n"))
        link = f"[{path.stem}](../../findings/{path.name})"
        rows.append((software.removeprefix("Software: "), first, link))
    rows.sort(key=lambda row: row[0].casefold())
    return _table(("software", "what it does", "shown by"), rows)


def _table(head: tuple[str, ...], rows: Any) -> str:
    lines = [head, ("---",) * len(head), *rows]
    return "\n".join(f"| {' | '.join(map(_cell, line))} |" for line in lines)


GENERATED: Final[dict[str, Callable[[], str]]] = {
    "commands": commands,
    "exit_codes": exit_codes,
    "settings": settings,
    "tables_of_a_drive": tables_of_a_drive,
    "tables_of_a_fleet": tables_of_a_fleet,
    "rates": rates,
    "python": python,
    "findings": findings,
}
"""What stands between marks, by the name in the first of them."""


if __name__ == "__main__":
    runpy.run_path(str(DOCS / "schemas.py"))["write"]()
    (DOCS / "gate.txt").write_text(gate(), encoding="utf-8")
    for path in DOCS.rglob("*.md"):
        path.write_text(written(path.read_text(encoding="utf-8")), encoding="utf-8")

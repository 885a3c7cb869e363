"""What people read, word for word.

``python -m pytest tests/golden --write-golden`` writes the expected texts anew: then look at the
difference that git shows, line by line, before it is committed.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable
from typing import Final

import pytest

from tests.golden import texts
from tests.golden.commands import COMMANDS, Told
from tests.golden.masks import steady, steady_json

ROWS: Final = 9
"""Rows of each table that are shown."""


def printed(told: Told, name: str) -> str:
    """What a command printed, and its exit code."""
    text = told.texts[name]
    parts = [f"$ roadeval {COMMANDS[name]}", f"=== exit code {text['code']}"]
    for stream in ("out", "err"):
        # What machines read is compared with the file of the same content.
        shown = "(JSON)" if text[stream].startswith("{") else text[stream]
        parts += [f"=== {stream}\n{shown}"] if shown else []
    return "\n".join(parts)


def tables(told: Told) -> str:
    """The header and the first rows of every table, with floats as the files have them."""
    parts = []
    for path in sorted((told.folder / "paper").glob("*.csv")):
        head, *rows = path.read_text(encoding="utf-8").splitlines()
        parts += [f"=== {path.name}: {len(rows)} rows", head, *rows[:ROWS]]
    return "\n".join(parts)


def figures(told: Told) -> str:
    """The words of the figures' files."""
    paths = sorted(
        path for run in ("paper", "printed") for path in (told.folder / run).glob("fig*.pdf")
    )
    return "".join(f"=== {p.parent.name}/{p.name}\n{texts.pages(p)[0]}\n" for p in paths)


GOLDEN: Final[dict[str, Callable[[Told], str]]] = {
    **{f"{name}.txt": lambda told, name=name: steady(printed(told, name)) for name in COMMANDS},
    "summary.json": lambda told: steady_json((told.folder / "paper" / "summary.json").read_text()),
    "compared.md": lambda told: steady((told.folder / "compared.md").read_text()),
    "variants.md": lambda told: steady((told.folder / "variants.md").read_text()),
    "report.pdf.txt": lambda told: steady(texts.paged(told.folder / "paper.pdf")),
    "report_folder.pdf.txt": lambda told: steady(texts.paged(told.folder / "printed/report.pdf")),
    "report_unlabelled.pdf.txt": lambda told: steady(texts.paged(told.folder / "unlabelled.pdf")),
    "compared.pdf.txt": lambda told: steady(texts.paged(told.folder / "compared.pdf")),
    "variants.pdf.txt": lambda told: steady(texts.paged(told.folder / "variants.pdf")),
    "figures.txt": lambda told: steady(figures(told)),
    "tables.txt": lambda told: steady(tables(told)),
    "recording.txt": lambda told: steady(texts.words(told.folder / "paper.rrd")),
    "recording_net.txt": lambda told: steady(texts.words(told.folder / "printed.rrd")),
    "recording_unlabelled.txt": lambda told: steady(texts.words(told.folder / "unlabelled.rrd")),
    "screen.txt": lambda told: steady(texts.screen(told.folder / "paper.rrd")),
    "screen_net.txt": lambda told: steady(texts.screen(told.folder / "printed.rrd")),
    "screen_unlabelled.txt": lambda told: steady(texts.screen(told.folder / "unlabelled.rrd")),
}


@pytest.mark.parametrize("name", GOLDEN)
def test_what_people_read(name, told, expected, request):
    found, path = GOLDEN[name](told), expected / name
    if request.config.getoption("--write-golden", default=False):
        expected.mkdir(exist_ok=True)
        path.write_text(found, encoding="utf-8")
    wanted = path.read_text(encoding="utf-8") if path.exists() else ""
    if found != wanted:
        lines = difflib.unified_diff(
            wanted.splitlines(), found.splitlines(), "expected", "found", lineterm="", n=2
        )
        pytest.fail(
            "\n".join([f"{path} differs:", *lines, "if this is wanted: --write-golden"]),
            pytrace=False,
        )


def test_no_golden_file_is_left_over(expected):
    assert {path.name for path in expected.iterdir()} == set(GOLDEN)

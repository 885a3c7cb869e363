"""What the two streams do to text on its way out."""

import pytest
from rich.table import Table

from roadeval.cli import console


@pytest.fixture
def shown(capsys, monkeypatch):
    """Print something on stdout, 20 columns wide; returns its lines."""
    monkeypatch.setenv("COLUMNS", "20")

    def show(what, **words):
        console.results().print(what, **words)
        return capsys.readouterr().out.split("\n")

    return show


HOSTILE = "\x1b[2Ja\nb\u202e"
ESCAPED = r"\u001b[2Ja\nb\u202e"


def test_text_from_elsewhere_is_escaped_wherever_it_stands(shown, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    table = Table(title=HOSTILE, caption=HOSTILE)
    table.add_column(HOSTILE)
    table.add_row(HOSTILE)
    lines = shown(table)
    assert sum(ESCAPED in line for line in lines) == 4
    assert ESCAPED in shown(HOSTILE)
    assert shown(console.wrapped(f"one {HOSTILE}", 80, 2)) == [f"  one {ESCAPED}", ""]
    assert all(line.isprintable() for line in lines)

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


def test_a_wrapped_sentence_has_no_space_at_the_end_of_a_line(shown):
    assert shown("one two three four five six") == ["one two three four", "five six", ""]


def test_a_table_is_not_padded_on_the_right(shown):
    table = Table.grid()
    table.add_row("a long cell")
    table.add_row("short", style="bold")
    assert shown(table) == ["a long cell", "short", ""]


def test_nor_is_a_bold_line_of_a_terminal(shown, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    table = Table.grid()
    table.add_row("a long cell")
    table.add_row("short", style="bold")
    assert shown(table) == ["a long cell", "\x1b[1mshort\x1b[0m", ""]


def test_spaces_inside_a_line_and_before_it_stay(shown):
    assert shown("  a   b") == ["  a   b", ""]

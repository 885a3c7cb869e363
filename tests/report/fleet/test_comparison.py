"""The report of a comparison of two fleets."""

import pytest

from roadeval.jobs.compare_fleets import compare_fleets
from roadeval.report.blocks import BulletList, Figure, Table
from roadeval.report.fleet.comparison import changes_table, document, drives_table, markdown
from roadeval.report.pdf.typeset import pdf
from roadeval.results.fleet.comparison import judged
from tests.report.making import plain_rows, text
from tests.results.fleet.making import fleet_of


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleets")
    base = fleet_of(folder / "base", 30, grouped=False)
    new = fleet_of(folder / "new", 30, grouped=False, change=0.03)
    limits = ["post.filtered.ERR > +0.5pp", "post.filtered.ERR > 50%"]
    return compare_fleets(base, new, fail_if=limits)


def test_the_table_marks_what_stands_and_bolds_final_masks(compared):
    table = changes_table(compared.comparison)
    rows = plain_rows(table)
    assert [row[0] for row in rows if row[0]] == ["filtered", "unfiltered", "blind"]
    assert [row[6].endswith(" *") for row in rows] == [True] * 3 + [False] * 4
    assert [row[5].bold for row in table.rows] == [False, False, True] * 2 + [True]
    change = compared.comparison.changes[2]
    assert rows[2][3:5] == [f"{100 * r['ERR']:.2f}" for r in (change.base, change.new)]


def test_drives_that_changed_are_listed_the_surest_first(compared):
    rows = compared.comparison.changed(("filtered", "post"))
    table = drives_table(rows, compared.comparison.names)
    assert len(table.rows) == len(rows)
    q = [float(row[-1]) for row in plain_rows(table)]
    assert q == sorted(q)
    assert max(q) <= 0.05


def test_markdown_tells_failures_first(compared):
    lines = markdown(compared.comparison, compared.judgements).splitlines()
    failed, kept = (judged(each, compared.comparison) for each in compared.judgements)
    assert lines[4] == f"- **FAIL**: {failed}".replace(">", "\\>")
    assert lines[5] == f"- ok: {kept}".replace(">", "\\>")
    assert "| drive\\_0000 |" in "\n".join(lines)


def test_the_document_has_the_limits_the_plot_and_the_drives(compared):
    made = document(compared.comparison, compared.judgements)
    titles = [b.title for b in made.blocks if isinstance(b, BulletList)]
    assert titles == ["Limits exceeded", "Limits kept", "Beware"]
    assert len([b for b in made.blocks if isinstance(b, Figure)]) == 1
    # By tag only where something changed.
    headings = [b.text for b in made.blocks if hasattr(b, "text")]
    assert "Change of ERR of filtered by tag" in headings
    assert "Change of ERR of unfiltered by tag" not in headings
    assert len([b for b in made.blocks if isinstance(b, Table)]) == 3
    words = text(pdf(made))
    assert "raises ERR of post" in words
    assert "Holm's correction for the 3 differences of ERR" in words

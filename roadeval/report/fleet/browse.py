"""All drives of a fleet in one table, to sort and to search: a section that only a page has."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from roadeval.data.words import DASH, number, percent, points
from roadeval.evaluation.score import BASES
from roadeval.report.blocks import Block, Cell, Heading, LongTable, Table, Text
from roadeval.report.fleet.drives import against, tags_in_words
from roadeval.report.fleet.findings import FleetFindings, Row

_WORDS: Final = ("drive", "state", "tags", "group")
_LIGHT: Final = ("luminance", "contrast", "shadow", "sun")


def section(findings: FleetFindings) -> Iterator[Block]:
    """Yield the table of all drives."""
    yield Heading("All drives")
    yield LongTable(drives_table(findings), "Find drives, tags, states:")
    yield Text(
        "Rates of the first variant's final mask in percent; light as it was measured, from 0 to "
        "1. A click on a title sorts.",
        "note",
    )


def drives_table(findings: FleetFindings) -> Table:
    """Tabulate every drive with its state, its rates, its light and its tags."""
    scores = {row["drive"]: row for row in findings.scores}
    changes = {base: {r["drive"]: r["mean"] for r in against(findings, base)} for base in BASES}
    shown = {base: values for base, values in changes.items() if values}
    tags = {each["drive"]: tags_in_words(each["tags"]) for each in findings.summary["drives"]}
    pages = findings.pages()
    differences = [f"against {base}, pp" for base in shown]
    return Table(
        [*_WORDS, "frames", "ERR", "FPR", "FNR", *differences, *_LIGHT],
        [
            [
                Cell(findings.names[drive], leads=pages.get(drive, "")),
                str(row["status"]),
                tags.get(drive, ""),
                str(row["group"] or ""),
                number(row["evaluated"] or 0),
                *_rates(scores.get(drive, {})),
                *(points(values.get(drive)) for values in shown.values()),
                *(_light(row[name]) for name in _LIGHT),
            ]
            for drive, row in findings.drives.items()
        ],
        text_columns=range(len(_WORDS)),
        small=True,
    )


def _rates(score: Row | Mapping[str, float]) -> Iterator[Cell | str]:
    for name in ("ERR", "FPR", "FNR"):
        text = percent(score.get(name))
        yield Cell(text, bold=True) if name == "ERR" else text


def _light(value: float | None) -> str:
    return DASH if value is None else f"{value:.2f}"

"""The page on what is missing: drives that failed, and why; and what was lost of others."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import Final

from roadeval.data.words import number
from roadeval.report.blocks import Block, Heading, Table, Text
from roadeval.report.fleet.findings import FleetFindings, Row

REASONS: Final = 12
"""Reasons that are listed."""
DRIVES: Final = 4
"""Drives named for one reason."""
LOSSES: Final = 12
"""Damaged drives that are listed."""


def section(findings: FleetFindings) -> Iterator[Block]:
    """Yield the drives that failed by reason, those without truth, and losses."""
    failed = [row for row in findings.drives.values() if row["status"] == "failed"]
    unscored = [row for row in findings.drives.values() if row["status"] == "unscored"]
    damaged = [row for row in findings.drives.values() if row["losses"]]
    if not failed and not unscored and not damaged:
        return
    yield Heading("What is missing")
    for title, rows in (("Drives that failed", failed), ("Drives without a score", unscored)):
        if rows:
            yield Heading(f"{title}: {number(len(rows))}", 2)
            yield from _reasons(findings, rows)
    if damaged:
        yield Heading(f"Logs of which a part was lost: {number(len(damaged))}", 2)
        yield _losses(findings, damaged)
        if len(damaged) > LOSSES:
            yield Text(f"{number(len(damaged) - LOSSES)} more: see drives.parquet.", "note")


def _reasons(findings: FleetFindings, rows: list[Row]) -> Iterator[Block]:
    """Yield a table of reasons, the most frequent first."""
    by_reason: defaultdict[str, list[str]] = defaultdict(list)
    for row in rows:
        by_reason[_reason(row)].append(findings.names[row["drive"]])
    ranked = sorted(by_reason.items(), key=lambda each: -len(each[1]))
    yield Table(
        ["drives", "which", "reason"],
        [[number(len(names)), _first(names), reason] for reason, names in ranked[:REASONS]],
        text_columns=(0, 1, 2),
        small=True,
    )
    if len(ranked) > REASONS:
        more = sum(len(names) for _, names in ranked[REASONS:])
        yield Text(f"{number(more)} more for other reasons: see drives.parquet.", "note")


def _reason(row: Row) -> str:
    """Return why, without the name of the drive's file, which begins most reasons."""
    reason = row["reason"] or "no reason known"
    begin, _, rest = reason.partition(": ")
    return rest if rest and begin.rpartition("/")[2].startswith(row["name"]) else reason


def _first(names: list[str]) -> str:
    more = f" and {number(len(names) - DRIVES)} more" if len(names) > DRIVES else ""
    return f"{', '.join(names[:DRIVES])}{more}"


def _losses(findings: FleetFindings, rows: list[Row]) -> Table:
    told = []
    for row in rows[:LOSSES]:
        first, *rest = row["losses"].splitlines()
        more = f" (and {len(rest)} more)" if rest else ""
        told.append([findings.names[row["drive"]], f"{first}{more}"])
    return Table(["drive", "lost"], told, text_columns=(0, 1), small=True)

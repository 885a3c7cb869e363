"""The report of a fleet: its sections and their order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from roadeval.data.words import number
from roadeval.report.blocks import Document
from roadeval.report.fleet import browse, drives, frames, losses, provenance, strata, summary
from roadeval.report.fleet.findings import FleetFindings


def document(findings: FleetFindings) -> Document:
    """Return the report of a fleet."""
    return _document(findings, (summary, drives, strata, losses, frames, provenance))


def page_document(findings: FleetFindings) -> Document:
    """Return the page of a fleet: its report, with a table of all drives, the frames before."""
    return _document(findings, (summary, browse, frames, drives, strata, losses, provenance))


def _document(findings: FleetFindings, parts: Sequence[Any]) -> Document:
    return Document(
        kicker="roadeval report of a fleet",
        title=findings.name,
        subtitle=", ".join(_facts(findings)),
        footer=f"{findings.name}, {findings.folder}",
        blocks=[block for part in parts for block in part.section(findings)],
        keywords=["road recognition", "evaluation", "fleet", findings.name],
    )


def _facts(findings: FleetFindings) -> Iterator[str]:
    told = findings.summary
    yield f"{number(len(told['drives']))} drives"
    yield f"{number(told['frames'])} frames evaluated"
    if preset := told["run"].get("preset"):
        yield f"preset {preset}"
    yield f"roadeval {told['version']}"

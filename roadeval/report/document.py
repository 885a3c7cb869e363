"""The report of one drive, or of many: its sections and their order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, Final

from roadeval.data.words import number
from roadeval.report.blocks import Block, Document, FrameBrowser
from roadeval.report.findings import Findings, FleetFindings
from roadeval.report.sections import (
    browse,
    drives,
    filter_effect,
    frames,
    masks,
    over_drive,
    provenance,
    regions,
    stages,
    strata,
    summary,
    thresholds,
    worst,
)
from roadeval.report.sections.browse import BrowsedFrames

SCORED: Final = (over_drive, filter_effect, regions, stages, thresholds)
"""The sections of a drive with truth; without it there is one on its masks."""


def document(findings: Findings | FleetFindings) -> Document:
    """Return the report of a drive, or of many."""
    if isinstance(findings, FleetFindings):
        parts = (summary.section, drives.plots, strata.section, drives.missing)
        return _of_drives(findings, (*parts, worst.section, provenance.of_drives))
    scored = (*SCORED, frames) if findings.totals else (masks,)
    return _of_a_drive(findings, _blocks(findings, (summary, *scored, provenance)))


def page_document(findings: Findings | FleetFindings, browsed: BrowsedFrames | None) -> Document:
    """Return the report as a page: with a browser of frames, or a table of all drives."""
    if isinstance(findings, FleetFindings):
        parts = (summary.section, drives.table, worst.section, drives.plots, strata.section)
        return _of_drives(findings, (*parts, drives.missing, provenance.of_drives))
    scored = SCORED if findings.totals else (masks,)
    frames = browse.section(browsed) if browsed else ()
    blocks = [*_blocks(findings, (summary,)), *frames, *_blocks(findings, (*scored, provenance))]
    return _of_a_drive(findings, blocks)


def with_frames(page: Document, browsed: BrowsedFrames) -> Document:
    """Return a page of one drive with another browser of frames; nothing is drawn again."""
    own = iter(block for block in browse.section(browsed) if isinstance(block, FrameBrowser))
    blocks = [next(own) if isinstance(each, FrameBrowser) else each for each in page.blocks]
    return replace(page, blocks=blocks)


def _blocks(findings: Findings, sections: Sequence[Any]) -> list[Block]:
    return [block for each in sections for block in each.section(findings)]


def _of_a_drive(findings: Findings, blocks: Sequence[Block]) -> Document:
    return Document(
        kicker="roadeval report",
        title=findings.drive,
        subtitle=", ".join(_subtitle(findings)),
        footer=f"{findings.drive}, {findings.source}",
        blocks=blocks,
        keywords=["road recognition", "evaluation", findings.drive],
    )


def _subtitle(findings: Findings) -> Iterator[str]:
    facts = findings.facts
    yield f"{facts.frames.in_log or facts.frames.evaluated} frames"
    if facts.drive.width:
        yield f"{facts.drive.width} \N{MULTIPLICATION SIGN} {facts.drive.height}"
    if facts.drive.rate_hz:
        yield f"{facts.drive.rate_hz:.4g} Hz"
    if preset := facts.run.get("preset") or findings.properties.get("preset"):
        yield f"preset {preset}"
    if version := facts.versions.get("roadeval") or findings.properties.get("version"):
        yield f"roadeval {version}"


def _of_drives(findings: FleetFindings, sections: Sequence[Any]) -> Document:
    facts = findings.facts
    preset = facts.run.get("preset")
    words = (
        f"{number(len(facts.drives))} drives",
        f"{number(facts.frames)} frames evaluated",
        *([f"preset {preset}"] if preset else []),
        f"roadeval {facts.version}",
    )
    return Document(
        kicker="roadeval report of a fleet",
        title=findings.name,
        subtitle=", ".join(words),
        footer=f"{findings.name}, {findings.folder}",
        blocks=[block for section in sections for block in section(findings)],
        keywords=["road recognition", "evaluation", "fleet", findings.name],
    )

"""The report of one drive: its sections and their order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from roadeval.report.blocks import Block, Document, FrameBrowser
from roadeval.report.findings import Findings
from roadeval.report.sections import (
    browse,
    filter_effect,
    frames,
    masks,
    over_drive,
    provenance,
    regions,
    stages,
    summary,
    thresholds,
)
from roadeval.report.sections.browse import BrowsedFrames


def document(findings: Findings) -> Document:
    """Return the report of one drive."""
    return _document(findings, list(_sections(findings)))


def page_document(findings: Findings, browsed: BrowsedFrames) -> Document:
    """Return the page of one drive: its report, with a browser of frames in place of the worst."""
    scored = (over_drive, filter_effect, regions, stages, thresholds)
    blocks = [*summary.section(findings), *browse.section(browsed)]
    for part in (*(scored if findings.totals else (masks,)), provenance):
        blocks += part.section(findings)
    return _document(findings, blocks)


def with_frames(page: Document, browsed: BrowsedFrames) -> Document:
    """Return a page of one drive with another browser of frames; nothing is drawn again."""
    own = iter(block for block in browse.section(browsed) if isinstance(block, FrameBrowser))
    blocks = [next(own) if isinstance(each, FrameBrowser) else each for each in page.blocks]
    return replace(page, blocks=blocks)


def _document(findings: Findings, blocks: Sequence[Block]) -> Document:
    return Document(
        kicker="roadeval report",
        title=findings.drive,
        subtitle=", ".join(_facts(findings, findings.summary["drive"])),
        footer=f"{findings.drive}, {findings.source}",
        blocks=blocks,
        keywords=["road recognition", "evaluation", findings.drive],
    )


def _sections(findings: Findings) -> Iterator[Block]:
    scored = (over_drive, filter_effect, regions, stages, thresholds, frames)
    for part in (summary, *(scored if findings.totals else (masks,)), provenance):
        yield from part.section(findings)


def _facts(findings: Findings, drive: dict[str, Any]) -> Iterator[str]:
    count = findings.summary["frames"].get("in_log") or findings.summary["frames"]["evaluated"]
    yield f"{count} frames"
    if drive.get("width"):
        yield f"{drive['width']} \N{MULTIPLICATION SIGN} {drive['height']}"
    if drive.get("rate_hz"):
        yield f"{drive['rate_hz']:.4g} Hz"
    preset = findings.summary["run"].get("preset") or findings.properties.get("preset")
    if preset:
        yield f"preset {preset}"
    version = findings.summary["versions"].get("roadeval") or findings.properties.get("version")
    if version:
        yield f"roadeval {version}"

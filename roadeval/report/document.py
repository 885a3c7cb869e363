"""The report of one drive or of many: its sections and their order."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, Final

from roadeval.data import FILTERED, UNFILTERED
from roadeval.data.words import number
from roadeval.report.blocks import Block, Report
from roadeval.report.findings import Findings
from roadeval.report.sections import drive, drives, failures, frames, ground
from roadeval.report.sections.frames import FrameBrowser
from roadeval.results.fleet import FleetFolder

ACROSS: Final = 6
"""Number of pictures of worst frames in a row on the page of a fleet."""
Section = Callable[[Any], Iterable[Block]]
WHY: Final = (failures.classes, failures.when_it_fails, failures.disturbances)
"""The sections on what goes wrong, for a drive or for many."""
SCORED: Final = (
    *(drive.filter_effect, drive.over_time, drive.regions, *WHY, ground.on_the_ground),
    *(drive.stages, drive.oracles, drive.thresholds),
)
"""The sections of a drive with truth; a drive without truth has one section on its masks."""
RIG: Final = (drive.cameras, drive.filter_effect, failures.disturbances, drive.each_camera)
"""The sections of a drive with several cameras."""


def document(findings: Findings | FleetFolder) -> Report:
    """Return the report of a drive, or of many."""
    if isinstance(findings, FleetFolder):
        parts: tuple[Section, ...] = (drives.plots, drives.strata, drive.regions, *WHY)
        return _compose(findings, *parts, drives.missing, drives.worst, drives.provenance)
    if findings.cameras:
        return _compose(findings, *RIG, drive.provenance)
    # Frames fill pages, so they come late.
    scored = (drive.over_drive, *SCORED) if findings.facts.totals else (drive.masks,)
    gallery = (frames.worst_frames,) if findings.facts.totals or findings.worst else ()
    return _compose(findings, *scored, *gallery, drive.provenance)


def page_document(
    findings: Findings | FleetFolder,
    browsed: FrameBrowser | None,
    worst_frames: int = 0,
    folder: Path = Path(),
) -> Report:
    """Return the report as a page: with a browser of frames, or a table of all drives.

    For many drives ``worst_frames`` limits the pictures of worst frames, over all drives and drive
    by drive; links to the pages of drives are relative to ``folder``.
    """
    if isinstance(findings, FleetFolder):
        along = partial(drives.along, most=worst_frames, beside=folder)
        worst = partial(drives.worst, across=ACROSS, most=worst_frames)
        parts: tuple[Section, ...] = (drives.table, along, worst, drives.plots, drives.strata)
        parts = (*parts, drive.regions, *WHY, drives.missing)
        return _compose(findings, *parts, drives.provenance)
    if findings.cameras:
        return _compose(findings, *RIG, drive.provenance)
    if browsed and browsed.film:  # the film shows more than the thumbnails
        findings = replace(findings, thumbnails=())
    parts = (drive.masks,)
    if findings.facts.totals:
        parts = (partial(drive.over_drive, heading=False), *SCORED)
    return _compose(findings, lambda _: frames.browser(browsed), *parts, drive.provenance)


def _compose(findings: Findings | FleetFolder, *sections: Section) -> Report:
    preset, kicker, words = findings.facts.run.get("preset"), "roadeval report", list[str]()
    if isinstance(findings, FleetFolder):
        first: Section = drives.summary
        kicker, words = f"{kicker} of a fleet", ["fleet"]
        ran, version = {*findings.facts.finals}, findings.facts.version
        about = [f"{number(len(findings.facts.drives))} drives"]
        about.append(f"{number(findings.facts.frames)} frames evaluated")
    else:
        first, facts = drive.summary, findings.facts
        ran, version = {*facts.settings}, facts.versions.get("roadeval", "")
        about = [f"{len(findings.cameras)} cameras"] if findings.cameras else []
        about.append(f"{facts.frames.in_log or facts.frames.evaluated} frames")
        if facts.drive.width:
            about.append(f"{facts.drive.width} \N{MULTIPLICATION SIGN} {facts.drive.height}")
        if facts.drive.rate_hz:
            about.append(f"{facts.drive.rate_hz:.4g} Hz")
    if preset and {FILTERED, UNFILTERED} & ran:  # else no variant used the preset
        about.append(f"preset {preset}")
    if version:
        about.append(f"roadeval {version}")
    return Report(
        kicker=kicker,
        title=findings.name,
        subtitle=", ".join(about),
        footer=", ".join(dict.fromkeys((findings.name, str(findings.path)))),
        blocks=[*chain.from_iterable(part(findings) for part in (first, *sections))],
        keywords=["road recognition", "evaluation", *words, findings.name],
    )

"""The report as a document: which sections there are, and in which order."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from roadeval.report.blocks import Block, Document, Figure, Heading, Strip, Text
from roadeval.report.figures import plots
from roadeval.report.findings import Findings
from roadeval.report.sections import frames, front, origin, outcomes, reasons


def document(found: Findings) -> Document:
    """Write the report of one drive."""
    drive = found.summary["drive"]
    return Document(
        kicker="roadeval report",
        title=str(drive["name"]),
        subtitle=", ".join(_facts(found, drive)),
        footer=f"{drive['name']}, {found.source}",
        blocks=list(_sections(found)),
        keywords=["road recognition", "evaluation", str(drive["name"])],
    )


def _facts(found: Findings, drive: dict[str, Any]) -> Iterator[str]:
    count = found.summary["frames"].get("in_log") or found.summary["frames"]["evaluated"]
    yield f"{count} frames"
    if drive.get("width"):
        yield f"{drive['width']} \N{MULTIPLICATION SIGN} {drive['height']}"
    if drive.get("rate_hz"):
        yield f"{drive['rate_hz']:.4g} Hz"
    presets = {str(each["preset"]) for each in found.summary["settings"].values()}
    presets = presets or {str(found.properties.get("preset", ""))} - {""}
    yield from (f"preset {name}" for name in sorted(presets))
    version = found.summary["versions"].get("roadeval") or found.properties.get("version")
    if version:
        yield f"roadeval {version}"


def _sections(found: Findings) -> Iterator[Block]:
    yield from front.summary(found)
    if found.totals:
        yield from outcomes.paper(found)
        yield from outcomes.against(found)
        yield from reasons.where(found)
        yield from reasons.stages(found)
        yield from frames.gallery(found)
    else:
        yield from _unscored(found)
    yield from origin.origin(found)


def _unscored(found: Findings) -> Iterator[Block]:
    """Show what there is to see without truth: masks, and how much of the image they cover."""
    yield Heading("Masks")
    yield Text(
        "Without truth nothing can be said about errors: not whether the road was found, not "
        "whether the filter helps, not which stage is at fault. What follows is what was computed."
    )
    if found.examples:
        pictures = list(outcomes.example_pictures(found.examples))
        yield Strip(pictures, len(found.examples[0].masks) + 1)
    if len(found.coverage):
        table = found.coverage
        yield Figure(
            plots.vector(lambda: plots.coverage(table)),
            "The share of the image that the final masks call road. A jump is worth a look.",
        )

"""The first page: the verdict, the table of rates, a few frames or differences, and warnings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from roadeval.data import BASELINE
from roadeval.data.words import counted, defined, listing, number, percent
from roadeval.evaluation.metrics import TESTED
from roadeval.report.blocks import (
    Block,
    BulletList,
    Heading,
    ImageGrid,
    LinkList,
    TableOfContents,
    Text,
)
from roadeval.report.findings import Findings
from roadeval.report.images import jpeg
from roadeval.report.sections.drives import WORST_AT
from roadeval.report.tables import differences_table, rates_table
from roadeval.results.fleet import FleetFolder
from roadeval.results.rows import records
from roadeval.results.schema import DAMAGED, FAILED, SCORED, UNSCORED
from roadeval.results.sentences import account

LOSSES: Final = 3
"""Losses that are named."""
PARTIAL: Final = (
    "This run did not reach its end: the report covers the part of the recording that can be read."
)


STATUSES: Final = {
    SCORED: "scored",
    DAMAGED: "scored but for what is lost",
    UNSCORED: "without truth",
    FAILED: "failed",
}


def section(findings: Findings | FleetFolder) -> Iterator[Block]:
    """Yield the first page."""
    yield Heading("Summary")
    if isinstance(findings, FleetFolder):
        yield from _of_drives(findings)
    else:
        yield from _of_a_drive(findings)


def _of_a_drive(findings: Findings) -> Iterator[Block]:
    if not findings.complete:
        yield BulletList("Partial recording", [PARTIAL], "warning")
    yield Text(findings.facts.verdict, "verdict")
    for frame in findings.worst[:1]:
        title = f"First frame to look at: {frame.frame}"
        if frame.rates:
            wrong = percent(frame.rates[frame.variant][TESTED], 1)
            title = f"Worst frame: {frame.frame}, where {frame.variant} gets {wrong} % wrong"
        command = findings.inspect(frame.frame) if findings.inspect else ""
        yield LinkList([(title, f"#frame-{frame.frame}")], command)
    if findings.totals:
        yield rates_table(findings.facts)
    yield Text(account(findings.facts.frames, findings.facts.windows), "note")
    if findings.thumbnails:
        pictures = [(image.title, jpeg(image)) for image in findings.thumbnails]
        legend = "Green: called road."
        for first in [*findings.finals][:1]:
            legend = (
                f"Errors of {first} across the drive. Green: road found; orange: non-road called "
                "road (FP); purple: road missed (FN); grey: ignored."
            )
        yield ImageGrid(pictures, 4, caption=legend)
    yield _beware(list(warnings(findings)))


def _of_drives(findings: FleetFolder) -> Iterator[Block]:
    facts = findings.facts
    yield Text(facts.verdict, "verdict")
    for frame in records(findings.worst[:1]):
        where = f"{findings.names[frame['drive']]}, frame {frame['frame']}"
        title = f"Worst frame: {where} (ERR {percent(frame[TESTED], 1)} %)"
        yield LinkList([(title, WORST_AT)], findings.inspect(frame))
    if facts.totals:
        yield rates_table(facts)
    if facts.effects:
        yield differences_table(facts)
        note = "Every drive counts the same, long or short; those of one group count as one, and "
        yield Text(f"{note}so do copies of a log.", "note")
    yield Text(f"{drives_account(facts.counts, facts.frames)}.", "note")
    yield _beware(list(fleet_warnings(findings)))
    yield TableOfContents()


def _beware(warned: list[str]) -> BulletList:
    return BulletList("Beware", warned or ["Nothing known."], "warning" if warned else "plain")


def warnings(findings: Findings) -> Iterator[str]:
    """Yield what a reader must know before believing the numbers of a drive."""
    facts = findings.facts
    yield from facts.warnings
    own = facts.training.model is None or facts.training.adapted
    if facts.training.source == "truth" and own and findings.totals:
        yield (
            "Trained on frames of this drive (none of them is evaluated): the rates say how well "
            "it does on a road that it has seen."
        )
    errors = {name: findings.total(name)[TESTED] for name in findings.finals}
    if worse := _worse_than_baseline(errors):
        yield f"{worse}, which never looks at the image: nothing was gained from its pixels here."
    for variant in findings.finals:
        total = findings.total(variant)
        if counts := [f"{rate} on {number(n)}" for rate, n in total["undefined"].items() if n]:
            of = number(total["frames"])
            yield f"{variant}: of {of} frames, undefined and left out: {listing(counts)}."
    yield from (f"Lost: {loss}" for loss in facts.losses[:LOSSES])
    if len(facts.losses) > LOSSES:
        yield f"{len(facts.losses) - LOSSES} more frames were lost; summary.json names them."
    if not findings.pictured:
        yield "Made without pictures (a results folder holds none): no gallery, no maps."


def _worse_than_baseline(errors: Mapping[str, float | None]) -> str:
    """Name the variants with a higher ERR than the baseline; empty without any."""
    blind = errors.get(BASELINE)
    known = {name: error for name, error in errors.items() if defined(error) and defined(blind)}
    worse = [name for name, error in known.items() if error > known[BASELINE]]
    verb = "is" if len(worse) == 1 else "are"
    return f"{listing(worse)} {verb} worse than {BASELINE} (ERR {percent(blind)} %)" * bool(worse)


def fleet_warnings(findings: FleetFolder) -> Iterator[str]:
    """Yield what a reader must know before believing the numbers of many drives."""
    facts = findings.facts
    if failed := facts.counts.get(FAILED):
        of = number(len(facts.drives))
        yield f"{number(failed)} of {of} drives failed: no number counts them."
    if damaged := facts.counts.get(DAMAGED):
        yield f"{_were(damaged)} scored without what is lost of the log."
    drives = findings.drives
    learnt = (drives["evaluated"] > 0) & (drives["trained_on"] > 0) & drives["model"].isna()
    if own := int(learnt.sum()):
        yield (
            f"{_were(own)} scored by a model trained on the drive's own frames (none of "
            "these is evaluated): the rates say how well it does on a road that it has seen."
        )
    errors = {name: facts.totals[name][stage][TESTED] for name, stage in facts.finals.items()}
    if worse := _worse_than_baseline(errors):
        yield f"{worse}, which never looks at the image."
    yield from (f"{sentence}." for sentence in facts.warnings)


def _were(count: int) -> str:
    return f"{counted(count, 'drive')} {'was' if count == 1 else 'were'}"


def drives_account(counts: Mapping[str, int], frames: int) -> str:
    """Return how many drives there are, by their states, and how many frames were evaluated."""
    states = (f"{number(counts[s])} {text}" for s, text in STATUSES.items() if counts.get(s))
    drives = counted(sum(counts.values()), "drive")
    return f"{drives}: {', '.join(states)}; {number(frames)} frames evaluated"

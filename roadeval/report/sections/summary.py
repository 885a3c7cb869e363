"""The first page: the verdict, rates, a few frames or differences, and warnings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from roadeval.data import BASELINE
from roadeval.data.words import counted, defined, listing, number, percent
from roadeval.evaluation.metrics import TESTED
from roadeval.report.blocks import Block, BulletList, Heading, ImageGrid, LinkList, Text
from roadeval.report.captions import caption, note
from roadeval.report.findings import Findings
from roadeval.report.images import jpeg
from roadeval.report.sections.drives import WORST_AT
from roadeval.report.tables import differences_table, rates_table
from roadeval.results.facts import Facts, FleetFacts
from roadeval.results.fleet import FleetFolder
from roadeval.results.rows import records
from roadeval.results.schema import DAMAGED, FAILED, SCORED, UNSCORED
from roadeval.results.sentences import account

LOSSES: Final = 3
"""Greatest number of losses that are named."""
STATUSES: Final = {
    SCORED: "scored",
    DAMAGED: "scored without the lost part",
    UNSCORED: "without truth",
    FAILED: "failed",
}


def of_drives(findings: FleetFolder) -> Iterator[Block]:
    """Yield the first page of a fleet."""
    yield Heading("Summary")
    facts = findings.facts
    yield Text(facts.verdict, "verdict")
    yield from why(facts)
    for frame in records(findings.worst[:1]):
        where = f"{findings.names[frame['drive']]}, frame {frame['frame']}"
        title = f"Worst frame: {where} (ERR {percent(frame[TESTED], 1)} %)"
        yield LinkList([(title, WORST_AT)], findings.inspect(frame))
    if facts.totals:
        yield rates_table(facts)
    if facts.effects:
        yield differences_table(facts)
        yield note("weights of drives")
    yield Text(f"{drives_account(facts.counts, facts.frames)}.", "note")
    yield _beware([*fleet_warnings(findings)])


def of_a_drive(findings: Findings) -> Iterator[Block]:
    """Yield the first page of a drive."""
    yield Heading("Summary")
    facts = findings.facts
    if not findings.complete:
        yield BulletList("Partial recording", [caption("partial")], "warning")
    yield Text(facts.verdict, "verdict")
    for name in dict.fromkeys((facts.focus, *facts.why)):
        yield from why(facts, name)
    for frame in findings.worst[:1]:
        title = f"First frame to look at: {frame.frame}"
        if frame.rates:
            wrong = percent(frame.rates[frame.variant][TESTED], 1)
            title = caption("worst frame", frame=frame.frame, variant=frame.variant, ERR=wrong)
        command = findings.inspect(frame.frame) if findings.inspect else ""
        yield LinkList([(title, f"#frame-{frame.frame}")], command)
    if facts.totals:
        yield rates_table(facts)
    yield Text(account(facts.frames, facts.windows, facts.evaluation.window), "note")
    if findings.thumbnails:
        pictures = [(image.title, jpeg(image)) for image in findings.thumbnails]
        legend = caption("thumbnails without truth")
        if focus := facts.focus:
            legend = caption("thumbnails", variant=focus, errors=caption("errors"))
        yield ImageGrid(pictures, 4, caption=legend)
    yield _beware([*warnings(findings)])


def why(facts: Facts | FleetFacts, variant: str | None = None) -> Iterator[BulletList]:
    """Yield the reasons for the errors of a variant, by default the focus, if there are any.

    Paper shows only the reasons of the focus; a page shows the reasons of the chosen focus.
    """
    name = variant or facts.focus or ""
    if reasons := facts.why.get(name):
        is_focus = name == facts.focus
        yield BulletList(f"Why {name} errs", reasons, focus=name, on_paper=is_focus)


def _beware(sentences: list[str]) -> BulletList:
    """Return a list of warnings, or a line if there is none."""
    tone = "warning" if sentences else "plain"
    return BulletList("Beware", sentences or [caption("nothing known")], tone)


def warnings(findings: Findings) -> Iterator[str]:
    """Yield the reasons to doubt the numbers of a drive."""
    facts = findings.facts
    yield from facts.warnings
    trained_here = facts.training.model is None or facts.training.adapted
    if facts.training.source == "truth" and trained_here and findings.facts.totals:
        yield caption("trained on this drive")
    if worse := _worse_than_baseline(facts):
        yield caption("worse than blind", worse=worse)
    for variant, total in facts.final_totals.items():
        if rates := [f"{rate} on {number(n)}" for rate, n in total["undefined"].items() if n]:
            frames, rates_named = number(total["frames"]), listing(rates)
            yield caption("undefined rates", variant=variant, frames=frames, rates=rates_named)
    yield from (f"Lost: {loss}" for loss in facts.losses[:LOSSES])
    if len(facts.losses) > LOSSES:
        yield caption("more losses", count=len(facts.losses) - LOSSES)
    if not findings.pictured:
        yield caption("no pictures")


def _worse_than_baseline(facts: Facts | FleetFacts) -> str:
    """Name the variants with a higher ERR than the baseline; empty without any."""
    errors = {name: total[TESTED] for name, total in facts.final_totals.items()}
    blind = errors.get(BASELINE)
    if not defined(blind):
        return ""
    worse = [name for name, error in errors.items() if defined(error) and error > blind]
    verb = "is" if len(worse) == 1 else "are"
    return f"{listing(worse)} {verb} worse than {BASELINE} (ERR {percent(blind)} %)" * bool(worse)


def fleet_warnings(findings: FleetFolder) -> Iterator[str]:
    """Yield the reasons to doubt the numbers of many drives."""
    facts = findings.facts
    if failed := facts.counts.get(FAILED):
        yield caption("failed drives", failed=number(failed), drives=number(len(facts.drives)))
    if damaged := facts.counts.get(DAMAGED):
        yield caption("damaged drives", drives=_were(damaged))
    drives = findings.drives
    trained_here = (drives["evaluated"] > 0) & (drives["trained_on"] > 0) & drives["model"].isna()
    if count := int(trained_here.sum()):
        yield caption("drives that trained their models", drives=_were(count))
    if worse := _worse_than_baseline(facts):
        yield caption("worse than blind in a fleet", worse=worse)
    yield from (f"{sentence}." for sentence in facts.warnings)


def _were(count: int) -> str:
    return f"{counted(count, 'drive')} {'was' if count == 1 else 'were'}"


def drives_account(counts: Mapping[str, int], frames: int) -> str:
    """Return the numbers of drives, by their states, and of evaluated frames."""
    states = (f"{number(counts[s])} {text}" for s, text in STATUSES.items() if counts.get(s))
    drives = counted(sum(counts.values()), "drive")
    return f"{drives}: {', '.join(states)}; {number(frames)} frames evaluated"

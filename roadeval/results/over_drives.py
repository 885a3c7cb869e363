"""The facts of many drives, made of their tables."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

from roadeval.data import BASELINE
from roadeval.data.words import listing
from roadeval.evaluation.metrics import METRICS, TESTED
from roadeval.evaluation.score.degradation import Degradation, Degradations, as_corrected
from roadeval.evaluation.score.scoreboard import Effect, correct_effects
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats.difference import LEAST_GROUPS, over_drives, strata
from roadeval.evaluation.stats.slices import OF_REGIONS, Slice, find_slices
from roadeval.evaluation.tables import (
    COUNTS,
    MASK,
    concatenate,
    finals,
    group_rows,
    only,
    rates_of,
)
from roadeval.results.facts import FleetFacts, Member, StratumFacts, Totals
from roadeval.results.rows import records
from roadeval.results.schema import FAILED, TAG
from roadeval.results.verdict import verdict_on
from roadeval.results.why import explain
from roadeval.version import VERSION

if TYPE_CHECKING:
    import pandas as pd

CENTURY_NS: Final = 946_684_800_000_000_000
"""The stamp of the year 2000."""
WARNINGS: Final = 5
"""Number of kinds of drives' warnings that are listed."""


def summarise(
    tables: Mapping[str, pd.DataFrame],
    members: Sequence[Member],
    settings: EvaluationSettings,
    run: dict[str, Any],
    within_one: Sequence[Effect] = (),
    *,
    disturbances: Mapping[str, Degradations] | None = None,
    read: Callable[[str, Sequence[str]], pd.DataFrame] | None = None,
) -> FleetFacts:
    """Return the facts of a fleet.

    ``tables`` are ``drives``, and the rows of ``scores`` and ``effects`` of final masks on all
    pixels. ``within_one`` are the differences within the drive if only one was scored;
    ``disturbances`` has the degradations of each drive. ``read`` reads a table of some drives, in
    which slices are searched.
    """
    drives, scores, effects = (tables[name] for name in ("drives", "scores", "effects"))
    rows = records(drives)
    logs = drives[drives["log_digest"].fillna("") != ""]
    firsts = logs.groupby("log_digest")["drive"].transform("first")
    copies = {drive: of for drive, of in zip(logs["drive"], firsts, strict=True) if drive != of}
    cameras = {row["drive"]: row["camera"] for row in rows}
    groups = {m.drive: m.group or copies.get(m.drive, m.drive) for m in members}
    tags = [name for name in map(str, drives) if name.startswith(TAG)]
    grouping = effects.assign(group=effects["drive"].map(groups))
    means = grouping.merge(drives[["drive", *tags]], on="drive")
    differences = [*within_one]
    parts: list[StratumFacts] = []
    for _, against in group_rows(means, ["base"]) if not within_one else ():
        family = []
        for (base, variant, stage), mask in group_rows(against, ["base", "variant", "stage"]):
            rates = {
                rate: over_drives(drive_means, settings.confidence, rate)
                for (rate,), drive_means in group_rows(mask, ["metric"])
            }
            family.append(Effect(base, variant, stage, final=True, rates=rates))
            for tag, value, change in strata(only(mask, metric=TESTED), tags, settings.confidence):
                parts.append(StratumFacts(base, variant, tag.removeprefix(TAG), value, change))
        differences += correct_effects(family)
    facts = FleetFacts(
        verdict="",
        version=VERSION,
        drives=[*members],
        counts=dict(Counter(drives["status"])),
        frames=int(drives["evaluated"].sum()),
        failed={row["drive"]: row["reason"] for row in rows if row["status"] == FAILED},
        totals=_totals(scores),
        effects=differences,
        strata=parts,
        warnings=[*_warnings(copies, cameras, rows)],
        run=run,
        misfits=[*_misfits(rows)],
        disturbances=_degradations(disturbances or {}, groups, settings.confidence),
    )
    facts = replace(facts, verdict=verdict_on(facts))
    if read is None:
        return facts
    facts = replace(facts, slices=slices_over_drives(read, drives, groups, settings.confidence))
    scored = [row["drive"] for row in rows if row["evaluated"]]
    return replace(facts, why=explain(facts, read("classes", scored)))


def _degradations(
    by_drive: Mapping[str, Degradations], groups: Mapping[str, str], confidence: float
) -> Degradations:
    """Return the means over drives, or the values of the only drive."""
    import pandas as pd

    if len(by_drive) == 1:
        return next(iter(by_drive.values()))
    rows = pd.DataFrame(
        [
            {**vars(change), "variant": variant, "name": name, "drive": drive}
            for drive, variants in by_drive.items()
            for variant, changes in variants.items()
            for name, change in changes.items()
        ]
    )
    means = {}
    for names, part in group_rows(rows, ["variant", "name"]) if by_drive else ():
        mean = [change.mean for change in part["difference"]]
        over = over_drives(part.assign(mean=mean, group=part["drive"].map(groups)), confidence)
        error, base = map(float, part[["ERR", "base_ERR"]].astype(float).mean())
        kind, strength = part.iloc[0][["kind", "strength"]]
        means[names] = Degradation(kind, strength, error, base, over)
    return as_corrected(means)


def slices_over_drives(
    read: Callable[[str, Sequence[str]], pd.DataFrame],
    drives: pd.DataFrame,
    groups: Mapping[str, str],
    confidence: float,
) -> dict[str, list[Slice]]:
    """Return the slices of each final mask; there are none with too few groups of drives.

    Every drive counts the same. Conditions are measured quantities, tags, the time since the
    drive's start, and the time of day if the stamps are of this century.
    """
    scored = drives["drive"][drives["evaluated"].fillna(0) > 0].tolist()
    if len({groups[drive] for drive in scored}) < 2 * LEAST_GROUPS:
        return {}
    names = ("conditions", "frames", "regions", "parts")
    conditions, frames, regions, parts = (read(name, scored) for name in names)
    if not len(conditions):  # older results lack them
        return {}
    stamps = conditions["stamp_ns"]
    starts = stamps.groupby(conditions["drive"], observed=True).transform("min")
    hours = stamps / 3.6e12 % 24
    conditions = conditions.assign(
        seconds=(stamps - starts) / 1e9,
        hour=hours.where((stamps > CENTURY_NS) & (stamps < 4 * CENTURY_NS)),
        group=conditions["drive"].map(groups).astype("str"),
    ).astype({"drive": "str"})
    tags = drives.filter(regex=f"^(drive$|{TAG})").astype({"drive": "str"})
    conditions = conditions.merge(tags, on="drive")
    regions = regions.assign(wrong=regions["FP"] + regions["FN"])
    regions = regions[regions["region"].astype("str").str.match(OF_REGIONS)]
    parts = concatenate([regions[[*parts]], parts])
    return {
        variant: find_slices(
            rows, conditions, only(parts, variant=variant), confidence, over_drives=True
        )
        for (variant,), rows in group_rows(finals(frames), ["variant"])
        if variant != BASELINE
    }


def _totals(scores: pd.DataFrame) -> Totals:
    """Return the rates of each final mask: means of the drives, and from all pixels together."""
    by_mask = group_rows(scores, MASK)
    sums = by_mask[[*COUNTS, "frames"]].sum()
    means = by_mask[[*METRICS]].mean().join(rates_of(sums, METRICS, "pooled_"))
    means.insert(0, "drives", by_mask.size())
    means.insert(1, "frames", sums["frames"])
    by_variant = means.groupby(level="variant", sort=False)
    return {name: rows.droplevel("variant").to_dict("index") for name, rows in by_variant}


def _warnings(
    originals: Mapping[str, str],
    cameras: Mapping[str, str | None],
    drives: Sequence[Mapping[str, Any]],
) -> Iterator[str]:
    """Yield how drives of the same log are counted, and the warnings of the drives.

    Warnings that differ only by numbers are one.
    """
    copies = {copy: of for copy, of in originals.items() if cameras[copy] == cameras[of]}
    if len(originals) > len(copies):
        yield "in differences the cameras of a log are averaged to one drive"
    if copies:
        copy, of = next(iter(copies.items()))
        count = len(copies)
        more = f", and {count - 1} more are copies, too" if count > 1 else ""
        yield (
            f"{copy} is a copy of {of}{more}: differences count copies as one "
            "drive, the means of rates do not"
        )
    by_text: dict[str, list[tuple[str, str]]] = {}
    for row in drives:
        for sentence in (row["warnings"] or "").splitlines():
            by_text.setdefault(re.sub(r"\d+", "", sentence), []).append((row["drive"], sentence))
    ranked = sorted(by_text.values(), key=lambda warnings: -len(warnings))
    for (drive, sentence), *others in ranked[:WARNINGS]:
        more = f" (and {len(others)} more alike)" if others else ""
        yield f"{drive}{more}: {sentence}"
    if len(ranked) > WARNINGS:
        yield f"{len(ranked) - WARNINGS} other warnings of drives: see drives.parquet"


def _misfits(drives: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield a sentence on the drives with truth or masks that do not fit the images."""
    rows = [row for row in drives if row["misfits"]]
    if rows:
        names = listing([row["drive"] for row in rows[:WARNINGS]])
        more = f" and {len(rows) - WARNINGS} more" if len(rows) > WARNINGS else ""
        first = rows[0]["misfits"].splitlines()[0]
        where = f"{len(rows)} of {len(drives)} drives ({names}{more})"
        yield f"Truth or masks do not fit the images on {where}: {first}"

"""The facts of many drives, made of their tables."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from roadeval.data.words import listing
from roadeval.evaluation.metrics import METRICS, TESTED
from roadeval.evaluation.score.scoreboard import Effect, corrected
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats.difference import over_drives, strata
from roadeval.evaluation.tables import COUNTS, MASK, grouped, only, rates_of
from roadeval.results.facts import FleetFacts, Member, StratumFacts, Totals
from roadeval.results.rows import records
from roadeval.results.schema import FAILED, TAG
from roadeval.results.verdict import verdict
from roadeval.version import VERSION

if TYPE_CHECKING:
    import pandas as pd

WARNINGS: Final = 5
"""Kinds of warnings of single drives that are listed."""


def summarise(
    tables: Mapping[str, pd.DataFrame],
    members: Sequence[Member],
    settings: EvaluationSettings,
    run: dict[str, Any],
    alone: Sequence[Effect] = (),
) -> FleetFacts:
    """Make the facts of a fleet.

    ``tables`` has ``drives``, and of ``scores`` and ``effects`` the rows of final masks, on all
    pixels. ``alone`` are the differences within the drive, where only one was scored.
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
    differences = [*alone]
    parts: list[StratumFacts] = []
    for _, against in grouped(means, ["base"]) if not alone else ():
        family = []
        for (base, variant, stage), mask in grouped(against, ["base", "variant", "stage"]):
            rates = {}
            for (rate,), drive_means in grouped(mask, ["metric"]):
                better = METRICS[rate].higher_is_better
                rates[rate] = over_drives(drive_means, settings.confidence, higher_is_better=better)
            family.append(Effect(base, variant, stage, final=True, rates=rates))
            for tag, value, change in strata(only(mask, metric=TESTED), tags, settings.confidence):
                parts.append(StratumFacts(base, variant, tag.removeprefix(TAG), value, change))
        differences += corrected(family)
    totals = _totals(scores)
    return FleetFacts(
        verdict=" ".join([*_misfits(rows), verdict(totals, differences)]),
        version=VERSION,
        drives=[*members],
        counts=dict(Counter(drives["status"])),
        frames=int(drives["evaluated"].sum()),
        failed={row["drive"]: row["reason"] for row in rows if row["status"] == FAILED},
        totals=totals,
        effects=differences,
        strata=parts,
        warnings=[*_of_copies(copies, cameras), *_of_drives(rows)],
        run=run,
    )


def _totals(scores: pd.DataFrame) -> Totals:
    """Return the rates of each final mask: the drives' mean, and of all pixels together."""
    by_mask = grouped(scores, MASK)
    sums = by_mask[[*COUNTS, "frames"]].sum()
    means = by_mask[[*METRICS]].mean().join(rates_of(sums, METRICS, "pooled_"))
    means.insert(0, "drives", by_mask.size())
    means.insert(1, "frames", sums["frames"])
    totals: Totals = {}
    rows: dict[Any, Any] = means.to_dict("index")
    for (variant, stage), row in rows.items():
        totals.setdefault(variant, {})[stage] = row
    return totals


def _of_copies(same: Mapping[str, str], cameras: Mapping[str, str | None]) -> Iterator[str]:
    """Yield what it means that drives are of the same log: copies, or cameras of a rig."""
    copies = {copy: of for copy, of in same.items() if cameras[copy] == cameras[of]}
    if len(same) > len(copies):
        yield "cameras of one log count as one drive in differences, which are of their mean"
    if copies:
        copy, of = next(iter(copies.items()))
        count = len(copies)
        more = f", and {count - 1} more are copies, too" if count > 1 else ""
        yield (
            f"{copy} is a copy of {of}{more}: differences count copies as one "
            "drive, the means of rates do not"
        )


def _misfits(drives: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield on which drives truth or masks do not fit the images, with what the first one says."""
    rows = [row for row in drives if row["misfits"]]
    if rows:
        named = listing([row["drive"] for row in rows[:WARNINGS]])
        more = f" and {len(rows) - WARNINGS} more" if len(rows) > WARNINGS else ""
        first = rows[0]["misfits"].splitlines()[0]
        where = f"{len(rows)} of {len(drives)} drives ({named}{more})"
        yield f"Truth or masks do not fit the images on {where}: {first}"


def _of_drives(drives: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield the drives' own warnings, those that differ by numbers alone together."""
    alike: dict[str, list[tuple[str, str]]] = {}
    for row in drives:
        for sentence in (row["warnings"] or "").splitlines():
            alike.setdefault(re.sub(r"\d+", "", sentence), []).append((row["drive"], sentence))
    ranked = sorted(alike.values(), key=lambda own: -len(own))
    for own in ranked[:WARNINGS]:
        drive, sentence = own[0]
        more = f" (and {len(own) - 1} more alike)" if len(own) > 1 else ""
        yield f"{drive}{more}: {sentence}"
    if len(ranked) > WARNINGS:
        yield f"{len(ranked) - WARNINGS} other warnings of drives: see drives.parquet"

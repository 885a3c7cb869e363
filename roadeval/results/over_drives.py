"""The facts of many drives, made of their tables."""

from __future__ import annotations

import math
import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from roadeval.data import OUTCOMES, Counts
from roadeval.evaluation import metrics
from roadeval.evaluation.metrics import METRICS
from roadeval.evaluation.regions import ALL
from roadeval.evaluation.score import TESTED, Effect, corrected
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats import Difference, DriveMean, over_drives, strata
from roadeval.results.facts import FleetFacts, Member, StratumFacts, Totals
from roadeval.results.schema import FAILED
from roadeval.results.sentences import verdict
from roadeval.results.tables import read_parquet
from roadeval.version import VERSION

if TYPE_CHECKING:
    import pyarrow as pa

WARNINGS: Final = 5
"""Kinds of warnings of single drives that are listed."""
Rows = list[dict[str, Any]]


def summarise(
    folder: Path,
    drives: Rows,
    members: Sequence[Member],
    settings: EvaluationSettings,
    run: dict[str, Any],
) -> FleetFacts:
    """Make the facts of a fleet of the tables in its folder, and the rows of ``drives``."""
    rows: defaultdict[Key, Rows] = defaultdict(list)
    for row in final_rows(read_parquet(folder / "effects.parquet", "effects")):
        rows[row["base"], row["variant"], row["metric"]].append(row)
    # Drives whose log has the digest of another one's, and the first of these.
    firsts = {row["log_digest"]: row["drive"] for row in reversed(drives) if row["log_digest"]}
    known = {row["drive"]: firsts[row["log_digest"]] for row in drives if row["log_digest"]}
    copies = {drive: first for drive, first in known.items() if drive != first}
    cameras = {row["drive"]: row["camera"] for row in drives}
    groups = {each.drive: each.group or copies.get(each.drive, each.drive) for each in members}
    effects, totals = _effects(rows, groups, settings), _totals(folder)
    return FleetFacts(
        verdict=verdict(totals, effects),
        version=VERSION,
        drives=[*members],
        counts=dict(Counter(drive["status"] for drive in drives)),
        frames=sum(drive["evaluated"] or 0 for drive in drives),
        failed={d["drive"]: d["reason"] for d in drives if d["status"] == FAILED},
        totals=totals,
        effects=effects,
        strata=[*_strata(rows, members, groups, settings.confidence)],
        warnings=[*_of_copies(copies, cameras), *_of_drives(drives)],
        run=run,
    )


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


def _of_drives(drives: Rows) -> Iterator[str]:
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


Key = tuple[str, str, str]
"""Base, variant and metric of a difference of final masks."""


def _effects(
    effects: Mapping[Key, Rows], groups: Mapping[str, str], settings: EvaluationSettings
) -> list[Effect]:
    """Return the differences of final masks by their base: within the drive, or over drives."""
    found: defaultdict[str, dict[str, Effect]] = defaultdict(dict)
    several = len({row["drive"] for rows in effects.values() for row in rows}) > 1
    for (base, variant, metric), rows in effects.items():
        first = rows[0]
        made = Effect(base, variant, first["stage"], True, {})
        each = found[base].setdefault(variant, made)
        difference = _within(first, settings)
        if several:
            means, better = [_mean(row, groups) for row in rows], METRICS[metric].higher_is_better
            difference = over_drives(means, settings.confidence, higher_is_better=better)
        found[base][variant] = replace(each, rates={**each.rates, metric: difference})
    return [each for own in found.values() for each in corrected([*own.values()])]


def _within(row: Mapping[str, Any], settings: EvaluationSettings) -> Difference:
    """Return the difference of a fleet's only drive, which is the fleet's."""
    return Difference(
        mean=math.nan if row["mean"] is None else row["mean"],
        **{name: row[name] for name in ("low", "high", "p", "standard_error")},
        confidence=settings.confidence,
        unit="frames",
        units=row["frames"],
        worse=row["worse"],
        better=row["better"],
        equal=None if row["worse"] is None else row["frames"] - row["worse"] - row["better"],
        effective=row["effective_frames"],
        needed=settings.least_frames if row["low"] is None else None,
    )


def _mean(row: Mapping[str, Any], groups: Mapping[str, str]) -> DriveMean:
    mean = math.nan if row["mean"] is None else row["mean"]
    return DriveMean(row["drive"], groups[row["drive"]], mean)


def _strata(
    effects: Mapping[Key, Rows],
    members: Sequence[Member],
    groups: Mapping[str, str],
    confidence: float,
) -> Iterator[StratumFacts]:
    """Divide the drives by each tag, for each difference of ERR."""
    tags_of = {member.drive: member.tags for member in members}
    keys = sorted({key for tags in tags_of.values() for key in tags})
    for (base, variant, metric), rows in effects.items():
        if metric == TESTED:
            own = [_mean(row, groups) for row in rows]
            tags = {key: [tags_of[each.drive].get(key) for each in own] for key in keys}
            yield from (
                StratumFacts(base, variant, *each) for each in strata(own, tags, confidence)
            )


def _totals(folder: Path) -> Totals:
    """Return the rates of each final mask: the drives' mean, and of all pixels together."""
    masks: defaultdict[tuple[str, str], Rows] = defaultdict(list)
    columns = ["variant", "stage", "final", "region", "frames", *OUTCOMES, *METRICS]
    for row in final_rows(read_parquet(folder / "scores.parquet", "scores", columns)):
        masks[row["variant"], row["stage"]].append(row)
    return {variant: {stage: _over_all(own)} for (variant, stage), own in masks.items()}


def _over_all(rows: Rows) -> dict[str, Any]:
    counts = Counts(*(sum(row[name] for row in rows) for name in OUTCOMES))
    known = {name: [row[name] for row in rows if row[name] is not None] for name in METRICS}
    return {
        "drives": len(rows),
        "frames": sum(row["frames"] for row in rows),
        **{name: math.fsum(own) / len(own) if own else None for name, own in known.items()},
        **{f"pooled_{name}": rate for name, rate in metrics.of(counts).items()},
    }


def final_rows(table: pa.Table) -> Rows:
    """Return the rows of the final masks, on all pixels where the table has regions."""
    from pyarrow import compute

    table = table.filter(table["final"])
    if "region" in table.column_names:
        table = table.filter(compute.equal(table["region"], ALL))
    rows: Rows = table.to_pylist()
    return rows

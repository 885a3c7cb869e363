"""The facts of many drives, made of their tables' rows."""

from __future__ import annotations

import math
import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np

from roadeval.data import OUTCOMES, as_tree
from roadeval.data.words import listing
from roadeval.evaluation import metrics
from roadeval.evaluation.metrics import METRICS
from roadeval.evaluation.score import TESTED, Effect, corrected
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats import Difference, DriveMean, over_drives, strata
from roadeval.results.facts import FleetFacts, Member, StratumFacts
from roadeval.results.schema import FAILED
from roadeval.results.sentences import verdict
from roadeval.version import VERSION

WARNINGS: Final = 5
"""Kinds of warnings of single drives that are listed."""
Rows = Sequence[Mapping[str, Any]]


def summarise(
    tables: Mapping[str, Rows],
    members: Sequence[Member],
    settings: EvaluationSettings,
    run: dict[str, Any],
) -> FleetFacts:
    """Make the facts of a fleet.

    ``tables`` has the rows of ``drives``, and of ``scores`` and ``effects`` those of final masks,
    on all pixels.
    """
    drives = tables["drives"]
    # Drives whose log has the digest of another one's, and the first of these.
    firsts = {row["log_digest"]: row["drive"] for row in reversed(drives) if row["log_digest"]}
    known = {row["drive"]: firsts[row["log_digest"]] for row in drives if row["log_digest"]}
    copies = {drive: first for drive, first in known.items() if drive != first}
    cameras = {row["drive"]: row["camera"] for row in drives}
    groups = {each.drive: each.group or copies.get(each.drive, each.drive) for each in members}
    several = len({row["drive"] for row in tables["effects"]}) > 1
    tags_of = {member.drive: member.tags for member in members}
    keys = sorted({key for tags in tags_of.values() for key in tags})
    effects: defaultdict[str, list[Effect]] = defaultdict(list)
    parts: list[StratumFacts] = []
    for (base, variant), rows in _by(tables["effects"], "base", "variant").items():
        rates = {}
        for (rate,), own in _by(rows, "metric").items():
            means = [DriveMean(e["drive"], groups[e["drive"]], _number(e["mean"])) for e in own]
            rates[rate] = _within(own[0], settings)
            if several:
                better = METRICS[rate].higher_is_better
                rates[rate] = over_drives(means, settings.confidence, higher_is_better=better)
            if rate == TESTED:
                tags = {key: [tags_of[each.drive].get(key) for each in means] for key in keys}
                found = strata(means, tags, settings.confidence)
                parts += (StratumFacts(base, variant, *each) for each in found)
        effects[base].append(Effect(base, variant, rows[0]["stage"], final=True, rates=rates))
    differences = [each for own in effects.values() for each in corrected(own)]
    masks = _by(tables["scores"], "variant", "stage")
    totals = as_tree((mask, _over_all(rows)) for mask, rows in masks.items())
    return FleetFacts(
        verdict=" ".join([*_misfits(drives), verdict(totals, differences)]),
        version=VERSION,
        drives=[*members],
        counts=dict(Counter(drive["status"] for drive in drives)),
        frames=sum(drive["evaluated"] or 0 for drive in drives),
        failed={d["drive"]: d["reason"] for d in drives if d["status"] == FAILED},
        totals=totals,
        effects=differences,
        strata=parts,
        warnings=[*_of_copies(copies, cameras), *_of_drives(drives)],
        run=run,
    )


def _by(rows: Rows, *names: str) -> dict[Any, list[Mapping[str, Any]]]:
    """Return rows by the values of some columns, as they first occur."""
    found = defaultdict[Any, list[Mapping[str, Any]]](list)
    for row in rows:
        found[tuple(row[name] for name in names)].append(row)
    return found


def _number(value: float | None) -> float:
    return math.nan if value is None else value


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


def _misfits(drives: Rows) -> Iterator[str]:
    """Yield on which drives truth or masks do not fit the images, with what the first one says."""
    rows = [row for row in drives if row["misfits"]]
    if rows:
        named = listing([row["drive"] for row in rows[:WARNINGS]])
        more = f" and {len(rows) - WARNINGS} more" if len(rows) > WARNINGS else ""
        first = rows[0]["misfits"].splitlines()[0]
        where = f"{len(rows)} of {len(drives)} drives ({named}{more})"
        yield f"Truth or masks do not fit the images on {where}: {first}"


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


def _within(row: Mapping[str, Any], settings: EvaluationSettings) -> Difference:
    """Return the difference of a fleet's only drive, which is the fleet's."""
    return Difference(
        mean=_number(row["mean"]),
        **{name: row[name] for name in ("low", "high", "p", "standard_error", "worse", "better")},
        confidence=settings.confidence,
        unit="frames",
        units=row["frames"],
        equal=None if row["worse"] is None else row["frames"] - row["worse"] - row["better"],
        effective=row["effective_frames"],
        needed=settings.least_frames if row["low"] is None else None,
    )


def _over_all(rows: Rows) -> dict[str, Any]:
    """Return the rates of a final mask: the drives' mean, and of all pixels together."""
    counts = np.array([sum(row[name] for row in rows) for name in OUTCOMES])
    known = {name: [row[name] for row in rows if row[name] is not None] for name in METRICS}
    return {
        "drives": len(rows),
        "frames": sum(row["frames"] for row in rows),
        **{name: math.fsum(own) / len(own) if own else None for name, own in known.items()},
        **metrics.pooled(counts),
    }

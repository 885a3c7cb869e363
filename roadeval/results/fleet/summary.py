"""The summary of a fleet: what all its drives together tell."""

from __future__ import annotations

import math
import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final

from roadeval.data import OUTCOMES, Counts
from roadeval.evaluation import metrics
from roadeval.evaluation.metrics import METRICS
from roadeval.evaluation.score import TESTED, Effect, corrected
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats import Difference, DriveMean, Stratum, over_drives, strata
from roadeval.results.fleet.record import FAILED
from roadeval.results.fleet.tables import Member
from roadeval.results.schema import ALL, LIGHT, TAG
from roadeval.results.sentences import verdict
from roadeval.results.tables import read_parquet
from roadeval.version import VERSION

WARNINGS: Final = 5
"""Kinds of warnings of single drives that the summary has."""
Rows = list[dict[str, Any]]


def summarise(
    folder: Path, members: Sequence[Member], settings: EvaluationSettings
) -> dict[str, Any]:
    """Return the content of ``fleet.json``, but for its format and settings, from the tables."""
    columns = ["drive", "status", "reason", "evaluated", "sha256", "warnings"]
    columns += [column.name for column in LIGHT]
    drives: Rows = read_parquet(folder / "drives.parquet", "drives", columns).to_pylist()
    known = {member.drive: member for member in members}
    rows = _final_effects(folder)
    copies = _copies(drives)
    groups = {drive: member.group or copies.get(drive, drive) for drive, member in known.items()}
    effects = _effects(rows, groups, settings)
    rates = _rates(folder)
    totals: dict[str, dict[str, Any]] = {}
    for each in rates:
        totals.setdefault(each["variant"], {})[each["stage"]] = each
    summary: dict[str, Any] = {
        "version": VERSION,
        "drives": [_member(member) for member in members],
        "counts": dict(Counter(drive["status"] for drive in drives)),
        "frames": sum(drive["evaluated"] or 0 for drive in drives),
        "failed": {d["drive"]: d["reason"] for d in drives if d["status"] == FAILED},
        "rates": rates,
        "effects": [
            _named(each.base, each.variant, each.stage, rate)
            | asdict(difference)
            | _pooled(rows[each.base, each.variant, rate])
            for each in effects
            for rate, difference in each.rates.items()
        ],
        "strata": _strata(rows, drives, known, groups, settings.confidence),
        "warnings": [*_of_copies(copies), *_of_drives(drives)],
    }
    return {"verdict": verdict(totals, effects, settings)} | summary


def _copies(drives: Rows) -> dict[str, str]:
    """Return drives whose log is another one's, byte for byte, and the first of these."""
    logs: dict[str, str] = {}
    for row in drives:
        if row["sha256"]:
            logs.setdefault(row["sha256"], row["drive"])
    firsts = {row["drive"]: str(logs.get(row["sha256"], row["drive"])) for row in drives}
    return {drive: first for drive, first in firsts.items() if drive != first}


def _of_copies(copies: Mapping[str, str]) -> Iterator[str]:
    if copies:
        copy, of = next(iter(copies.items()))
        count = len(copies)
        more = f", and {count - 1} more are copies, too" if count > 1 else ""
        yield (
            f"{copy} is a copy of {of}, byte for byte{more}: differences count copies as one "
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


def _final_effects(folder: Path) -> dict[Key, Rows]:
    """Return the rows of the final masks' differences by what they are of."""
    found: defaultdict[Key, Rows] = defaultdict(list)
    for row in final_rows(folder / "effects.parquet"):
        found[row["base"], row["variant"], row["metric"]].append(row)
    return dict(found)


def _effects(
    effects: Mapping[Key, Rows], groups: Mapping[str, str], settings: EvaluationSettings
) -> list[Effect]:
    """Return the differences of final masks by their base: within the drive, or over drives."""
    found: defaultdict[str, dict[str, Effect]] = defaultdict(dict)
    several = len({row["drive"] for rows in effects.values() for row in rows}) > 1
    for (base, variant, metric), rows in effects.items():
        first = rows[0]
        made = Effect(base, first["stage"], variant, first["stage"], True, {})
        each = found[base].setdefault(variant, made)
        difference = _over(rows, groups, settings) if several else _within(rows[0], settings)
        found[base][variant] = replace(each, rates={**each.rates, metric: difference})
    return [each for own in found.values() for each in corrected([*own.values()])]


def _over(rows: Rows, groups: Mapping[str, str], settings: EvaluationSettings) -> Difference:
    means = [_mean(row, groups) for row in rows]
    better = METRICS[rows[0]["metric"]].higher_is_better
    return over_drives(means, settings.confidence, higher_is_better=better)


def _within(row: Mapping[str, Any], settings: EvaluationSettings) -> Difference:
    """Return the difference of a fleet's only drive, which is the fleet's."""
    return Difference(
        mean=math.nan if row["mean"] is None else row["mean"],
        **{name: row[name] for name in ("low", "high", "p", "standard_error")},
        confidence=settings.confidence,
        unit="frames",
        units=row["frames"],
        effective=row["effective_frames"],
        needed=settings.least_frames if row["low"] is None else None,
    )


def _mean(row: Mapping[str, Any], groups: Mapping[str, str]) -> DriveMean:
    mean = math.nan if row["mean"] is None else row["mean"]
    return DriveMean(row["drive"], groups[row["drive"]], mean)


def _pooled(rows: Rows) -> dict[str, float | None]:
    """Return the difference of the rates of all pixels together."""
    names = ("wrong", "N", "base_wrong", "base_N")
    wrong, n, base_wrong, base_n = (sum(row[name] or 0 for row in rows) for name in names)
    known = rows[0]["metric"] == TESTED and n and base_n
    return {"pooled": wrong / n - base_wrong / base_n if known else None}


def _named(base: str, variant: str, stage: str, metric: str) -> dict[str, Any]:
    return {"base": base, "variant": variant, "stage": stage, "metric": metric}


def _strata(
    effects: Mapping[Key, Rows],
    drives: Rows,
    known: Mapping[str, Member],
    groups: Mapping[str, str],
    confidence: float,
) -> Rows:
    """Divide the drives by each tag and by the measured light, for each difference of ERR."""
    light = {drive["drive"]: drive for drive in drives}
    keys = sorted({key for member in known.values() for key in member.tags})
    found = []
    for (base, variant, metric), rows in effects.items():
        if metric != TESTED:
            continue
        own = [_mean(row, groups) for row in rows]
        tags = {key: [known[e.drive].tags.get(key) for e in own] for key in keys}
        conditions = {c.name: [light[e.drive][c.name] for e in own] for c in LIGHT}
        named = _named(base, variant, rows[0]["stage"], metric)
        divided = strata(own, tags, conditions, confidence)
        found += [named | _stratum(each, is_tag=each.by in tags) for each in divided]
    return found


def _stratum(each: Stratum, *, is_tag: bool) -> dict[str, Any]:
    return {
        "by": f"{TAG}{each.by}" if is_tag else each.by,
        "value": str(each.value),
        "least": each.least,
        "most": each.most,
        **asdict(each.difference),
    }


def _rates(folder: Path) -> Rows:
    """Return the rates of each final mask: the drives' mean, and of all pixels together."""
    sums: dict[tuple[str, str], _Rates] = {}
    columns = ["variant", "stage", "final", "region", "frames", *OUTCOMES, *METRICS]
    for row in final_rows(folder / "scores.parquet", columns):
        sums.setdefault((row["variant"], row["stage"]), _Rates()).add(row)
    return [
        {"variant": variant, "stage": stage, **each.row()}
        for (variant, stage), each in sums.items()
    ]


def final_rows(path: Path, columns: Sequence[str] | None = None) -> Rows:
    """Return the rows of the final masks, on all pixels where the table has regions."""
    from pyarrow import compute

    table = read_parquet(path, path.stem, None if columns is None else [*columns])
    table = table.filter(table["final"])
    if "region" in table.column_names:
        table = table.filter(compute.equal(table["region"], ALL))
    rows: Rows = table.to_pylist()
    return rows


class _Rates:
    """Rates of one mask, summed up over drives."""

    def __init__(self) -> None:
        self._drives = self._frames = 0
        self._counts: Counter[str] = Counter()
        self._sums: defaultdict[str, list[float]] = defaultdict(list)

    def add(self, row: Mapping[str, Any]) -> None:
        self._drives += 1
        self._frames += row["frames"]
        self._counts.update({name: row[name] for name in OUTCOMES})
        for name in METRICS:
            if row[name] is not None:
                self._sums[name].append(row[name])

    def row(self) -> dict[str, Any]:
        counts = Counts(*(self._counts[name] for name in OUTCOMES))
        means = {
            name: math.fsum(self._sums[name]) / len(self._sums[name]) if self._sums[name] else None
            for name in METRICS
        }
        pooled = {f"pooled_{name}": value for name, value in metrics.of(counts).items()}
        return {"drives": self._drives, "frames": self._frames, **means, **pooled}


def _member(member: Member) -> dict[str, Any]:
    return {
        "drive": member.drive,
        "name": member.name,
        "source": member.source,
        "group": member.group,
        "tags": dict(member.tags),
    }

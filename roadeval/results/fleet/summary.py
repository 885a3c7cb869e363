"""The summary of a fleet: what all its drives together tell."""

from __future__ import annotations

import math
import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from roadeval.data import Counts
from roadeval.data.counts import OUTCOMES
from roadeval.evaluation import metrics
from roadeval.evaluation.drives import (
    AcrossSettings,
    DriveEffect,
    Stratum,
    across_drives,
    strata,
)
from roadeval.evaluation.metrics import METRICS
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.results.fleet.record import FAILED
from roadeval.results.fleet.tables import Member
from roadeval.results.fleet.verdict import verdict_of
from roadeval.results.schema import ALL, LIGHT, TAG
from roadeval.results.tables import read_parquet
from roadeval.version import VERSION

TESTED: Final = "ERR"
"""The rate whose differences are findings, as on a drive."""
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
    across = AcrossSettings(confidence=settings.confidence)
    effects = _final_effects(folder)
    copies = _copies(drives)
    groups = {drive: member.group or copies.get(drive, drive) for drive, member in known.items()}
    found = [_across(key, rows, groups, across) for key, rows in effects.items()]
    summary: dict[str, Any] = {
        "version": VERSION,
        "drives": [_member(member) for member in members],
        "counts": dict(Counter(drive["status"] for drive in drives)),
        "frames": sum(drive["evaluated"] or 0 for drive in drives),
        "failed": {d["drive"]: d["reason"] for d in drives if d["status"] == FAILED},
        "rates": _rates(folder),
        "effects": found,
        "strata": _strata(effects, drives, known, groups, across),
        "warnings": [*_of_copies(copies), *_of_drives(drives)],
    }
    return {"verdict": verdict_of(summary, settings)} | summary


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


def drive_effect(row: Mapping[str, Any], group: str | None, *, counted: bool) -> DriveEffect:
    """Return a drive's difference from its row of ``effects``.

    With ``counted`` the pixels are given, for the difference of pooled rates: of ERR alone.
    """
    counts = counted and row["metric"] == TESTED and row["N"] and row["base_N"]
    return DriveEffect(
        row["drive"],
        group or row["drive"],
        math.nan if row["mean"] is None else row["mean"],
        row["frames"],
        (row["base_wrong"], row["base_N"]) if counts else None,
        (row["wrong"], row["N"]) if counts else None,
    )


Key = tuple[str, str, str, str, str]
"""Kind, variant, stage, base and metric of a difference."""


def _final_effects(folder: Path) -> dict[Key, Rows]:
    """Return the rows of the final masks' differences by what they are of."""
    found: defaultdict[Key, Rows] = defaultdict(list)
    for row in final_rows(folder / "effects.parquet"):
        key = tuple(row[name] for name in ("kind", "variant", "stage", "base", "metric"))
        found[key].append(row)
    return dict(found)


def _across(
    key: Key, rows: Rows, groups: Mapping[str, str], settings: AcrossSettings
) -> dict[str, Any]:
    kind, variant, stage, base, metric = key
    effects = [drive_effect(row, groups[row["drive"]], counted=True) for row in rows]
    better = METRICS[metric].higher_is_better
    across = across_drives(effects, settings, higher_is_better=better)
    named = {"kind": kind, "variant": variant, "stage": stage, "base": base, "metric": metric}
    return named | asdict(across)


def _strata(
    effects: Mapping[Key, Rows],
    drives: Rows,
    known: Mapping[str, Member],
    groups: Mapping[str, str],
    settings: AcrossSettings,
) -> Rows:
    """Divide the drives by each tag and by the measured light, for each difference of ERR."""
    light = {drive["drive"]: drive for drive in drives}
    keys = sorted({key for member in known.values() for key in member.tags})
    found = []
    for (kind, variant, stage, base, metric), rows in effects.items():
        if metric != TESTED:
            continue
        own = [drive_effect(row, groups[row["drive"]], counted=False) for row in rows]
        tags = {key: [known[e.drive].tags.get(key) for e in own] for key in keys}
        conditions = {c.name: [light[e.drive][c.name] for e in own] for c in LIGHT}
        named = {"kind": kind, "variant": variant, "stage": stage, "base": base, "metric": metric}
        divided = strata(own, tags, conditions, settings)
        found += [named | _stratum(each, is_tag=each.by in tags) for each in divided]
    return found


def _stratum(each: Stratum, *, is_tag: bool) -> dict[str, Any]:
    return {
        "by": f"{TAG}{each.by}" if is_tag else each.by,
        "value": str(each.value),
        "least": each.least,
        "most": each.most,
        "p_holm": each.p_holm,
        "comparisons": each.comparisons,
        **asdict(each.across),
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

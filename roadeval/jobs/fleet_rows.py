"""A drive's rows of its fleet's tables, from what its replay found."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from roadeval.data import BASELINE, FILTERED, UNFILTERED, Counts
from roadeval.data.counts import OUTCOMES
from roadeval.evaluation import metrics
from roadeval.evaluation.differences import final_stages
from roadeval.fleet.entry import DriveEntry
from roadeval.jobs.replay import Outcome
from roadeval.results.fleet.record import DAMAGED, FAILED, SCORED, UNSCORED
from roadeval.results.fleet.schema import ALL
from roadeval.results.reading import arrow_schema
from roadeval.results.schema import TABLES

FILTER: Final = "filter"
BLIND: Final = "blind"
LOST: Final = 3
"""Exit code of a replay that has lost a part of its log."""


def drive_row(outcome: Outcome, entry: DriveEntry) -> dict[str, Any]:
    """Return the row of a drive that was replayed."""
    summary = outcome.summary
    scored = bool(summary["totals"])
    status = (DAMAGED if outcome.losses else SCORED) if scored else UNSCORED
    missing = next((w for w in outcome.warnings if not scored), None)
    known = {name: summary["drive"][name] for name in ("rate_hz", "width", "height")}
    counted = ("in_log", "read", "decoded", "labelled", "trained_on", "evaluated")
    return {
        "drive": entry.id,
        "name": entry.name,
        "source": entry.shown,
        "status": status,
        "exit_code": LOST if outcome.losses else 0,
        "reason": missing,
        "sha256": summary["log"]["sha256"],
        **known,
        **{name: summary["frames"][name] for name in counted},
        "losses": "\n".join(outcome.losses) or None,
        "warnings": "\n".join(outcome.warnings) or None,
        "verdict": summary["verdict"],
    }


def failed_row(entry: DriveEntry, reason: str, exit_code: int, attempts: int) -> dict[str, Any]:
    """Return the row of a drive that could not be used."""
    return {
        "drive": entry.id,
        "name": entry.name,
        "source": entry.shown,
        "status": FAILED,
        "exit_code": exit_code,
        "reason": reason,
        "attempts": attempts,
    }


def score_rows(drive: str, summary: Mapping[str, Any], results: Path) -> Iterator[dict[str, Any]]:
    """Yield the rows of ``scores``: each mask on every labelled pixel, then region by region.

    Parameters
    ----------
    drive
        Its name in the fleet.
    summary, results
        What its replay found, and where the tables lie.
    """
    totals, beyond = summary["totals"], summary["beyond"]
    stages = _final_stages(summary)
    parts = _regions(results / "regions.csv") if totals else {}
    for variant, own in totals.items():
        for stage, total in own.items():
            final = stages[variant] == stage
            mask = {"drive": drive, "variant": variant, "stage": stage, "final": final}
            rates = {key: total[key] for key in total if key not in ("N", "undefined")}
            further = _further(beyond.get(variant, {})) if final else {}
            yield {**mask, "region": ALL, "N": total["N"], **rates, **further}
            for region, sums in parts.get((variant, stage), {}).items():
                yield {**mask, "region": region, **sums.row()}


def effect_rows(drive: str, summary: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the rows of ``effects``: the filter's by stage, and each variant's against blind."""
    totals, stages = summary["totals"], _final_stages(summary)
    for stage, rates in summary["difference"].items():
        pair = (FILTERED, stage), (UNFILTERED, stage)
        yield from _effects(
            drive, FILTER, *pair, rates, totals=totals, final=stages[FILTERED] == stage
        )
    for variant, rates in summary["against_blind"].items():
        pair = (variant, stages[variant]), (BASELINE, stages[BASELINE])
        yield from _effects(drive, BLIND, *pair, rates, totals=totals, final=True)


def _effects(
    drive: str,
    kind: str,
    mask: tuple[str, str],
    base: tuple[str, str],
    rates: Mapping[str, Mapping[str, Any]],
    *,
    totals: Mapping[str, Any],
    final: bool,
) -> Iterator[dict[str, Any]]:
    mine, theirs = totals[mask[0]][mask[1]], totals[base[0]][base[1]]
    copied = ("mean", "standard_error", "low", "high", "p", "frames", "effective_frames")
    for metric, found in rates.items():
        yield {
            "drive": drive,
            "kind": kind,
            "variant": mask[0],
            "stage": mask[1],
            "final": final,
            "base": base[0],
            "metric": metric,
            **{name: found[name] for name in copied},
            "base_wrong": theirs["FP"] + theirs["FN"],
            "base_N": theirs["N"],
            "wrong": mine["FP"] + mine["FN"],
            "N": mine["N"],
        }


def _final_stages(summary: Mapping[str, Any]) -> dict[str, str]:
    totals = summary["totals"]
    return final_stages((variant, stage) for variant, own in totals.items() for stage in own)


def _further(beyond: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "boundary_f": beyond.get("boundary_F"),
        "flicker": beyond.get("flicker"),
        "truth_flicker": beyond.get("truth_flicker"),
    }


class _Sums:
    """The counts of a mask in a region, summed up, and its frames' rates."""

    def __init__(self) -> None:
        self.frames = 0
        self.counts = np.zeros(4, np.int64)
        self.rates = np.zeros(len(metrics.METRICS))
        self.defined = np.zeros(len(metrics.METRICS), np.int64)

    def add(self, counts: Any) -> None:
        """Add frames, ``(n, 4)``; those without a labelled pixel in the region do not count."""
        counts = counts[counts.any(axis=1)]
        rates = metrics.table(counts)
        known = ~np.isnan(rates)
        self.frames += len(counts)
        self.counts += counts.sum(axis=0)
        self.rates += np.where(known, rates, 0).sum(axis=0)
        self.defined += known.sum(axis=0)

    def row(self) -> dict[str, Any]:
        pooled = Counts(*self.counts.tolist())
        means = [
            total / count if count else None
            for total, count in zip(self.rates.tolist(), self.defined.tolist(), strict=True)
        ]
        return {
            "frames": self.frames,
            **dict(zip(OUTCOMES, self.counts.tolist(), strict=True)),
            "N": pooled.n,
            **dict(zip(metrics.METRICS, means, strict=True)),
            **{f"pooled_{name}": value for name, value in metrics.of(pooled).items()},
        }


def _regions(path: Path) -> dict[tuple[str, str], dict[str, _Sums]]:
    """Sum up ``regions.csv`` by mask and region, in pieces: it may have millions of rows."""
    from pyarrow import csv

    sums: defaultdict[tuple[str, str], dict[str, _Sums]] = defaultdict(dict)
    convert = csv.ConvertOptions(column_types=arrow_schema(TABLES["regions"]))
    with csv.open_csv(path, convert_options=convert) as batches:
        for batch in batches:
            names = zip(
                *(batch[name].to_pylist() for name in ("variant", "stage", "region")), strict=True
            )
            places: defaultdict[tuple[str, str, str], list[int]] = defaultdict(list)
            for place, name in enumerate(names):
                places[name].append(place)
            counts = np.stack([batch[name].to_numpy() for name in OUTCOMES], axis=1)
            for (variant, stage, region), rows in places.items():
                own = sums[variant, stage].setdefault(region, _Sums())
                own.add(counts[rows])
    return sums

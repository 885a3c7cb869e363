"""The facts of many drives, made of their tables; the same as flat JSON and cases for CI."""

from __future__ import annotations

import math
import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from roadeval.data import FILTERED, OUTCOMES, UNFILTERED, Counts
from roadeval.data.words import defined
from roadeval.evaluation import metrics
from roadeval.evaluation.comparison import (
    Change,
    Condition,
    ConditionError,
    Judgement,
    judge_mask,
)
from roadeval.evaluation.metrics import METRICS
from roadeval.evaluation.regions import ALL
from roadeval.evaluation.score import TESTED, Effect, corrected
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats import Difference, DriveMean, over_drives, strata
from roadeval.results.comparison import Case, judged
from roadeval.results.facts import ConditionFacts, FleetFacts, Member, OverDrives, StratumFacts
from roadeval.results.schema import DAMAGED, FAILED, LIGHT, TAG, UNSCORED
from roadeval.results.sentences import verdict
from roadeval.results.tables import read_parquet
from roadeval.version import VERSION

if TYPE_CHECKING:
    import pyarrow as pa

WARNINGS: Final = 5
"""Kinds of warnings of single drives that are listed."""
POOLED: Final = tuple(f"pooled_{name}" for name in METRICS)
Rows = list[dict[str, Any]]


def summarise(
    folder: Path,
    drives: Rows,
    members: Sequence[Member],
    settings: EvaluationSettings,
    *,
    run: dict[str, Any],
    conditions: list[ConditionFacts],
) -> FleetFacts:
    """Make the facts of a fleet of the tables in its folder, and the rows of ``drives``."""
    found: defaultdict[Key, Rows] = defaultdict(list)
    for row in final_rows(read_parquet(folder / "effects.parquet", "effects")):
        found[row["base"], row["variant"], row["metric"]].append(row)
    rows = dict(found)
    # Drives whose log has the digest of another one's, and the first of these.
    firsts = {row["log_digest"]: row["drive"] for row in reversed(drives) if row["log_digest"]}
    known = {row["drive"]: firsts[row["log_digest"]] for row in drives if row["log_digest"]}
    copies = {drive: first for drive, first in known.items() if drive != first}
    cameras = {row["drive"]: row["camera"] for row in drives}
    groups = {each.drive: each.group or copies.get(each.drive, each.drive) for each in members}
    effects = _effects(rows, groups, settings)
    rates = _rates(folder)
    totals: dict[str, dict[str, Any]] = {}
    for each in rates:
        totals.setdefault(each["variant"], {})[each["stage"]] = each
    return FleetFacts(
        verdict=verdict(totals, effects, settings),
        version=VERSION,
        drives=[*members],
        counts=dict(Counter(drive["status"] for drive in drives)),
        frames=sum(drive["evaluated"] or 0 for drive in drives),
        failed={d["drive"]: d["reason"] for d in drives if d["status"] == FAILED},
        rates=rates,
        effects=[
            OverDrives(
                **asdict(difference),
                **_named(each.base, each.variant, each.stage, rate),
                pooled=_pooled(rows[each.base, each.variant, rate]),
            )
            for each in effects
            for rate, difference in each.rates.items()
        ],
        strata=[*_strata(rows, drives, members, groups, settings.confidence)],
        warnings=[*_of_copies(copies, cameras), *_of_drives(drives)],
        conditions=conditions,
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
        made = Effect(base, first["stage"], variant, first["stage"], True, {})
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


def _pooled(rows: Rows) -> float | None:
    """Return the difference of the rates of all pixels together, where it is known."""
    names = ("wrong", "N", "base_wrong", "base_N")
    wrong, n, base_wrong, base_n = (sum(row[name] or 0 for row in rows) for name in names)
    known = rows[0]["metric"] == TESTED and n and base_n
    return wrong / n - base_wrong / base_n if known else None


def _named(base: str, variant: str, stage: str, metric: str) -> dict[str, Any]:
    return {"base": base, "variant": variant, "stage": stage, "metric": metric}


def _strata(
    effects: Mapping[Key, Rows],
    drives: Rows,
    members: Sequence[Member],
    groups: Mapping[str, str],
    confidence: float,
) -> Iterator[StratumFacts]:
    """Divide the drives by each tag and by the measured light, for each difference of ERR."""
    light = {drive["drive"]: drive for drive in drives}
    tags_of = {member.drive: member.tags for member in members}
    keys = sorted({key for tags in tags_of.values() for key in tags})
    for (base, variant, metric), rows in effects.items():
        if metric != TESTED:
            continue
        own = [_mean(row, groups) for row in rows]
        tags = {key: [tags_of[e.drive].get(key) for e in own] for key in keys}
        conditions = {c.name: [light[e.drive][c.name] for e in own] for c in LIGHT}
        for each in strata(own, tags, conditions, confidence):
            yield StratumFacts(
                **asdict(each.difference),
                **_named(base, variant, rows[0]["stage"], metric),
                by=f"{TAG}{each.by}" if each.by in tags else each.by,
                value=str(each.value),
                least=each.least,
                most=each.most,
            )


def _rates(folder: Path) -> Rows:
    """Return the rates of each final mask: the drives' mean, and of all pixels together."""
    masks: defaultdict[tuple[str, str], Rows] = defaultdict(list)
    columns = ["variant", "stage", "final", "region", "frames", *OUTCOMES, *METRICS]
    for row in final_rows(read_parquet(folder / "scores.parquet", "scores", columns)):
        masks[row["variant"], row["stage"]].append(row)
    return [
        {"variant": variant, "stage": stage, **_over_all(own)}
        for (variant, stage), own in masks.items()
    ]


def _over_all(rows: Rows) -> dict[str, Any]:
    counts = Counts(*(sum(row[name] for row in rows) for name in OUTCOMES))
    known = {name: [row[name] for row in rows if row[name] is not None] for name in METRICS}
    return {
        "drives": len(rows),
        "frames": sum(row["frames"] for row in rows),
        **{name: math.fsum(own) / len(own) if own else None for name, own in known.items()},
        **dict(zip(POOLED, metrics.of(counts).values(), strict=True)),
    }


def final_rows(table: pa.Table) -> Rows:
    """Return the rows of the final masks, on all pixels where the table has regions."""
    from pyarrow import compute

    table = table.filter(table["final"])
    if "region" in table.column_names:
        table = table.filter(compute.equal(table["region"], ALL))
    rows: Rows = table.to_pylist()
    return rows


NO_TRUTH: Final = "nothing can be checked, for no frame with truth was evaluated"


def check_conditions(conditions: Sequence[Condition]) -> None:
    """Raise a `ConditionError` for a condition on a change: one result alone has no base."""
    for condition in conditions:
        if condition.is_change:
            raise ConditionError(
                f"{condition.text}: a result alone has no base to have changed from; limit the "
                "rate in %, or compare two results with roadeval compare"
            )


def scores_of(folder: Path) -> Rows:
    """Return what conditions are judged on: the rows of ``scores`` in the folder of a fleet."""
    columns = ["drive", "variant", "stage", "final", "region", "frames", *OUTCOMES, *METRICS]
    rows: Rows = read_parquet(folder / "scores.parquet", "scores", [*columns, *POOLED]).to_pylist()
    return rows


def judge_drives(
    scores: Iterable[Mapping[str, Any]], conditions: Sequence[Condition], least: int
) -> Iterator[Judgement]:
    """Judge conditions on each scored drive: on the rates of its own frames.

    ``scores`` are rows of that table; the conditions are on levels alone, see `check_conditions`. A
    drive with fewer than ``least`` evaluated frames is not judged, and nothing is where no drive is
    scored. A `ConditionError` if nothing scored is the mask that a condition names.
    """
    rows = [row for row in scores if row["region"] == ALL]
    if conditions and not rows:
        every = ", ".join(condition.text for condition in conditions)
        yield Judgement.none(conditions[0], "", f"{every}: {NO_TRUTH}")
        return
    for condition in conditions:
        own = [
            r for r in rows if (r["stage"], r["variant"]) == (condition.stage, condition.variant)
        ]
        if not own:
            there = ", ".join(sorted({f"{row['stage']}.{row['variant']}" for row in rows}))
            raise ConditionError(
                f"{condition.text}: nothing scored is called {condition.stage}."
                f"{condition.variant}; there are {there or 'none'}"
            )
        yield from (_judged(condition, row, least) for row in own)


def _judged(condition: Condition, row: Mapping[str, Any], least: int) -> Judgement:
    rates = {name: math.nan if row[name] is None else row[name] for name in (*METRICS, *POOLED)}
    rates |= metrics.overlap(Counts(*(row[name] for name in OUTCOMES)))
    mask = Change(
        result=row["drive"],
        variant=row["variant"],
        stage=row["stage"],
        final=row["final"],
        drives=1,
        frames=row["frames"],
        base={},
        new=rates,
        difference={},
    )
    try:
        return judge_mask(condition, mask, (), least)
    except ConditionError as error:
        return Judgement.none(condition, row["drive"], error)


def flat_metrics(facts: FleetFacts) -> dict[str, float]:
    """Return a fleet's numbers under flat names, as ``filtered.post.ERR``.

    Rates are means over drives; ``effect.filter.post.ERR.mean`` and its likes are the differences.
    What is undefined is left out.
    """
    flat: dict[str, float | None] = {"drives": len(facts.drives), "frames": facts.frames}
    flat |= {f"drives_{status}": count for status, count in sorted(facts.counts.items())}
    for row in facts.rates:
        for name in (*METRICS, *POOLED):
            flat[f"{row['variant']}.{row['stage']}.{name}"] = row[name]
    for each in facts.effects:
        of_filter = (each.base, each.variant) == (UNFILTERED, FILTERED)
        whose = f"filter.{each.stage}" if of_filter else f"{each.base}.{each.variant}"
        begin = f"effect.{whose}.{each.metric}"
        for name in ("mean", "low", "high", "p", "pooled"):
            flat[f"{begin}.{name}"] = getattr(each, name)
    return {name: value for name, value in flat.items() if defined(value)}


_OF_STATUS: Final = {
    FAILED: ("error", "reason"),
    UNSCORED: ("skipped", "reason"),
    DAMAGED: ("system-err", "losses"),
}
"""The element of a drive's case, and the column with its text."""


def drive_cases(
    drives: Iterable[Mapping[str, Any]], conditions: Iterable[Judgement] = ()
) -> Iterator[Case]:
    """Yield a case a drive, and a case a drive and condition.

    ``drives`` are rows of that table: one that failed is an error, one without a score is skipped.
    Where a condition holds its case fails, where it was not judged its case is skipped.
    """
    for row in drives:
        kind, column = _OF_STATUS.get(row["status"], ("", ""))
        parts = {kind: row[column]} if kind else {}
        if row["verdict"]:
            parts["system-out"] = row["verdict"]
        yield Case("replay", row["drive"], parts, row["seconds"])
    for each in conditions:
        kind = "failure" if each.holds else "skipped"
        said = {} if each.holds is False else {kind: judged(each)}
        yield Case(each.condition.text, each.result, said)

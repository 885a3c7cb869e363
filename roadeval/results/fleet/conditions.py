"""Conditions judged on every drive of a fleet by itself."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from roadeval.data import OUTCOMES, Counts
from roadeval.evaluation import metrics
from roadeval.evaluation.comparison import Change, Condition, ConditionError
from roadeval.evaluation.metrics import METRICS
from roadeval.results.comparison import judged
from roadeval.results.schema import ALL
from roadeval.results.tables import read_parquet


@dataclass(frozen=True, slots=True)
class DriveJudgement:
    """A condition judged on a drive."""

    drive: str
    condition: str
    """Which."""
    holds: bool | None
    """Whether it holds; None where it was not judged."""
    sentence: str
    """What was found, or why it was not judged."""


def check_conditions(conditions: Sequence[Condition]) -> None:
    """Raise a `ConditionError` for a condition on a change: a fleet alone has no base."""
    for condition in conditions:
        if condition.is_change:
            raise ConditionError(
                f"{condition.text}: a fleet alone has no base to have changed from; limit the rate "
                "of its drives in %, or compare two fleets with roadeval compare"
            )


def judge_drives(
    folder: Path, conditions: Sequence[Condition], least: int
) -> Iterator[DriveJudgement]:
    """Judge conditions on each scored drive: on the rates of its own frames.

    Parameters
    ----------
    folder
        Of the fleet, its tables written.
    conditions
        On levels alone, see `check_conditions`.
    least
        Evaluated frames that it takes; a drive of fewer is not judged.

    Raises
    ------
    ConditionError
        If no drive has the mask that a condition names.
    """
    if not conditions:
        return
    columns = ["drive", "variant", "stage", "final", "region", "frames", *OUTCOMES, *METRICS]
    columns += [f"pooled_{name}" for name in METRICS]
    rows = [
        row
        for row in read_parquet(folder / "scores.parquet", "scores", columns).to_pylist()
        if row["region"] == ALL
    ]
    for condition in conditions:
        own = [
            r for r in rows if (r["stage"], r["variant"]) == (condition.stage, condition.variant)
        ]
        if not own:
            there = ", ".join(sorted({f"{row['stage']}.{row['variant']}" for row in rows}))
            raise ConditionError(
                f"{condition.text}: no drive has a mask {condition.stage}.{condition.variant}; "
                f"there are {there or 'none'}"
            )
        yield from (_judged(condition, row, least) for row in own)


def _judged(condition: Condition, row: Mapping[str, Any], least: int) -> DriveJudgement:
    drive = row["drive"]
    if row["frames"] < least:
        few = f"{row['frames']} evaluated frames, and {least} are needed"
        return DriveJudgement(drive, condition.text, None, f"not judged: {drive} has {few}")
    names = (*METRICS, *(f"pooled_{name}" for name in METRICS))
    rates = {name: math.nan if row[name] is None else row[name] for name in names}
    rates |= metrics.overlap(Counts(*(row[name] for name in OUTCOMES)))
    mask = Change(
        result=drive,
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
        judgement = condition.judge(mask)
    except ConditionError as error:
        return DriveJudgement(drive, condition.text, None, str(error))
    return DriveJudgement(drive, condition.text, judgement.holds, judged(judgement))

"""Everything that a report tells, found in a result's tables and masks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import BASELINE, FILTERED, UNFILTERED
from roadeval.evaluation import analysis
from roadeval.evaluation.maps import Maps
from roadeval.evaluation.scoreboard import COMPARED
from roadeval.opened import Opened
from roadeval.report.findings import Findings, Heat, Versus
from roadeval.reporting.looking import Looker, evenly, named, pipelines

if TYPE_CHECKING:
    import pandas as pd

SAMPLED: Final = 100
"""Frames whose masks are read for the maps, at most; tables know every frame."""
ROWS: Final = 30
"""Rows of the table over the drive, at most."""
EXAMPLES: Final = 4
THUMBNAILS: Final = 8
"""Frames in figure 2 and on the first page."""


def find(opened: Opened) -> Findings:
    """Find out everything that the report tells."""
    frames, summary = opened.frames, opened.summary
    numbers = _numbers(opened)
    maps = _maps(opened, numbers)
    scored = len(frames) > 0
    windows, rows = _windows(opened) if scored else (frames, 0)
    versus = _versus(frames, summary, maps) if scored else []
    look = Looker(opened)
    return Findings(
        source=str(opened.path),
        complete=opened.complete,
        pictured=len(numbers),
        summary=summary,
        properties=opened.properties,
        finals=analysis.final_stages(frames) if scored else {},
        windows=windows,
        rows=rows,
        versus=versus,
        regions=analysis.by_region(opened.regions) if len(opened.regions) else opened.regions,
        overlap={
            variant: {stage: analysis.overlap(total) for stage, total in stages.items()}
            for variant, stages in summary["totals"].items()
        },
        changes=_changes(maps),
        parts={
            name: named(analysis.causes(frames, name).mean().to_dict())
            for name in pipelines(frames)
        },
        heat=[
            Heat(name, each.share(each.fp), each.share(each.fn)) for name, each in maps.heat.items()
        ],
        oracles=opened.extra("oracles"),
        sampled=maps.frames,
        examples=look.examples(evenly(numbers, EXAMPLES)),
        thumbnails=look.thumbnails(evenly(numbers, THUMBNAILS)),
        worst=look.worst(),
        helped=look.moved(versus, harmed=False),
        harmed=look.moved(versus, harmed=True),
        coverage=_coverage(opened, numbers),
    )


def _numbers(opened: Opened) -> list[int]:
    """Give the evaluated frames that have pictures, or without truth all that have."""
    evaluated = set(opened.frames["frame"]) if len(opened.frames) else set(opened.pictured)
    return [number for number in opened.pictured if number in evaluated]


# --- Tables ---------------------------------------------------------------------------------------


def _windows(opened: Opened) -> tuple[pd.DataFrame, int]:
    """Give the drive's rows, coarser ones where the drive is long."""
    size = analysis.settings_of(opened.summary).window
    count = -(-opened.frames["frame"].nunique() // size)
    if count <= ROWS and len(opened.windows):
        return opened.windows, size
    size *= -(-count // ROWS)
    return analysis.rows(opened.frames, size), size


def _versus(frames: pd.DataFrame, summary: dict[str, Any], maps: Maps) -> list[Versus]:
    """Compare with the filter against without, then every variant with the baseline."""
    names = set(frames["variant"])
    wanted = [(FILTERED, UNFILTERED), *((name, BASELINE) for name in pipelines(frames))]
    settings, found = analysis.settings_of(summary), []
    for treated, control in wanted:
        if not {treated, control} <= names:
            continue
        paired = analysis.pairs(frames, treated, control)
        told = summary["difference"].get(analysis.final_stages(frames)[treated])
        if told is None or control != UNFILTERED:
            given = analysis.differences(paired, settings, COMPARED)
            told = {name: asdict(each) for name, each in given.items()}
        change = maps.paired.get((treated, control))
        pixels = (change.repaired, change.spoiled, change.labelled) if change else None
        found.append(Versus(treated, control, told, paired, pixels))
    return found


def _changes(maps: Maps) -> pd.DataFrame:
    import pandas as pd

    rows = [
        (*key, change.repaired / change.labelled, change.spoiled / change.labelled)
        for key, change in maps.changes.items()
        if change.labelled
    ]
    return pd.DataFrame(rows, columns=["variant", "before", "after", "repaired", "spoiled"])


# --- Masks and pictures ---------------------------------------------------------------------------


def _maps(opened: Opened, numbers: Sequence[int]) -> Maps:
    """Sum up the masks of evenly spread frames, which the tables do not hold."""
    maps, recording = Maps(), opened.recording
    if recording is None or not len(opened.frames):
        return maps
    for number in evenly(numbers, SAMPLED):
        masks = {
            variant.name: {
                stage: recording.layer(variant.name, stage, number) for stage in variant.stages
            }
            for variant in recording.variants
        }
        maps.add(recording.truth(number), masks)
    return maps


def _coverage(opened: Opened, numbers: Sequence[int]) -> pd.DataFrame:
    """Without truth: measure how much of the image each final mask covers."""
    import pandas as pd

    recording = opened.recording
    if recording is None or len(opened.frames):
        return pd.DataFrame()
    chosen = evenly(numbers, SAMPLED)
    return pd.DataFrame(
        {
            variant.name: [
                float(np.mean(recording.layer(variant.name, variant.stages[-1], number) == 1))
                for number in chosen
            ]
            for variant in recording.variants
        },
        index=pd.Index(chosen, name="frame"),
    )

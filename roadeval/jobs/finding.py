"""Everything that a report tells, found in a result's tables and masks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import BASELINE, FILTERED, UNFILTERED, TruthBits
from roadeval.data.packed import Packed
from roadeval.evaluation import analysis, counts, maps
from roadeval.evaluation.scoreboard import COMPARED
from roadeval.jobs.looking import Looker, evenly, named, pipelines
from roadeval.jobs.result import Opened
from roadeval.report.findings import Findings, Heat, Versus
from roadeval.results.lines import change_rows, heat_rows
from roadeval.results.reading import table_of

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
    changes, heat, sampled = _sums(opened, numbers)
    scored = len(frames) > 0
    windows, rows = _windows(opened) if scored else (frames, 0)
    versus = _versus(frames, summary, changes) if scored else []
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
        changes=_stages(changes),
        parts={
            name: named(analysis.causes(frames, name).mean().to_dict())
            for name in pipelines(frames)
        },
        heat=[_heat(str(name), cells) for name, cells in heat.groupby("variant", sort=False)]
        if len(heat)
        else [],
        oracles=analysis.oracles(opened.extra("oracles"), frames),
        beyond=summary.get("beyond", {}),
        sampled=sampled,
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


def _versus(frames: pd.DataFrame, summary: dict[str, Any], changes: pd.DataFrame) -> list[Versus]:
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
        found.append(Versus(treated, control, told, paired, _pixels(changes, treated, control)))
    return found


def _pixels(changes: pd.DataFrame, treated: str, control: str) -> tuple[int, int, int] | None:
    """Give newly right, newly wrong and all labelled pixels from a final mask to another."""
    if not len(changes):
        return None
    between = (changes["from_variant"] == control) & (changes["to_variant"] == treated)
    for repaired, spoiled, labelled in changes.loc[
        between & (changes["N"] > 0), ["repaired", "spoiled", "N"]
    ].to_numpy():
        return int(repaired), int(spoiled), int(labelled)
    return None


def _stages(changes: pd.DataFrame) -> pd.DataFrame:
    """Keep what stages changed, as shares of labelled pixels."""
    import pandas as pd

    if not len(changes):
        return pd.DataFrame()
    own = changes[(changes["from_variant"] == changes["to_variant"]) & (changes["N"] > 0)]
    return pd.DataFrame(
        {
            "variant": own["to_variant"],
            "before": own["from_stage"],
            "after": own["to_stage"],
            "repaired": own["repaired"] / own["N"],
            "spoiled": own["spoiled"] / own["N"],
        }
    )


# --- Masks and pictures ---------------------------------------------------------------------------


def _sums(opened: Opened, numbers: Sequence[int]) -> tuple[pd.DataFrame, pd.DataFrame, int]:
    """Give the tables ``changes`` and ``heat``, and the number of frames that they sum up.

    A run that was killed did not get to write them: they are made of the masks of evenly spread
    frames then.
    """
    changes, heat = opened.extra("changes"), opened.extra("heat")
    if len(changes) or len(heat):
        return changes, heat, opened.frames["frame"].nunique()
    sample = _sample(opened, numbers)
    changes = table_of("changes", change_rows(sample.changes))
    return changes, table_of("heat", heat_rows(sample.heat)), sample.frames


def _sample(opened: Opened, numbers: Sequence[int]) -> maps.Maps:
    """Sum up the masks of evenly spread frames."""
    found, recording = maps.Maps(), opened.recording
    if recording is None or not len(opened.frames):
        return found
    for number in evenly(numbers, SAMPLED):
        truth = recording.truth(number)
        masks = {
            (variant.name, stage): recording.layer(variant.name, stage, number)
            for variant in recording.variants
            for stage in variant.stages
        }
        finals = {variant: mask for (variant, _), mask in masks.items()}
        errors = {name: counts.error_map(mask, truth) for name, mask in finals.items()}
        packed = TruthBits.of(truth)
        stacked = packed.bits_of(map(Packed.of, masks.values()))
        found.add(errors, maps.changes(list(masks), stacked, packed))
    return found


def _heat(variant: str, cells: pd.DataFrame) -> Heat:
    """Spread the cells of a variant's heat map; NaN where none was labelled."""
    side = cells["side"].to_numpy()[0]
    rows, columns = (cells[edge].to_numpy() // side for edge in ("top", "left"))
    shares = np.full((2, rows.max() + 1, columns.max() + 1), np.nan)
    for share, outcome in zip(shares, ("FP", "FN"), strict=True):
        share[rows, columns] = cells[outcome] / cells["labelled"]
    return Heat(variant, shares[0], shares[1])


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

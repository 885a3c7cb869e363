"""The frames of compared results: rates over the drive, and a page with all masks side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from roadeval.data import BASELINE, ERRORS, Rows
from roadeval.data.rows import joined
from roadeval.evaluation import score
from roadeval.evaluation.comparison import Comparison, Side
from roadeval.evaluation.metrics import SHORT
from roadeval.evaluation.score import TESTED
from roadeval.evaluation.settings import NOTEWORTHY
from roadeval.jobs.report_frames import BYTES, PICTURED, fitting, outcomes, rates_by_frame
from roadeval.jobs.result import DriveResult
from roadeval.report.blocks import Strip
from roadeval.report.chart import Chart, Look, looks, looks_of_results
from roadeval.report.charts.rates import over_frames, over_windows
from roadeval.report.findings import NotableFrame
from roadeval.report.sections.frames import BrowsedFrames, FrameFacts, strip
from roadeval.results.rows import as_arrays, window_rows

Inspect = Callable[[Path, int], str]
"""Returns the command that opens a frame of a recording."""
ROWS: Final = 60
"""Points of the figure over the drive, at most."""


@dataclass(frozen=True, slots=True)
class ComparedMask:
    """A final mask that is compared."""

    name: str
    """What the page calls it."""
    result: str
    variant: str
    own: str
    """What the result itself calls the variant."""


def compared_masks(sides: Sequence[Side]) -> tuple[list[ComparedMask], Rows] | None:
    """Return the final masks that all results have, and their rows in the order of the frames.

    Each mask's rows have its name as variant; of a variant they are those of the frames on which
    all results have its mask. Where the variants of one result are compared, each is a result.
    None where there is none.
    """
    finals = {side.label: score.finals(side.rows(side.parts[0], "frames")) for side in sides}
    alone = all(rows.distinct("variant") == [label] for label, rows in finals.items())
    masks, parts = [], []
    for variant in dict.fromkeys(v for rows in finals.values() for v in rows.distinct("variant")):
        own = [side for side in sides if variant in finals[side.label].distinct("variant")]
        if not alone and (variant == BASELINE or len(own) < len(sides)):
            continue
        found = [finals[side.label].of_variant(variant) for side in own]
        common = [*set.intersection(*(set(rows["frame"].tolist()) for rows in found))]
        for side, rows in zip(own, found, strict=True) if common else ():
            name = side.label if alone else f"{side.label}: {variant}"
            kept = rows.take(np.isin(rows["frame"], common))
            masks.append(ComparedMask(name, side.label, variant, side.own_name(variant)))
            columns = (np.full(len(kept), text) for text in (name, "final"))
            parts.append(kept.replace(**dict(zip(("variant", "stage"), columns, strict=True))))
    if not parts:
        return None
    rows = joined(parts)
    return masks, rows.take(np.argsort(rows["frame"], kind="stable"))


def _looks_of(masks: Sequence[ComparedMask]) -> dict[str, Look]:
    """Return how masks are drawn: a hue a variant, a dash a result."""
    return looks_of_results({mask.name: (mask.result, mask.variant) for mask in masks})


def over_drive(comparison: Comparison, sides: Sequence[Side]) -> list[Chart]:
    """Return ERR over the one drive that is compared, and the baseline's; none without a side."""
    if (found := compared_masks(sides)) is None:
        return []
    masks, rows = found
    base = sides[0].rows(sides[0].parts[0], "frames").of_variant(BASELINE)
    blind = score.finals(base)
    rows = joined([rows, blind.take(np.isin(blind["frame"], rows["frame"]))])
    size = comparison.settings.window
    size *= max(-(-len(rows.distinct("frame")) // (size * ROWS)), 1)
    windows = as_arrays("windows", window_rows(score.windows(rows, size)))
    return over_windows(windows, [TESTED], _looks_of(masks) | looks([BASELINE]))


# --- The page -------------------------------------------------------------------------------------


def browsed(
    comparison: Comparison,
    sides: Sequence[Side],
    recordings: Mapping[str, Path],
    inspect: Inspect | None,
    taken: Callable[[BrowsedFrames], int] = lambda _frames: 0,
) -> BrowsedFrames | None:
    """Collect the frames that all results have of a variant, all their masks side by side.

    None where no variant is in all of them, or several drives are compared.

    Parameters
    ----------
    comparison
        Of one drive.
    sides
        The results with this drive; none where several are compared.
    recordings
        By the results' labels, where there are any.
    inspect
        Returns the command that opens a frame.
    taken
        Returns the bytes of a page with these frames and none of their pictures: of those as many
        are there as keep it below `roadeval.jobs.report_frames.BYTES`.
    """
    if (found := compared_masks(sides)) is None:
        return None
    masks, rows = found
    facts = {each.frame: each for each in _facts(rows, masks)}
    newest = recordings.get(masks[-1].result)
    command = (lambda frame: inspect(newest, frame)) if inspect and newest else None
    without = BrowsedFrames(
        frames=[*facts.values()],
        variants=[mask.name for mask in masks],
        pictured=frozenset(),
        strips=[],
        charts=over_frames(rows, [*SHORT], _looks_of(masks)),
        inspect=command,
    )
    by_path = {path: DriveResult(path) for path in dict.fromkeys(recordings.values())}
    opened = {label: by_path[path] for label, path in recordings.items()}
    masks = [mask for mask in masks if mask.result in opened]
    frames = [each.frame for each in comparison.moved]
    frames += [each.frame for each in comparison.disagreements]
    pictured = [
        facts[frame]
        for frame in dict.fromkeys(frames)
        if opened and frame in facts and all(frame in each.pictured for each in opened.values())
    ]
    made = (_strip(each, masks, opened, command) for each in pictured[:PICTURED])
    strips = sorted(fitting(made, BYTES - taken(without)), key=lambda each: each.frame)
    return replace(without, strips=strips, pictured=frozenset(each.frame for each in strips))


def _facts(rows: Rows, masks: Sequence[ComparedMask]) -> Iterator[FrameFacts]:
    """Yield each frame with the masks' rates, and whether the first of them got worse or better."""
    base, new = masks[0].name, masks[1].name
    for frame, stamp, rates in rates_by_frame(rows, [*SHORT]):
        conditions = []
        if base in rates and new in rates:
            change = rates[new]["ERR"] - rates[base]["ERR"]
            if abs(change) >= NOTEWORTHY:
                conditions = [f"{new} {'worse' if change > 0 else 'better'}"]
        yield FrameFacts(frame, stamp, rates, conditions)


def _strip(
    facts: FrameFacts,
    masks: Sequence[ComparedMask],
    opened: Mapping[str, DriveResult],
    command: Callable[[int], str] | None,
) -> Strip:
    """Return a frame with its pictures."""
    *_, last = (mask.name for mask in masks if mask.name in facts.rates)
    first, frame = opened[masks[0].result].recording, facts.frame
    assert first is not None
    errors = (
        (
            m.name,
            opened[m.result].layer(m.own, ERRORS.name, frame) if m.name in facts.rates else None,
        )
        for m in masks
    )
    images = [*outcomes(first, frame, errors)]
    found = NotableFrame(frame, facts.stamp_ns, last, facts.rates, images=images)
    return strip(found, [*facts.rates], command(facts.frame) if command else "")

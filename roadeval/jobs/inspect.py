"""The frames worth opening, and the viewer opened at one."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from roadeval.data import BASELINE
from roadeval.errors import RoadevalError
from roadeval.evaluation import score
from roadeval.evaluation.metrics import SHORT
from roadeval.jobs.outputs import holding
from roadeval.jobs.result import DriveResult

LISTED: Final = 10
"""Frames that are listed when nobody says how many."""


@dataclass(frozen=True, slots=True)
class WorstFrame:
    """A bad frame, and why it is one."""

    rank: int
    """1 is the worst."""
    frame: int
    stamp_ns: int
    """Which."""
    variant: str
    stage: str
    """Whose final mask."""
    rates: dict[str, float]
    """Of the final mask, as short tables show them."""
    parts: dict[str, float]
    """How ERR came about, see `roadeval.evaluation.score.causes`."""
    notes: tuple[str, ...]
    """What the recording says about it."""


def worst_frames(
    result: DriveResult,
    count: int = LISTED,
    variant: str | None = None,
    *,
    among: Collection[int] | None = None,
) -> list[WorstFrame]:
    """Rank the worst frames of a variant's final mask, the first variant's by default.

    With ``among``, only these frames are ranked: there may be none.

    Raises
    ------
    RoadevalError
        If nothing was scored, or ERR is undefined on every frame, or there is no such variant.
    """
    rows = result.rows
    names = _scored(result)
    if not names:
        raise RoadevalError(f"{result.path}: nothing was scored, so no frame is the worst")
    chosen = variant or names[0]
    if chosen not in names:
        raise RoadevalError(f"{result.path}: no variant {chosen}; there are {', '.join(names)}")
    looked_at = rows if among is None else rows.take(np.isin(rows["frame"], [*among]))
    ranked = score.worst(looked_at, chosen, count)
    if not len(ranked):
        if among is None:
            raise RoadevalError(
                f"{result.path}: ERR of {chosen} is undefined on every frame, "
                "so no frame is the worst"
            )
        return []
    causes = score.causes(rows, chosen)
    frames, stamps = ranked["frame"].tolist(), ranked["stamp_ns"].tolist()
    return [
        WorstFrame(
            place + 1,
            frame,
            stamp,
            chosen,
            str(ranked["stage"][place]),
            {rate: float(ranked[rate][place]) for rate in SHORT},
            causes.of(frame),
            result.notes(frame, chosen),
        )
        for place, (frame, stamp) in enumerate(zip(frames, stamps, strict=True))
    ]


def worst(result: DriveResult, variant: str | None = None) -> WorstFrame | None:
    """Return the worst frame that has pictures, of a variant or else of the first one.

    A recording may hold the pictures of few frames: the others do not count. None if no frame with
    pictures was scored.

    Raises
    ------
    RoadevalError
        If a variant is asked for that was not scored.
    """
    if variant is None and not _scored(result):
        return None
    return next(iter(worst_frames(result, 1, variant, among=result.pictured)), None)


def without_pictures(result: DriveResult, frame: int) -> str:
    """Return a sentence on a frame that was scored and whose pictures were not kept.

    Empty for every other frame.
    """
    if result.recording is None or frame in result.pictured:
        return ""
    if frame not in result.rows["frame"]:
        return ""
    return f"the recording has no pictures of frame {frame}, so the views of them are empty"


def _scored(result: DriveResult) -> list[str]:
    """Name the variants that were scored, without the baseline."""
    return [name for name in result.rows.distinct("variant") if name != BASELINE]


def view(result: DriveResult, frame: int | None, picture: Path | None = None) -> int | None:
    """Open the viewer at a frame, or draw it into a PNG file; return the frame that it drew.

    Without a frame it opens at the first evaluated one that has pictures.

    Raises
    ------
    RoadevalError
        If there is no recording or no such frame in it, or the viewer cannot work here.
    """
    from roadeval.recording.screen import viewer

    recording = result.recording
    if recording is None:
        raise RoadevalError(
            f"{result.path}: a results folder holds no pictures; give the recording (.rrd)"
        )
    numbers = sorted({*result.pictured, *result.rows["frame"].tolist()})
    if frame is not None and frame not in numbers:
        held = f"frames {numbers[0]} to {numbers[-1]}" if numbers else "none"
        raise RoadevalError(f"{result.path}: no frame {frame}; the recording holds {held}")
    if frame is None:
        frame = _first(result, recording.layout.first_frame)
    if picture is None:
        viewer.show(recording.path, frame)
        return frame
    with holding(picture, inputs=[result.path]):
        return viewer.screenshot(recording.path, picture, frame)


def _first(result: DriveResult, begin: int | None) -> int | None:
    """Choose the frame to open at: the first with pictures that was evaluated.

    Where none was it is the first with pictures of those that could be, from ``begin`` on, or
    else the first with pictures at all; where none has any, ``begin``.
    """
    counted = set(result.rows["frame"].tolist())
    evaluated = [number for number in result.pictured if number in counted]
    later = [number for number in result.pictured if number >= (begin or 0)]
    return next(iter([*evaluated, *later, *result.pictured]), begin)

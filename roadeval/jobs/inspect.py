"""The frames worth opening, and the viewer opened at one."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from roadeval.data import BASELINE
from roadeval.errors import RoadevalError
from roadeval.evaluation import analysis
from roadeval.jobs.result import Opened

LISTED: Final = 10
"""Frames that are listed when nobody says how many."""


@dataclass(frozen=True, slots=True)
class Suspect:
    """A bad frame, and why it is one.

    Parameters
    ----------
    rank
        1 is the worst.
    frame, stamp_ns
        Which.
    rates
        ERR, FPR and FNR of the final mask.
    parts
        How ERR came about, see `roadeval.evaluation.analysis.causes`.
    notes
        What the recording says about it.
    """

    rank: int
    frame: int
    stamp_ns: int
    rates: dict[str, float]
    parts: dict[str, float]
    notes: tuple[str, ...]


def suspects(
    opened: Opened,
    count: int = LISTED,
    variant: str | None = None,
    *,
    among: Collection[int] | None = None,
) -> list[Suspect]:
    """Rank the worst frames of a variant's final mask, the first variant's by default.

    With ``among``, only these frames are ranked: there may be none.

    Raises
    ------
    RoadevalError
        If nothing was scored, or ERR is undefined on every frame, or there is no such variant.
    """
    frames = opened.frames
    names = _scored(opened)
    if not names:
        raise RoadevalError(f"{opened.path}: nothing was scored, so no frame is the worst")
    chosen = variant or names[0]
    if chosen not in names:
        raise RoadevalError(f"{opened.path}: no variant {chosen}; there are {', '.join(names)}")
    looked_at = frames if among is None else frames[frames["frame"].isin(among)]
    ranked = analysis.worst(looked_at, chosen, count)
    if not len(ranked):
        if among is None:
            raise RoadevalError(
                f"{opened.path}: ERR of {chosen} is undefined on every frame, "
                "so no frame is the worst"
            )
        return []
    causes = analysis.causes(frames, chosen)
    return [
        Suspect(
            rank,
            row["frame"],
            row["stamp_ns"],
            {rate: row[rate] for rate in ("ERR", "FPR", "FNR")},
            causes.loc[row["frame"]].to_dict(),
            opened.notes(row["frame"], chosen),
        )
        for rank, row in enumerate(ranked.to_dict("records"), 1)
    ]


def worst(opened: Opened, variant: str | None = None) -> Suspect | None:
    """Give the worst frame that can be looked at, of a variant or else of the first one.

    A recording may hold the pictures of few frames: the others do not count. None if no frame with
    pictures was scored.

    Raises
    ------
    RoadevalError
        If a variant is asked for that was not scored.
    """
    if variant is None and not _scored(opened):
        return None
    return next(iter(suspects(opened, 1, variant, among=opened.pictured)), None)


def unpictured(opened: Opened, frame: int) -> str:
    """Say what is seen of a frame that was scored and whose pictures were not kept.

    Empty for every other frame.
    """
    if opened.recording is None or frame in opened.pictured or not len(opened.frames):
        return ""
    if frame not in set(opened.frames["frame"]):
        return ""
    cleared = opened.recording.format > 1
    return f"the recording has no pictures of frame {frame}, " + (
        "so the views of them are empty"
        if cleared
        else "and its views may show an earlier frame's: an earlier version made it"
    )


def _scored(opened: Opened) -> list[str]:
    """Name the variants that were scored, without the baseline."""
    if not len(opened.frames):
        return []
    return [name for name in opened.frames["variant"].unique() if name != BASELINE]


def view(opened: Opened, frame: int | None, picture: Path | None = None) -> int | None:
    """Open the viewer at a frame, or draw it into a PNG file; return the frame that it drew.

    Without a frame it opens at the first evaluated one that has pictures.

    Raises
    ------
    RoadevalError
        If there is no recording or no such frame in it, or the viewer cannot work here.
    """
    from roadeval.recording.screen import viewer

    recording = opened.recording
    if recording is None:
        raise RoadevalError(
            f"{opened.path}: a results folder holds no pictures; give the recording (.rrd)"
        )
    numbers = sorted({*opened.pictured, *(opened.frames["frame"] if len(opened.frames) else ())})
    if frame is not None and frame not in numbers:
        held = f"frames {numbers[0]} to {numbers[-1]}" if numbers else "none"
        raise RoadevalError(f"{opened.path}: no frame {frame}; the recording holds {held}")
    if frame is None:
        frame = _first(opened, recording.layout.first_frame)
    if picture is None:
        viewer.show(recording.path, frame)
        return frame
    return viewer.screenshot(recording.path, picture, frame)


def _first(opened: Opened, begin: int | None) -> int | None:
    """Choose the frame to open at: the first with pictures that was evaluated.

    Where none was it is the first with pictures of those that could be, from ``begin`` on, or
    else the first with pictures at all; where none has any, ``begin``.
    """
    scored = set(opened.frames["frame"]) if len(opened.frames) else set()
    evaluated = [number for number in opened.pictured if number in scored]
    later = [number for number in opened.pictured if number >= (begin or 0)]
    return next(iter([*evaluated, *later, *opened.pictured]), begin)

"""The frames that a page shows: facts of all of them, and pictures of some."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from roadeval.data import BASELINE, FILTERED, UNFILTERED, Health
from roadeval.evaluation import score
from roadeval.evaluation.metrics import SHORT
from roadeval.evaluation.score import judge
from roadeval.evaluation.settings import NOTEWORTHY
from roadeval.jobs.report_frames import LAYERS, FramePicker, evenly, rates_by_frame
from roadeval.jobs.result import DriveResult
from roadeval.report.blocks import Strip
from roadeval.report.charts.rates import over_frames
from roadeval.report.sections.browse import SMALL, BrowsedFrames, FrameFacts, strip
from roadeval.results.sentences import notes

PICTURED: Final = 24
"""Frames with pictures, where nobody says how many."""
BYTES: Final = 9_900_000
"""Of a page, at most, where nobody says how many frames have pictures."""
FEWEST: Final = 8
"""Frames that have pictures even if not every variant's layers have room for it."""
SHADOW: Final = 1 / 3
"""A frame with much shadow is among this share of the drive's."""


def browsed(
    result: DriveResult, inspect: Callable[[int], str] | None, strips: Sequence[Strip] = ()
) -> BrowsedFrames:
    """Collect what a page tells of a result's frames."""
    frames = result.rows
    variants = frames.distinct("variant")
    return BrowsedFrames(
        frames=list(facts_of(result)),
        variants=variants,
        pictured=frozenset(result.pictured),
        strips=strips,
        charts=over_frames(frames, [*SHORT]) if len(frames) else [],
        inspect=inspect if result.recording is not None else None,
        masks=_final_masks(result),
    )


def _final_masks(result: DriveResult) -> list[str]:
    """Name the pictures of the variants' final masks, as `StripMaker` does."""
    known = result.recording.variants if result.recording else ()
    return [f"{variant.name}: {variant.stages[-1]}" for variant in known]


def facts_of(result: DriveResult) -> Iterator[FrameFacts]:
    """Yield every frame of the table: those evaluated, or without truth those with pictures."""
    frames = result.rows
    if not len(frames):
        stamps = result.recording.stamps if result.recording else {}
        yield from (FrameFacts(number, stamps[number], {}) for number in result.pictured)
        return
    dark = _much_shadow(result)
    for frame, stamp, rates in rates_by_frame(score.finals(frames), [*SHORT]):
        blind = rates.get(BASELINE)
        others = {name: each for name, each in rates.items() if name != BASELINE}
        yield FrameFacts(
            frame,
            stamp,
            rates,
            [*_conditions(others, blind), *(["much shadow"] if frame in dark else [])],
            [*notes(others, blind)],
        )


def _conditions(
    rates: Mapping[str, Mapping[str, float]],
    blind: Mapping[str, float] | None,
) -> Iterator[str]:
    """Yield what is true of a frame, in words: the first variant's health, and the filter."""
    first = next(iter(rates), None)
    if first is None:
        return
    health = judge(rates[first], blind)
    if health is not Health.OK:
        yield f"{first} {health}"
    if FILTERED in rates and UNFILTERED in rates:
        change = rates[FILTERED]["ERR"] - rates[UNFILTERED]["ERR"]
        if abs(change) >= NOTEWORTHY:
            yield "the filter harms" if change > 0 else "the filter helps"
    if blind is not None and rates[first]["ERR"] > blind["ERR"]:
        yield f"{first} worse than {BASELINE}"


def _much_shadow(result: DriveResult) -> set[int]:
    """Return the frames with the most pixels in shadow, as the filter saw them."""
    regions = result.regions
    if not len(regions) or "shadow" not in set(regions["region"]):
        return set()
    last = score.final_frames(regions)
    first = last[last["variant"] == last["variant"].iloc[0]]
    shadow = first[first["region"] == "shadow"].set_index("frame")["N"]
    if not len(shadow) or shadow.max() == shadow.min():
        return set()
    return {int(str(each)) for each in shadow.index[shadow > shadow.quantile(1 - SHADOW)]}


# --- Pictures -------------------------------------------------------------------------------------


def strips_of(
    result: DriveResult,
    inspect: Callable[[int], str] | None,
    count: int | None = None,
    taken: int = 0,
) -> tuple[list[Strip], list[str]]:
    """Return frames with their pictures, and the variants whose layers had no room.

    In the drive's order: the worst, the best, and others.

    Parameters
    ----------
    result
        Of a recording; a folder has no pictures.
    inspect
        Returns the command that opens a frame.
    count
        How many. By default as many of `PICTURED` as keep the page below `BYTES`; where that would
        be fewer than `FEWEST`, only the first variants have their layers.
    taken
        Bytes of the page without them.
    """
    if result.recording is None:
        return [], []
    left_out: list[str] = []
    chosen, room = _chosen(result, PICTURED if count is None else count), BYTES - taken
    maker = StripMaker(result, inspect)
    if count is None and chosen and FEWEST * bytes_of(maker.strip(chosen[0])) > room:
        maker = StripMaker(result, inspect, layered=LAYERS)
        left_out = [variant.name for variant in result.recording.variants[LAYERS:]]
    made = (maker.strip(frame) for frame in chosen)
    shown = made if count is not None else fitting(made, room)
    return sorted(shown, key=lambda each: each.frame), left_out


def fitting(strips: Iterable[Strip], room: int) -> Iterator[Strip]:
    """Yield the first strips that have room together."""
    for made in strips:
        room -= bytes_of(made)
        if room < 0:
            return
        yield made


def bytes_of(made: Strip) -> int:
    """Return how many bytes of a page a strip takes: pictures as text, with words around each."""
    return sum(len(image.content) * 4 // 3 + 400 for image in made.images())


class StripMaker:
    """Makes the strip of any pictured frame of a result.

    Parameters
    ----------
    result
        Of a recording.
    inspect
        Returns the command that opens a frame.
    layers
        Pixels across the pictures of layers, at most.
    layered
        Variants whose layers are shown; None for all.
    """

    def __init__(
        self,
        result: DriveResult,
        inspect: Callable[[int], str] | None,
        layers: int = SMALL,
        layered: int | None = None,
    ) -> None:
        self._layers: Final = layers
        self._picker = FramePicker(result, None, layered)
        self._inspect = inspect
        frames = result.frames
        self._variants = list(dict.fromkeys(frames["variant"])) if len(frames) else []
        self._stamps: Final = result.recording.stamps if result.recording else {}

    def strip(self, frame: int) -> Strip:
        """Return a frame with its pictures."""
        command = self._inspect(frame) if self._inspect else ""
        found = self._picker.pictured(frame, self._stamps[frame])
        return strip(found, self._variants, command, self._layers)


def _chosen(result: DriveResult, count: int) -> list[int]:
    """Return frames to picture, the most telling first: bad, good and evenly spread in turn."""
    rows = result.rows
    scored_frames = set(rows["frame"].tolist())
    there = [number for number in result.pictured if number in scored_frames]
    pictured = there or [*result.pictured]
    variants = [name for name in rows.distinct("variant") if name != BASELINE]
    count = min(count, len(pictured))
    spread = evenly(pictured, count)
    if not variants:
        return spread
    own = rows.take(np.isin(rows["frame"], pictured))
    worst = score.worst(own, variants[0], count)["frame"].tolist()
    ranked = score.worst(own, variants[0], len(pictured), 0)["frame"].tolist()
    best = ranked[::-1]
    turns: list[int] = []
    for place in range(count):
        turns += worst[2 * place : 2 * place + 2]
        turns += [*best[place : place + 1], *spread[place : place + 1]]
    return list(dict.fromkeys([*turns, *pictured]))[:count]

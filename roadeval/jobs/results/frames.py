"""Frames of a result for a report or a page: which, with their pictures and facts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from operator import itemgetter
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import (
    BASELINE,
    ERRORS,
    FILTERED,
    IGNORE,
    TRUTH,
    UNFILTERED,
    Health,
    LayerKind,
    Rows,
)
from roadeval.evaluation import score
from roadeval.evaluation.metrics import SHORT
from roadeval.evaluation.settings import NOTEWORTHY
from roadeval.geometry.plan import Plan
from roadeval.jobs.progress import OnProgress, Progress, ignore
from roadeval.jobs.results.result import DriveResult
from roadeval.recording.layout import CELL
from roadeval.report.blocks import Strip
from roadeval.report.charts.standard import over_frames
from roadeval.report.findings import NotableFrame
from roadeval.report.images import ExampleFrame, LayerImage, faded
from roadeval.report.sections.frames import SMALL, FrameBrowser, strip
from roadeval.results.sentences import notes

if TYPE_CHECKING:
    from roadeval.recording.recording import Recording


WORST: Final = 4
MOVED: Final = 2
"""Frames that a report shows: the worst, and those that the filter helped and harmed most."""
OUTCOMES: Final = 6
LAYERS: Final = 2
"""Variants of which such a frame shows the errors, and all layers, on paper."""
PICTURED: Final = 24
"""Frames of a page with pictures, at most."""
BYTES: Final = 9_900_000
"""Of a page, at most."""


def evenly(numbers: Sequence[int], count: int) -> list[int]:
    """Pick ``count`` of the numbers from the middles of equal parts.

    >>> evenly(range(100), 4)
    [12, 37, 62, 87]
    """
    count = min(count, len(numbers))
    return [numbers[len(numbers) * (2 * i + 1) // (2 * count)] for i in range(count)]


def rates_by_frame(
    table: Rows, names: Sequence[str]
) -> Iterator[tuple[int, int, dict[str, dict[str, float]]]]:
    """Yield each frame's number and stamp, and the rates of its rows by variant.

    The table has ``frame``, ``stamp_ns``, ``variant`` and the rates; one row a frame and variant.
    """
    found: dict[tuple[int, int], dict[str, dict[str, float]]] = {}
    columns = [table[name].tolist() for name in ("frame", "stamp_ns", "variant", *names)]
    for frame, stamp, variant, *values in zip(*columns, strict=True):
        found.setdefault((frame, stamp), {})[variant] = dict(zip(names, values, strict=True))
    yield from ((*key, rates) for key, rates in found.items())


def outcomes(
    recording: Recording, frame: int, masks: Iterable[tuple[str, npt.NDArray[Any] | None]]
) -> Iterator[LayerImage]:
    """Yield the camera, the truth, and each mask's errors, given by its name."""
    image = recording.image(frame)
    yield LayerImage("camera", image)
    yield LayerImage("truth", image, TRUTH, recording.truth(frame))
    for name, errors in masks:
        if errors is None:
            yield LayerImage(f"{name}: no mask", faded(image))
        else:
            yield LayerImage(f"{name}: errors", image, ERRORS, errors)


class FramePicker:
    """Picks frames of a result and collects their pictures and facts.

    ``outcomes`` and ``layered`` are how many variants' errors, and layers, are shown at most; None
    for all.
    """

    def __init__(
        self, result: DriveResult, outcomes: int | None = OUTCOMES, layered: int | None = LAYERS
    ) -> None:
        self._result = result
        self._outcomes, self._layered = slice(outcomes), slice(layered)
        self._recording = result.recording
        self._finals = score.finals(result.rows)
        self._all = result.rows.distinct("variant")
        self._variants = [name for name in self._all if name != BASELINE]
        self._scored = frozenset(result.rows["frame"].tolist())
        self._causes = {name: score.causes(result.rows, name) for name in self._variants}

    def examples(self, numbers: Sequence[int]) -> Iterator[ExampleFrame]:
        """Yield frames for figure 2."""
        recording = self._recording
        for frame in numbers if recording else ():
            assert recording is not None
            masks = {
                v.name: self._result.layer(v.name, v.stages[-1], frame) for v in recording.variants
            }
            there = {name: mask for name, mask in masks.items() if mask is not None}
            truth = recording.truth(frame) if frame in self._scored else None
            yield ExampleFrame(frame, recording.image(frame), truth, there)

    def thumbnails(self, numbers: Sequence[int]) -> Iterator[LayerImage]:
        """Yield a picture of each frame: the first variant's errors, or without truth its mask."""
        recording = self._recording
        for frame in numbers if recording else ():
            assert recording is not None
            first = recording.variants[0]
            final = next(spec for spec in first.layers if spec.name == first.stages[-1])
            spec = ERRORS if frame in self._scored else final
            layer = recording.layer(first.name, spec.name, frame)
            yield LayerImage(f"frame {frame}", recording.image(frame), spec, layer)

    def worst(self) -> list[NotableFrame]:
        """Return the worst frames of the first variant, one a scene, all worse than the mean.

        Without truth those that are most in doubt, as far as they have pictures.
        """
        if not self._variants:
            unlabelled = self._result.facts.unlabelled
            look_at = unlabelled.look_at if unlabelled else []
            there = [frame for frame in look_at if frame in self._result.pictured]
            return [self._pictured(frame) for frame in there[:WORST]]
        table = self._result.rows
        rows = score.worst(table, self._variants[0], WORST, score.scene_ns(table["stamp_ns"]))
        mean = np.nanmean(self._finals.of_variant(self._variants[0])["ERR"]) if len(rows) else 0
        rows = rows.take(rows["ERR"] >= mean)
        return [
            self._notable(*row)
            for row in zip(rows["frame"].tolist(), rows["stamp_ns"].tolist(), strict=True)
        ]

    def moved(self, shown: Sequence[NotableFrame], *, harmed: bool) -> list[NotableFrame]:
        """Return the frames that the filter harmed most, or helped most, of scenes not shown."""
        pairs = score.pairs(self._result.rows, FILTERED, UNFILTERED)
        places = score.most_changed(
            *(pairs["stamp_ns"], pairs["ERR"], MOVED),
            harmed=harmed,
            apart_ns=score.scene_ns(pairs["stamp_ns"]),
            besides=[frame.stamp_ns for frame in shown],
        )
        rows = pairs.take(places)
        columns = (rows[name].tolist() for name in ("frame", "stamp_ns", "ERR"))
        return [self._notable(*row) for row in zip(*columns, strict=True)]

    def strip(self, frame: int, layers: int = SMALL) -> Strip:
        """Return a frame with its pictures, those of layers of at most so many pixels across."""
        made = self._pictured(frame)
        above = [*self._from_above(made)]
        made = replace(made, layers=[*made.layers, *([above] if above else [])])
        return strip(made, self._all, self._result.inspect(frame), layers)

    def _from_above(self, made: NotableFrame) -> Iterator[LayerImage]:
        """Yield camera, truth and errors of a frame as they look from above, on known ground."""
        facts = self._result.facts
        if (ground := facts.drive.ground) is None:
            return
        plan = Plan(ground, *facts.evaluation.plan, facts.evaluation.plan_width, CELL)
        for each in made.images:
            if each.image.shape[:2] == (ground.height, ground.width):
                seen = None if each.array is None else plan.picture(each.array, IGNORE)
                title = f"from above: {each.title.replace(': ', ', ')}"
                yield LayerImage(title, plan.picture(each.image), each.spec, seen)

    def _pictured(self, frame: int) -> NotableFrame:
        """Return a frame whose pictures are there, with all of them; without truth, too."""
        recording = self._recording
        assert recording is not None
        if self._variants and frame in self._scored:
            return self._notable(frame, recording.stamps[frame])
        return NotableFrame(
            frame,
            recording.stamps[frame],
            variant="",
            rates={},
            notes=recording.notes(frame),
            images=[LayerImage("camera", recording.image(frame))],
            layers=list(self._layers(recording, frame)),
        )

    def _notable(self, frame: int, stamp_ns: int, change: float | None = None) -> NotableFrame:
        own = self._finals.take(self._finals["frame"] == frame)
        ((_, _, rates),) = rates_by_frame(own, [*SHORT])
        first, recording = self._variants[0], self._recording
        seen = recording if recording is not None and frame in self._result.pictured else None
        errors = (
            (each.name, self._result.layer(each.name, ERRORS.name, frame))
            for each in (seen.variants[self._outcomes] if seen else ())
        )
        return NotableFrame(
            frame=frame,
            stamp_ns=stamp_ns,
            variant=first,
            rates=rates,
            parts=self._causes[first].of(frame),
            change=change,
            notes=self._result.notes(frame, first),
            images=[*outcomes(seen, frame, errors)] if seen else [],
            layers=[*self._layers(seen, frame)] if seen and change is None else [],
        )

    def _layers(self, recording: Recording, frame: int) -> Iterator[list[LayerImage]]:
        """Yield each variant's layers: the stages' masks, and all that is not a mask.

        The first of a row bears the variant's name, too.
        """
        image = recording.image(frame)
        for variant in recording.variants[self._layered]:
            specs = [
                spec
                for spec in variant.layers
                if spec.kind is not LayerKind.MASK or spec.name in variant.stages
            ]
            arrays = {spec: self._result.layer(variant.name, spec.name, frame) for spec in specs}
            known = [(spec, array) for spec, array in arrays.items() if array is not None]
            yield [
                LayerImage(
                    spec.name if place else f"{variant.name}: {spec.name}", image, spec, array
                )
                for place, (spec, array) in enumerate(known)
            ]


def browsed(result: DriveResult) -> FrameBrowser:
    """Collect the frames of a result for a page, without their pictures."""
    frames, names = result.rows, [*SHORT]
    if not len(frames):
        frames = result.table("unlabelled")
        names = [sign for sign in score.SIGNS if np.isfinite(frames[sign]).any()]
    there = result.recording.variants if result.recording else ()
    return FrameBrowser(
        rows=[*facts_of(result)],
        variants=frames.distinct("variant"),
        titles=names,
        charts=over_frames(frames, names) if len(frames) else [],
        command=result.inspect("{}") if result.recording else "",
        masks=[f"{each.name}: {each.stages[-1]}" for each in there],
    )


def facts_of(result: DriveResult) -> Iterator[NotableFrame]:
    """Yield every frame of the table: those evaluated, or without truth those with pictures."""
    frames = result.rows
    if not len(frames):
        doubts = [*rates_by_frame(result.table("unlabelled"), [*score.SIGNS])]
        seen = {frame for frame, _, _ in doubts}
        stamps = result.recording.stamps if result.recording else {}
        doubts += [(each, stamps[each], {}) for each in result.pictured if each not in seen]
        yield from (
            NotableFrame(frame, stamp, "", rates)
            for frame, stamp, rates in sorted(doubts, key=itemgetter(0))
        )
        return
    for frame, stamp, rates in rates_by_frame(score.finals(frames), [*SHORT]):
        blind = rates.get(BASELINE)
        others = {name: each for name, each in rates.items() if name != BASELINE}
        words, conditions = [*notes(others, blind)], [*_conditions(others, blind)]
        yield NotableFrame(frame, stamp, "", rates, notes=words, conditions=conditions)


def _conditions(
    rates: Mapping[str, Mapping[str, float]], blind: Mapping[str, float] | None
) -> Iterator[str]:
    """Yield what is true of a frame, in words: the first variant's health, and the filter."""
    first = next(iter(rates), None)
    if first is None:
        return
    health = score.judge(rates[first], blind)
    if health is not Health.OK:
        yield f"{first} {health}"
    if FILTERED in rates and UNFILTERED in rates:
        change = rates[FILTERED]["ERR"] - rates[UNFILTERED]["ERR"]
        if abs(change) >= NOTEWORTHY:
            yield "the filter harms" if change > 0 else "the filter helps"
    if blind is not None and rates[first]["ERR"] > blind["ERR"]:
        yield f"{first} worse than {BASELINE}"


def strips_of(result: DriveResult, room: int, on_progress: OnProgress = ignore) -> list[Strip]:
    """Return frames with their pictures, in the drive's order: the worst, the best, and others.

    At most `PICTURED`, and as many as have room in so many bytes of a page.
    """
    if result.recording is None:
        return []
    chosen = _chosen(result, PICTURED)
    picker = FramePicker(result, None, None)

    def each() -> Iterator[Strip]:
        for done, frame in enumerate(chosen, 1):
            yield picker.strip(frame)
            on_progress(Progress(done, len(chosen), "reading"))

    return sorted(fitting(each(), room), key=lambda each: each.frame)


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
        unlabelled = result.facts.unlabelled
        asked = [each for each in (unlabelled.look_at if unlabelled else ()) if each in pictured]
        return list(dict.fromkeys([*asked, *spread]))[:count]
    own = rows.take(np.isin(rows["frame"], pictured))
    worst = score.worst(own, variants[0], count)["frame"].tolist()
    ranked = score.worst(own, variants[0], len(pictured), 0)["frame"].tolist()
    best = ranked[::-1]
    turns: list[int] = []
    for place in range(count):
        turns += worst[2 * place : 2 * place + 2]
        turns += [*best[place : place + 1], *spread[place : place + 1]]
    return list(dict.fromkeys([*turns, *pictured]))[:count]

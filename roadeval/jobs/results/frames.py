"""The choice of frames for a report or a page, with their pictures and facts."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from operator import itemgetter
from typing import TYPE_CHECKING, Any, Final

from roadeval.data import BASELINE, ERRORS, FILTERED, IGNORE, TRUTH, UNFILTERED, Health, LayerKind
from roadeval.evaluation import tables
from roadeval.evaluation.metrics import SHORT, TESTED
from roadeval.evaluation.score.frame import judge
from roadeval.evaluation.score.unlabelled import SIGNS
from roadeval.evaluation.settings import NOTEWORTHY
from roadeval.evaluation.tables import finals, only, scene_ns, values_of
from roadeval.geometry.ground import Plan
from roadeval.jobs.results.result import DriveResult
from roadeval.recording.layout import CELL
from roadeval.report.blocks import Strip
from roadeval.report.findings import NotableFrame
from roadeval.report.images import ExampleFrame, LayerImage, fade, painted
from roadeval.report.sections.frames import SMALL, reduced, strip
from roadeval.results.facts import focus_of
from roadeval.results.sentences import notes

if TYPE_CHECKING:
    import pandas as pd

    from roadeval.recording.recording import Recording

WORST: Final = 4
MOVED: Final = 2
"""Number of the worst frames that a report shows, and of frames that the filter helped or harmed
most."""
ERRORS_SHOWN: Final = 6
LAYERS: Final = 2
"""Numbers of variants that paper shows of a frame: with their errors, and with all layers."""


def evenly(numbers: Sequence[int], count: int) -> list[int]:
    """Pick ``count`` of the numbers from the middles of equal parts.

    >>> evenly(range(100), 4)
    [12, 37, 62, 87]
    """
    count = min(count, len(numbers))
    return [numbers[len(numbers) * (2 * i + 1) // (2 * count)] for i in range(count)]


def rates_by_frame(
    table: pd.DataFrame, names: Sequence[str]
) -> Iterator[tuple[int, int, dict[str, dict[str, float]]]]:
    """Yield each frame's number and stamp, and the rates of its rows by variant.

    The table has ``frame``, ``stamp_ns``, ``variant`` and the rates; one row a frame and variant.
    """
    frames: dict[tuple[int, int], dict[str, dict[str, float]]] = {}
    columns = [table[name].tolist() for name in ("frame", "stamp_ns", "variant", *names)]
    for frame, stamp, variant, *values in zip(*columns, strict=True):
        frames.setdefault((frame, stamp), {})[variant] = dict(zip(names, values, strict=True))
    yield from ((*key, rates) for key, rates in frames.items())


class FramePicker:
    """Picks frames of a result and collects their pictures and facts.

    A frame shows the errors of at most ``outcomes`` variants, and the layers of at most ``layered``
    variants; None stands for all.
    """

    def __init__(
        self, result: DriveResult, outcomes: int | None = ERRORS_SHOWN, layered: int | None = LAYERS
    ) -> None:
        self._result = result
        self._outcomes, self._layered = slice(outcomes), slice(layered)
        self._recording = result.recording
        self._finals = finals(result.rows)
        self._all = values_of(result.rows, "variant")
        self._focus = result.facts.focus
        self._scored = frozenset(result.rows["frame"])

    def examples(self, numbers: Sequence[int]) -> Iterator[ExampleFrame]:
        """Yield frames for figure 2."""
        recording = self._recording
        for frame in numbers if recording else ():
            assert recording is not None
            masks = self._result.final_masks(frame)
            truth = recording.truth(frame) if frame in self._scored else None
            yield ExampleFrame(frame, recording.image(frame), truth, masks)

    def thumbnails(self, numbers: Sequence[int]) -> Iterator[LayerImage]:
        """Yield a picture of each frame: the errors of the focus, or without truth its mask."""
        if self._recording:
            focus = self._result.focus or focus_of(v.name for v in self._recording.variants) or ""
            for n in numbers:
                yield replace(painted(self.outcome(self._recording, focus, n)), title=f"frame {n}")

    def outcome(self, recording: Recording, variant: str, frame: int) -> LayerImage:
        """Return the errors of a variant on a frame, or without truth its mask."""
        (layout,) = (layout for layout in recording.variants if layout.name == variant)
        (final,) = (spec for spec in layout.layers if spec.name == layout.stages[-1])
        spec, image = ERRORS if frame in self._scored else final, recording.image(frame)
        if (layer := self._result.layer(variant, spec.name, frame)) is None:
            return LayerImage(f"{variant}: no mask", fade(image))
        return LayerImage(f"{variant}: {spec.name}", image, spec, layer)

    def worst(self) -> list[NotableFrame]:
        """Return the worst frames of the focus: one of each scene, if it is worse than the mean.

        Without truth these are the most uncertain frames that have pictures.
        """
        if self._focus is None:
            unlabelled = self._result.facts.unlabelled
            look_at = unlabelled.look_at if unlabelled else []
            pictured = [frame for frame in look_at if frame in self._result.pictured]
            return [reduced(self._pictured(frame)) for frame in pictured[:WORST]]
        focus_masks = only(self._finals, variant=self._focus)
        rows = tables.worst(focus_masks, WORST, apart_ns=scene_ns(self._result.rows["stamp_ns"]))
        rows = rows[rows[TESTED] >= focus_masks[TESTED].mean()]
        stamped = rows[["frame", "stamp_ns"]].itertuples(index=False)
        return [reduced(self._notable(*row)) for row in stamped]

    def moved(self, shown: Sequence[NotableFrame], *, harmed: bool) -> list[NotableFrame]:
        """Return the frames that the filter harmed or helped most, of scenes not yet shown."""
        pairs = tables.changes(self._result.rows, FILTERED, UNFILTERED)
        apart, besides = scene_ns(pairs["stamp_ns"]), [frame.stamp_ns for frame in shown]
        rows = tables.most_changed_frames(
            pairs, MOVED, harmed=harmed, apart_ns=apart, besides=besides
        )
        columns = rows[["frame", "stamp_ns", "change"]].assign(variant=FILTERED)
        return [reduced(self._notable(*row)) for row in columns.itertuples(index=False)]

    def strip(self, frame: int, layers: int = SMALL) -> Strip:
        """Return a frame with its pictures; pictures of layers are at most so many pixels wide."""
        notable = self._pictured(frame)
        above = [*self._from_above(notable)]
        notable = replace(notable, layers=[*notable.layers, *([above] if above else [])])
        return strip(notable, self._all, self._result.inspect(frame), layers)

    def _from_above(self, notable: NotableFrame) -> Iterator[LayerImage]:
        """Yield camera, truth and errors of a frame as seen from above, if the ground is known."""
        facts = self._result.facts
        if (ground := facts.drive.ground) is None:
            return
        plan = Plan(ground, *facts.evaluation.plan, facts.evaluation.plan_width, CELL)
        for layer in notable.images:
            if layer.image.shape[:2] == (ground.height, ground.width):
                picture = None if layer.array is None else plan.picture(layer.array, IGNORE)
                title = f"from above: {layer.title.replace(': ', ', ')}"
                yield LayerImage(title, plan.picture(layer.image), layer.spec, picture)

    def _pictured(self, frame: int) -> NotableFrame:
        assert self._recording is not None
        return self._notable(frame, self._recording.stamps[frame])

    def _notable(
        self, frame: int, stamp_ns: int, change: float | None = None, variant: str | None = None
    ) -> NotableFrame:
        """Return a frame of a variant, by default the focus, with its pictures if there are any."""
        result, recording = self._result, self._recording
        if frame not in result.pictured:
            recording = None
        layers = [*self._layers(recording, frame)] if recording and change is None else []
        if (variant := variant or self._focus) is None or frame not in self._scored:
            assert recording is not None
            images = [LayerImage("camera", recording.image(frame))]
            return NotableFrame(frame, stamp_ns, "", {}, images=images, layers=layers)
        masks = only(self._finals, frame=frame).set_index("variant")
        rates: dict[Any, Any] = masks[[*SHORT]].to_dict("index")
        return NotableFrame(
            *(frame, stamp_ns, variant, rates),
            change=change,
            notes=[*notes(rates, variant)],
            images=[*self._outcomes_of(recording, frame)] if recording else [],
            layers=layers,
        )

    def _outcomes_of(self, recording: Recording, frame: int) -> Iterator[LayerImage]:
        """Yield the camera, the truth, and the errors of each variant's final mask."""
        image = recording.image(frame)
        yield LayerImage("camera", image)
        yield LayerImage("truth", image, TRUTH, recording.truth(frame))
        for variant in recording.variants[self._outcomes]:
            yield self.outcome(recording, variant.name, frame)

    def _layers(self, recording: Recording, frame: int) -> Iterator[list[LayerImage]]:
        """Yield each variant's layers: the stages' masks, and all that is not a mask.

        The first picture of a row has the variant's name, too.
        """
        image = recording.image(frame)
        focus_first = sorted(recording.variants, key=lambda variant: variant.name != self._focus)
        for variant in focus_first[self._layered]:
            specs = [
                spec
                for spec in variant.layers
                if spec.kind is not LayerKind.MASK or spec.name in variant.stages
            ]
            arrays = ((spec, self._result.layer(variant.name, spec.name, frame)) for spec in specs)
            row = [LayerImage(s.name, image, s, array) for s, array in arrays if array is not None]
            row[:1] = [
                replace(picture, title=f"{variant.name}: {picture.title}") for picture in row[:1]
            ]
            yield row


def facts_of(result: DriveResult) -> Iterator[NotableFrame]:
    """Yield the frames of the table: evaluated frames, or without truth frames with pictures."""
    frames, focus = result.rows, result.focus or ""
    if not len(frames):
        doubts = [*rates_by_frame(result.table("unlabelled"), [*SIGNS])]
        seen = {frame for frame, _, _ in doubts}
        stamps = result.recording.stamps if result.recording else {}
        doubts += [(number, stamps[number], {}) for number in result.pictured if number not in seen]
        yield from (
            NotableFrame(frame, stamp, focus, rates)
            for frame, stamp, rates in sorted(doubts, key=itemgetter(0))
        )
        return
    for frame, stamp, rates in rates_by_frame(finals(frames), [*SHORT]):
        conditions: list[str] = []
        if focus in rates and focus != BASELINE:
            errors = defaultdict(lambda: math.nan, {name: rates[name][TESTED] for name in rates})
            health = judge(rates[focus], rates.get(BASELINE))
            change = errors[FILTERED] - errors[UNFILTERED]  # it is NaN if one of the two is missing
            holds = {
                f"{focus} {health}": health is not Health.OK,
                f"the filter {'harms' if change > 0 else 'helps'}": abs(change) >= NOTEWORTHY,
                f"{focus} worse than {BASELINE}": errors[focus] > errors[BASELINE],
            }
            conditions = [words for words, is_true in holds.items() if is_true]
        words = [*notes(rates)]
        yield NotableFrame(frame, stamp, focus, rates, notes=words, conditions=conditions)

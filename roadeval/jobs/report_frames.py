"""Frames for a report, picked from a result, with their pictures and facts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from roadeval.data import BASELINE, ERRORS, FILTERED, TRUTH, UNFILTERED, LayerKind, Rows
from roadeval.evaluation import score
from roadeval.evaluation.metrics import SHORT
from roadeval.jobs.result import DriveResult
from roadeval.recording import Recording
from roadeval.report.findings import NotableFrame, PairedComparison
from roadeval.report.images import ExampleFrame, LayerImage, faded

if TYPE_CHECKING:
    import pandas as pd

WORST: Final = 6
MOVED: Final = 3
"""Frames that are shown: the worst, and those that the filter helped and harmed most."""
OUTCOMES: Final = 6
LAYERS: Final = 2
"""Variants of which such a frame shows the errors, and all layers, on paper."""


def variants_but_baseline(frames: pd.DataFrame) -> list[str]:
    """Return the variants of a table that look at the image."""
    return [name for name in frames["variant"].unique().tolist() if name != BASELINE]


def evenly(numbers: Sequence[int], count: int) -> list[int]:
    """Pick ``count`` of the numbers from the middles of equal parts.

    >>> evenly(range(100), 4)
    [12, 37, 62, 87]
    """
    count = min(count, len(numbers))
    return [numbers[len(numbers) * (2 * i + 1) // (2 * count)] for i in range(count)]


def str_keys(values: Mapping[Any, Any]) -> dict[str, Any]:
    """Return a mapping made by pandas with keys that are text to the type checker, too."""
    return {str(name): value for name, value in values.items()}


def rates_by_frame(
    table: Rows, names: Sequence[str]
) -> Iterator[tuple[int, int, dict[str, dict[str, float]]]]:
    """Yield each frame's number and stamp, and the rates of its rows by variant.

    Parameters
    ----------
    table
        ``frame``, ``stamp_ns``, ``variant`` and the rates; one row a frame and variant.
    names
        Of the rates.
    """
    found: dict[tuple[int, int], dict[str, dict[str, float]]] = {}
    columns = [table[name].tolist() for name in ("frame", "stamp_ns", "variant", *names)]
    for frame, stamp, variant, *values in zip(*columns, strict=True):
        found.setdefault((frame, stamp), {})[variant] = dict(zip(names, values, strict=True))
    yield from ((*key, rates) for key, rates in found.items())


class FramePicker:
    """Picks frames of a result and collects their pictures and facts.

    Parameters
    ----------
    result
        The result.
    outcomes, layered
        Variants whose errors, and whose layers are shown, at most; None for all.
    """

    def __init__(
        self, result: DriveResult, outcomes: int | None = OUTCOMES, layered: int | None = LAYERS
    ) -> None:
        self._result = result
        self._outcomes, self._layered = slice(outcomes), slice(layered)
        self._recording = result.recording
        self._frames = result.frames
        self._finals = score.final_frames(result.frames)
        self._variants = variants_but_baseline(result.frames)
        self._scored = frozenset(result.rows["frame"].tolist())
        self._causes = {name: score.causes(result.rows, name) for name in self._variants}

    def examples(self, numbers: Sequence[int]) -> list[ExampleFrame]:
        """Return frames for figure 2."""
        return [self._example(self._recording, n) for n in numbers] if self._recording else []

    def thumbnails(self, numbers: Sequence[int]) -> list[LayerImage]:
        """Return a picture of each frame: the first variant's errors, or without truth its mask."""
        return [self._outcome(self._recording, n) for n in numbers] if self._recording else []

    def worst(self) -> list[NotableFrame]:
        """Return the worst frames of the first variant."""
        if not self._variants:
            return []
        rows = score.worst(self._result.rows, self._variants[0], WORST)
        return [
            self._notable(*row)
            for row in zip(rows["frame"].tolist(), rows["stamp_ns"].tolist(), strict=True)
        ]

    def moved(self, paired: Sequence[PairedComparison], *, harmed: bool) -> list[NotableFrame]:
        """Return the frames that the filter harmed most, or helped most."""
        for pair in paired:
            if (pair.treated, pair.control) == (FILTERED, UNFILTERED):
                frames = pair.frames
                stamps, changes = frames["stamp_ns"].to_numpy(), frames["ERR"].to_numpy()
                places = score.most_changed(stamps, changes, MOVED, harmed=harmed)
                rows = frames.iloc[places].reset_index().to_dict("records")
                return [self._notable(row["frame"], row["stamp_ns"], row["ERR"]) for row in rows]
        return []

    def pictured(self, frame: int, stamp_ns: int) -> NotableFrame:
        """Return any frame whose pictures are there, with all of them; without truth, too."""
        if self._variants and frame in self._scored:
            return self._notable(frame, stamp_ns)
        recording = self._recording
        assert recording is not None
        return NotableFrame(
            frame,
            stamp_ns,
            variant="",
            rates={},
            notes=recording.notes(frame),
            images=[LayerImage("camera", recording.image(frame))],
            layers=list(self._layers(recording, frame)),
        )

    def _notable(self, frame: int, stamp_ns: int, change: float | None = None) -> NotableFrame:
        own = self._finals[self._finals["frame"] == frame].set_index("variant")
        rates = str_keys(own[[*SHORT]].to_dict("index"))
        first, recording = self._variants[0], self._recording
        seen = recording is not None and frame in self._result.pictured
        return NotableFrame(
            frame=frame,
            stamp_ns=stamp_ns,
            variant=first,
            rates={name: str_keys(each) for name, each in rates.items()},
            parts=self._causes[first].of(frame),
            change=change,
            notes=self._result.notes(frame, first),
            images=list(self._with_outcomes(recording, frame)) if recording and seen else [],
            layers=list(self._layers(recording, frame))
            if recording and seen and change is None
            else [],
        )

    def _with_outcomes(self, recording: Recording, frame: int) -> Iterator[LayerImage]:
        """Yield the camera, the truth and each variant's errors."""
        image = recording.image(frame)
        yield LayerImage("camera", image)
        yield LayerImage("truth", image, TRUTH, recording.truth(frame))
        for variant in recording.variants[self._outcomes]:
            errors = self._result.layer(variant.name, ERRORS.name, frame)
            if errors is None:
                yield LayerImage(f"{variant.name}: no mask", faded(image))
            else:
                yield LayerImage(f"{variant.name}: errors", image, ERRORS, errors)

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

    def _outcome(self, recording: Recording, frame: int) -> LayerImage:
        variant = recording.variants[0]
        if len(self._frames):
            spec = ERRORS
        else:
            spec = next(spec for spec in variant.layers if spec.name == variant.stages[-1])
        layer = recording.layer(variant.name, spec.name, frame)
        return LayerImage(f"frame {frame}", recording.image(frame), spec, layer)

    def _example(self, recording: Recording, frame: int) -> ExampleFrame:
        masks = {
            v.name: self._result.layer(v.name, v.stages[-1], frame) for v in recording.variants
        }
        there = {name: mask for name, mask in masks.items() if mask is not None}
        truth = recording.truth(frame) if len(self._frames) else None
        return ExampleFrame(frame, recording.image(frame), truth, there)

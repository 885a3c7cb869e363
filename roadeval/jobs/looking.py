"""Frames worth looking at, with what there is to see and to say about each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

from roadeval.data import BASELINE, ERRORS, FILTERED, TRUTH, UNFILTERED, LayerKind
from roadeval.evaluation import analysis
from roadeval.jobs.result import Opened
from roadeval.recording import Recording
from roadeval.report.figures.files import Example
from roadeval.report.findings import Case, Versus
from roadeval.report.pictures import Shot

if TYPE_CHECKING:
    import pandas as pd

WORST: Final = 6
MOVED: Final = 3
"""Frames in the gallery: the worst, and those that the filter helped and harmed most."""
OUTCOMES: Final = 6
STEPS: Final = 2
"""Variants whose errors a frame of the gallery shows, and whose steps."""


def pipelines(frames: pd.DataFrame) -> list[str]:
    """Name the variants that look at the image: all but the baseline."""
    names = frames["variant"].unique().tolist() if len(frames) else []
    return [name for name in names if name != BASELINE]


def evenly(numbers: Sequence[int], count: int) -> list[int]:
    """Pick ``count`` of the numbers from the middles of equal parts."""
    count = min(count, len(numbers))
    return [numbers[len(numbers) * (2 * i + 1) // (2 * count)] for i in range(count)]


def named(numbers: Mapping[Any, Any]) -> dict[str, Any]:
    """Say that a table's names are words, which pandas does not know."""
    return {str(name): value for name, value in numbers.items()}


class Looker:
    """Picks frames and gathers what there is to see and to say about each."""

    def __init__(self, opened: Opened) -> None:
        self._opened = opened
        self._recording = opened.recording
        self._frames = opened.frames
        self._variants = pipelines(opened.frames)
        self._causes = {name: analysis.causes(self._frames, name) for name in self._variants}

    def examples(self, numbers: Sequence[int]) -> list[Example]:
        """Gather frames for figure 2."""
        return [self._example(self._recording, n) for n in numbers] if self._recording else []

    def thumbnails(self, numbers: Sequence[int]) -> list[Shot]:
        """Gather frames to look at in passing."""
        if self._recording is None:
            return []
        return [
            replace(self._outcome(self._recording, number), title=f"frame {number}")
            for number in numbers
        ]

    def worst(self) -> list[Case]:
        """Gather the worst frames of the first variant."""
        if not self._variants:
            return []
        found = analysis.worst(self._frames, self._variants[0], WORST)
        return [self._case(*place) for place in found[["frame", "stamp_ns"]].to_numpy().tolist()]

    def moved(self, versus: Sequence[Versus], *, harmed: bool) -> list[Case]:
        """Gather the frames that the filter harmed most, or helped most."""
        for each in versus:
            if (each.treated, each.control) == (FILTERED, UNFILTERED):
                found = analysis.most_changed(each.frames, MOVED, harmed=harmed)
                return [
                    self._case(row["frame"], row["stamp_ns"], row["ERR"])
                    for row in found.to_dict("records")
                ]
        return []

    def _case(self, frame: int, stamp_ns: int, change: float | None = None) -> Case:
        own = analysis.finals(self._frames[self._frames["frame"] == frame]).set_index("variant")
        variant, recording = self._variants[0], self._recording
        shots: list[Shot] = []
        rows: list[list[Shot]] = []
        if recording is not None and frame in self._opened.pictured:
            shots = list(self._shots(recording, frame))
            rows = list(self._rows(recording, frame)) if change is None else []
        return Case(
            frame=frame,
            stamp_ns=stamp_ns,
            variant=variant,
            rates={
                name: named(rates)
                for name, rates in named(own[["ERR", "FPR", "FNR"]].to_dict("index")).items()
            },
            parts=named(self._causes[variant].loc[frame].to_dict()),
            change=change,
            notes=self._opened.notes(frame, variant),
            shots=shots,
            rows=rows,
        )

    def _shots(self, recording: Recording, frame: int) -> Iterator[Shot]:
        """Show the camera, the truth and each variant's errors."""
        image = recording.image(frame)
        yield Shot("camera", image)
        yield Shot("truth", image, TRUTH, recording.truth(frame))
        for variant in recording.variants[:OUTCOMES]:
            errors = recording.layer(variant.name, ERRORS.name, frame)
            yield Shot(f"{variant.name}: errors", image, ERRORS, errors)

    def _rows(self, recording: Recording, frame: int) -> Iterator[list[Shot]]:
        """Show each variant's steps: the stages' masks, and all that is not a mask."""
        image = recording.image(frame)
        for variant in recording.variants[:STEPS]:
            layers = [
                (spec, self._opened.layer(variant.name, spec.name, frame))
                for spec in variant.layers
                if spec.kind is not LayerKind.MASK or spec.name in variant.stages
            ]
            yield [Shot(s.name, image, s, array) for s, array in layers if array is not None]

    def _outcome(self, recording: Recording, frame: int) -> Shot:
        """Show the first variant's errors, or without truth its mask."""
        variant = recording.variants[0]
        image = recording.image(frame)
        if len(self._frames):
            return Shot("", image, ERRORS, recording.layer(variant.name, ERRORS.name, frame))
        stage = variant.stages[-1]
        spec = next(spec for spec in variant.layers if spec.name == stage)
        assert spec.kind is LayerKind.MASK
        return Shot("", image, spec, recording.layer(variant.name, stage, frame))

    def _example(self, recording: Recording, frame: int) -> Example:
        masks = {v.name: recording.layer(v.name, v.stages[-1], frame) for v in recording.variants}
        truth = recording.truth(frame) if len(self._frames) else None
        return Example(frame, recording.image(frame), truth, masks)

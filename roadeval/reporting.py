"""A report of one drive from its recording or results folder: what to find out, and where."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import BASELINE, ERRORS, FILTERED, TRUTH, UNFILTERED, LayerKind
from roadeval.evaluation import analysis
from roadeval.evaluation.maps import Maps
from roadeval.evaluation.scoreboard import COMPARED
from roadeval.opened import Opened
from roadeval.recording import Recording
from roadeval.report.document import document
from roadeval.report.figures import Example
from roadeval.report.findings import Case, Findings, Heat, Versus
from roadeval.report.pictures import Shot
from roadeval.report.typeset import Paper, pdf, put

if TYPE_CHECKING:
    import pandas as pd

SAMPLED: Final = 100
"""Frames whose masks are read for the maps, at most; tables know every frame."""
ROWS: Final = 30
"""Rows of the table over the drive, at most."""
WORST: Final = 6
MOVED: Final = 3
"""Frames in the gallery: the worst, and those that the filter helped and harmed most."""
EXAMPLES: Final = 4
THUMBNAILS: Final = 8
"""Frames in figure 2 and on the first page."""
OUTCOMES: Final = 6
STEPS: Final = 2
"""Variants whose errors a frame of the gallery shows, and whose steps."""


def report(
    result: str | Path | Opened, output: str | Path | None = None, *, paper: Paper = Paper.A4
) -> Path:
    """Write the report of one drive as a PDF.

    Parameters
    ----------
    result
        A recording, whole or partial, or a results folder, or either opened already. Without a
        recording there are no pictures.
    output
        By default ``report.pdf`` in the results folder, or ``reports/<drive>/report.pdf``.
    paper
        A4 or Letter.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    RoadevalError
        If there is nothing to read there, or the file cannot be written.
    """
    opened = result if isinstance(result, Opened) else Opened(result)
    folder = opened.path if opened.recording is None else Path("reports", opened.name)
    return put(Path(output or folder / "report.pdf"), pdf(document(find(opened)), paper))


def find(opened: Opened) -> Findings:
    """Find out everything that the report tells."""
    frames, summary = opened.frames, opened.summary
    numbers = _numbers(opened)
    maps = _maps(opened, numbers)
    scored = len(frames) > 0
    windows, rows = _windows(opened) if scored else (frames, 0)
    versus = _versus(frames, summary, maps) if scored else []
    look = _Looker(opened)
    return Findings(
        source=str(opened.path),
        complete=opened.complete,
        pictured=opened.recording is not None,
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
            name: _named(analysis.causes(frames, name).mean().to_dict())
            for name in _variants(frames)
        },
        heat=[
            Heat(name, each.share(each.fp), each.share(each.fn)) for name, each in maps.heat.items()
        ],
        oracles=opened.extra("oracles"),
        sampled=maps.frames,
        examples=look.examples(_evenly(numbers, EXAMPLES)),
        thumbnails=look.thumbnails(_evenly(numbers, THUMBNAILS)),
        worst=look.worst(),
        helped=look.moved(versus, harmed=False),
        harmed=look.moved(versus, harmed=True),
        coverage=_coverage(opened, numbers),
    )


def _numbers(opened: Opened) -> list[int]:
    """Give the evaluated frames, or without truth all."""
    if len(opened.frames):
        return [int(number) for number in opened.frames["frame"].unique()]
    return list(opened.recording.frame_numbers) if opened.recording else []


def _variants(frames: pd.DataFrame) -> list[str]:
    """Name the variants that look at the image."""
    names = frames["variant"].unique().tolist() if len(frames) else []
    return [name for name in names if name != BASELINE]


def _evenly(numbers: Sequence[int], count: int) -> list[int]:
    """Pick ``count`` of the numbers from the middles of equal parts."""
    count = min(count, len(numbers))
    return [numbers[len(numbers) * (2 * i + 1) // (2 * count)] for i in range(count)]


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
    wanted = [(FILTERED, UNFILTERED), *((name, BASELINE) for name in _variants(frames))]
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
        pixels = (change.repaired, change.spoiled, change.labelled, maps.frames) if change else None
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


def _named(numbers: Mapping[Any, Any]) -> dict[str, Any]:
    """Say that a table's names are words, which pandas does not know."""
    return {str(name): value for name, value in numbers.items()}


# --- Masks and pictures ---------------------------------------------------------------------------


def _maps(opened: Opened, numbers: Sequence[int]) -> Maps:
    """Sum up the masks of evenly spread frames, which the tables do not hold."""
    maps, recording = Maps(), opened.recording
    if recording is None or not len(opened.frames):
        return maps
    for number in _evenly(numbers, SAMPLED):
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
    chosen = _evenly(numbers, SAMPLED)
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


class _Looker:
    """Picks frames and gathers what there is to see and to say about each."""

    def __init__(self, opened: Opened) -> None:
        self._opened = opened
        self._recording = opened.recording
        self._frames = opened.frames
        self._variants = _variants(opened.frames)
        self._causes = {name: analysis.causes(self._frames, name) for name in self._variants}

    def examples(self, numbers: Sequence[int]) -> list[Example]:
        return [self._example(self._recording, n) for n in numbers] if self._recording else []

    def thumbnails(self, numbers: Sequence[int]) -> list[Shot]:
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
        shots = () if recording is None else tuple(self._shots(recording, frame))
        rows = recording is not None and change is None and list(self._rows(recording, frame))
        return Case(
            frame=frame,
            stamp_ns=stamp_ns,
            variant=variant,
            rates={
                name: _named(rates)
                for name, rates in _named(own[["ERR", "FPR", "FNR"]].to_dict("index")).items()
            },
            parts=_named(self._causes[variant].loc[frame].to_dict()),
            change=change,
            notes=self._opened.notes(frame, variant),
            shots=shots,
            rows=rows or (),
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
            yield [
                Shot(spec.name, image, spec, recording.layer(variant.name, spec.name, frame))
                for spec in variant.layers
                if spec.kind is not LayerKind.MASK or spec.name in variant.stages
            ]

    def _outcome(self, recording: Recording, frame: int) -> Shot:
        """Show the first variant's errors, or without truth its mask."""
        variant = recording.variants[0]
        image = recording.image(frame)
        if recording.layout.has_truth and len(self._frames):
            return Shot("", image, ERRORS, recording.layer(variant.name, ERRORS.name, frame))
        stage = variant.stages[-1]
        spec = next(spec for spec in variant.layers if spec.name == stage)
        assert spec.kind is LayerKind.MASK
        return Shot("", image, spec, recording.layer(variant.name, stage, frame))

    def _example(self, recording: Recording, frame: int) -> Example:
        masks = {v.name: recording.layer(v.name, v.stages[-1], frame) for v in recording.variants}
        truth = recording.truth(frame) if recording.layout.has_truth else None
        return Example(frame, recording.image(frame), truth, masks)

"""The frames of compared results on a page: what each result makes of them, beside each other."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from roadeval.data import BASELINE, ERRORS, TRUTH, Rows
from roadeval.data.rows import joined
from roadeval.evaluation import score
from roadeval.evaluation.comparison import Comparison, Side
from roadeval.evaluation.metrics import SHORT
from roadeval.evaluation.settings import NOTEWORTHY
from roadeval.jobs.page_frames import BYTES, PICTURED, fitting
from roadeval.jobs.report_frames import rates_by_frame
from roadeval.jobs.result import DriveResult
from roadeval.recording import Recording
from roadeval.report.blocks import Strip
from roadeval.report.chart import Look, looks_of_results
from roadeval.report.charts.rates import over_frames
from roadeval.report.findings import NotableFrame
from roadeval.report.images import LayerImage, faded
from roadeval.report.sections.browse import BrowsedFrames, FrameFacts, strip

Inspect = Callable[[Path, int], str]
"""Returns the command that opens a frame of a recording."""


@dataclass(frozen=True, slots=True)
class ComparedMask:
    """A final mask that is compared: of which result and variant, and what the page calls it.

    ``own`` is what the result itself calls the variant.
    """

    name: str
    result: str
    variant: str
    own: str


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
        are there as keep it below `roadeval.jobs.page_frames.BYTES`.
    """
    rows = {side.label: side.rows(side.parts[0], "frames") for side in sides}
    masks = masks_of(sides, rows)
    if not masks:
        return None
    table = table_of(masks, rows)
    masks = [mask for mask in masks if mask.name in table.distinct("variant")]
    if not masks:
        return None
    facts = list(_facts(table, masks))
    album = _Album(masks, recordings, facts, inspect)
    wanted = dict.fromkeys(
        [each.frame for each in comparison.moved]
        + [each.frame for each in comparison.disagreements]
    )
    without = BrowsedFrames(
        frames=facts,
        variants=[mask.name for mask in masks],
        pictured=frozenset(),
        strips=[],
        charts=over_frames(
            table,
            [*SHORT],
            looks_of(masks),
        ),
        inspect=album.command if inspect and album.newest else None,
    )
    made = (strip for frame in [*wanted][:PICTURED] if (strip := album.strip(frame)))
    strips = sorted(fitting(made, BYTES - taken(without)), key=lambda each: each.frame)
    return replace(without, strips=strips, pictured=frozenset(each.frame for each in strips))


def masks_of(sides: Sequence[Side], rows: Mapping[str, Rows]) -> list[ComparedMask]:
    """Return the final masks that all results have, one result after the other for each variant."""
    there = {label: own.distinct("variant") for label, own in rows.items()}
    if all(names == [label] for label, names in there.items()):
        return [ComparedMask(label, label, label, label) for label in there]
    found = []
    for variant in next(iter(there.values())):
        if variant != BASELINE and all(variant in names for names in there.values()):
            for side in sides:
                own = side.own_name(variant)
                found.append(ComparedMask(f"{side.label}: {variant}", side.label, variant, own))
    return found


def looks_of(masks: Sequence[ComparedMask]) -> dict[str, Look]:
    """Return how the masks are drawn: a hue a variant, a dash a result."""
    return looks_of_results({mask.name: (mask.result, mask.variant) for mask in masks})


def table_of(masks: Sequence[ComparedMask], frames: Mapping[str, Rows]) -> Rows:
    """Return the rows of the masks, each under its name as variant.

    Of a variant they are those of the frames on which all results have its mask.
    """
    parts = []
    for variant in dict.fromkeys(mask.variant for mask in masks):
        own = [mask for mask in masks if mask.variant == variant]
        found = [score.finals(frames[mask.result].of_variant(variant)) for mask in own]
        common = [*set.intersection(*(set(rows["frame"].tolist()) for rows in found))]
        for mask, rows in zip(own, found, strict=True):
            there = rows.take(np.isin(rows["frame"], common))
            named = {"variant": mask.name, "stage": "final"}
            parts.append(
                there.replace(**{key: np.full(len(there), name) for key, name in named.items()})
            )
    whole = joined(parts)
    return whole.take(np.argsort(whole["frame"], kind="stable"))


def _facts(table: Rows, masks: Sequence[ComparedMask]) -> Iterator[FrameFacts]:
    """Yield each frame with the masks' rates, and whether the first of them got worse or better."""
    base, new = masks[0].name, masks[1].name
    for frame, stamp, rates in rates_by_frame(table, [*SHORT]):
        said = []
        if base in rates and new in rates:
            change = rates[new]["ERR"] - rates[base]["ERR"]
            if abs(change) >= NOTEWORTHY:
                said = [f"{new} {'worse' if change > 0 else 'better'}"]
        yield FrameFacts(frame, stamp, rates, said)


class _Album:
    """The pictures of frames as every result has them."""

    def __init__(
        self,
        masks: Sequence[ComparedMask],
        recordings: Mapping[str, Path],
        facts: Sequence[FrameFacts],
        inspect: Inspect | None,
    ) -> None:
        self._masks: Final = [mask for mask in masks if mask.result in recordings]
        self._paths: Final = recordings
        self._facts: Final = {each.frame: each for each in facts}
        self._inspect: Final = inspect
        opened = {path: DriveResult(path) for path in dict.fromkeys(recordings.values())}
        self._opened: Final = {label: opened[path] for label, path in recordings.items()}
        self.newest: Final = recordings.get(masks[-1].result) if masks else None

    def command(self, frame: int) -> str:
        """Return the command that opens a frame of the newest result."""
        assert self._inspect is not None
        assert self.newest is not None
        return self._inspect(self.newest, frame)

    def strip(self, frame: int) -> Strip | None:
        """Return a frame with its pictures; None where a result has none of it."""
        found = self._opened.values()
        facts = self._facts.get(frame)
        if facts is None or not found or not all(frame in each.pictured for each in found):
            return None
        *_, last = (mask.name for mask in self._masks if mask.name in facts.rates)
        made = NotableFrame(
            frame, facts.stamp_ns, last, facts.rates, images=list(self._images(facts))
        )
        command = self.command(frame) if self._inspect and self.newest else ""
        return strip(made, list(facts.rates), command)

    def _images(self, facts: FrameFacts) -> Iterator[LayerImage]:
        first, frame = self._recording(self._masks[0]), facts.frame
        image = first.image(frame)
        yield LayerImage("camera", image)
        yield LayerImage("truth", image, TRUTH, first.truth(frame))
        for mask in self._masks:
            if mask.name not in facts.rates:
                yield LayerImage(f"{mask.name}: no mask", faded(image))
                continue
            errors: Any = self._recording(mask).layer(mask.own, ERRORS.name, frame)
            yield LayerImage(f"{mask.name}: errors", image, ERRORS, errors)

    def _recording(self, mask: ComparedMask) -> Recording:
        recording = self._opened[mask.result].recording
        assert recording is not None
        return recording

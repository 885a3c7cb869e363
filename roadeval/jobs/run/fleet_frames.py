"""What a fleet keeps of a drive's frames while it is replayed: rows, light, and the worst ones."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, astuple, fields
from pathlib import Path
from typing import Any, Final

import numpy as np

from roadeval.data import BASELINE, ERRORS, FrameResult, Role, Tally
from roadeval.evaluation.score import Light, final_stages, light_of
from roadeval.report.images import LayerImage, jpeg, shrink
from roadeval.results.fleet import PICTURES, frames_path
from roadeval.results.rows import frame_rows
from roadeval.results.tables import TableFile
from roadeval.runtime.files import put

WORST: Final = 3
"""Frames of a drive that are kept as its worst."""
APART_NS: Final = 1_000_000_000
"""Neighbours fail alike: of frames less than this apart only the worst is kept."""
WIDTH: Final = 320
"""Pixels across their pictures."""


class FrameGatherer:
    """Takes a drive's frames in order, and writes their rows; to be used as a context.

    Without `finish` the rows of an earlier replay stay.
    """

    def __init__(self, folder: Path, drive: str) -> None:
        self._folder: Final = folder
        self._drive: Final = drive
        self._rows: Final = TableFile(frames_path(folder, drive), "frames")
        self._lights: Final[list[tuple[float, ...]]] = []
        self._stamps: list[int] = []
        self._worst: list[tuple[dict[str, Any], bytes]] = []
        """Rows of the table ``worst`` without their ranks, and the pictures."""

    def __enter__(self) -> FrameGatherer:
        self._rows.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        self._rows.__exit__(*error)

    def add(self, result: FrameResult) -> None:
        """Add a frame; one that was not evaluated is ignored."""
        if result.role is not Role.EVALUATED:
            return
        light = light_of(result.frame.image)
        self._lights.append(astuple(light))
        self._stamps = [*self._stamps[:1], result.frame.stamp_ns]
        key = self._drive, result.frame.camera
        stages = final_stages((tally.variant, tally.stage) for tally in result.tallies)
        self._rows.add(
            (*key, *row, stages[tally.variant] == tally.stage, *astuple(light))
            for tally, row in zip(result.tallies, frame_rows(result)["frames"], strict=True)
        )
        first = next((t.variant for t in result.tallies if t.variant != BASELINE), None)
        if first is not None:
            *_, final = (tally for tally in result.tallies if tally.variant == first)
            self._offer(result, final, light)

    def _offer(self, result: FrameResult, tally: Tally, light: Light) -> None:
        """Keep a frame as long as it is one of the worst."""
        frame, err = result.frame, tally.rates["ERR"]
        near = [w for w in self._worst if abs(w[0]["stamp_ns"] - frame.stamp_ns) < APART_NS]
        rest = [w for w in self._worst if w not in near]
        bound = max((row["ERR"] for row, _ in near), default=-1.0)
        if len(rest) == WORST:
            bound = max(bound, min(row["ERR"] for row, _ in rest))
        if math.isnan(err) or err <= bound:
            return
        # Painted when they are small: most are soon replaced by a worse frame's.
        image, errors = shrink(frame.image, WIDTH), result.errors[tally.variant].array
        small = shrink(errors.astype(np.uint8, copy=False), WIDTH, labels=True)
        picture = jpeg(LayerImage("", image, ERRORS, small), WIDTH).content
        row = {
            "frame": frame.number,
            "stamp_ns": frame.stamp_ns,
            "variant": tally.variant,
            "stage": tally.stage,
            **{name: tally.rates[name] for name in ("ERR", "FPR", "FNR")},
            "picture": Path(PICTURES, self._drive, f"{frame.number}.jpg").as_posix(),
            **asdict(light),
        }
        ranked = sorted([*rest, (row, picture)], key=lambda w: (-w[0]["ERR"], w[0]["frame"]))
        self._worst = ranked[:WORST]

    def facts(self) -> dict[str, Any]:
        """Return what a drive's row says of its evaluated frames: their times and mean light."""
        if not self._lights:
            return {}
        values = np.array(self._lights)
        known = ~np.isnan(values)
        sums = np.where(known, values, 0).sum(axis=0)
        means = sums / np.where(known.any(axis=0), known.sum(axis=0), np.nan)
        names = (field.name for field in fields(Light))
        times = {"start_ns": self._stamps[0], "end_ns": self._stamps[-1]}
        return times | dict(zip(names, means.tolist(), strict=True))

    def finish(self) -> None:
        """Write the rows and the worst frames' pictures; an OSError if they cannot be written."""
        if self._lights:
            self._rows.finish()
        for row, picture in self._worst:
            put(self._folder / row["picture"], picture)

    def worst_rows(self) -> Iterator[dict[str, Any]]:
        """Yield the rows of ``worst``; ranks are given over all drives."""
        for rank, (row, _) in enumerate(self._worst, 1):
            yield {"rank": rank, **row}

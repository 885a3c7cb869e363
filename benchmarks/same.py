"""Whether two versions of roadeval give the same results: ``python -m benchmarks.same OLD NEW``.

``OLD`` and ``NEW`` are folders that hold, for each run, a results folder ``NAME/`` and a recording
``NAME.rrd``. Compared bit for bit: the tables, the pictures of the figures, the numbers of the
summary, and every layer and note of the recordings. Timing, versions, paths and the configuration's
own record are left out; ``--but-intervals`` leaves out the intervals too, and the sentence on them.
Ends with exit code 1 if anything differs.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from roadeval import Recording, RoadevalError
from roadeval.results.facts import Facts
from roadeval.results.schema import TABLES

OF_THE_RUN: Final = ("seconds", "versions", "run", "settings", "tables", "format")
"""Parts of a summary that hold how it was made, not its results."""


INTERVALS: Final = ("summary.difference.", "summary.verdict")
"""Beginnings of the places that depend on how intervals are computed."""


def main() -> int:
    """Compare every run of two folders."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("old", type=Path)
    parser.add_argument("new", type=Path)
    parser.add_argument("--but-intervals", action="store_true")
    options = parser.parse_args()
    names = sorted(path.stem for path in options.old.glob("*.rrd"))
    failed = 0
    for name in names:
        differing = list(differences(options.old / name, options.new / name))
        if options.but_intervals:
            differing = [place for place in differing if not place.startswith(INTERVALS)]
        print(f"{name}: {'; '.join(differing) or 'the same'}", flush=True)
        failed += bool(differing)
    print(f"{len(names) - failed} of {len(names)} runs give the same results")
    return 1 if failed or not names else 0


def differences(old: Path, new: Path) -> Iterator[str]:
    """Yield the differences of two runs, by their results folders."""
    for table in TABLES:
        yield from _file(old, new, f"{table}.csv")
    for figure in sorted(path.name for path in old.glob("*.png")):
        theirs, ours = (cv2.imread(str(folder / figure)) for folder in (old, new))
        if ours is None or not np.array_equal(theirs, ours):
            yield figure
    before, after = (Facts.read(folder / "summary.json").as_dict() for folder in (old, new))
    yield from _values("summary", results_of(before), results_of(after))
    yield from _recordings(Recording(f"{old}.rrd"), Recording(f"{new}.rrd"))


def _file(old: Path, new: Path, name: str) -> Iterator[str]:
    before, after = (folder / name for folder in (old, new))
    if before.exists() != after.exists():
        yield f"{name} is there once"
    elif before.exists() and before.read_bytes() != after.read_bytes():
        yield name


def results_of(summary: dict[str, Any]) -> dict[str, Any]:
    results = {key: value for key, value in summary.items() if key not in OF_THE_RUN}
    return {**results, "log": summary["log"]["digest"], "frames": _counts(summary["frames"])}


def _counts(frames: dict[str, Any]) -> dict[str, Any]:
    """Return the account of the frames, with its reasons in order but without their wording."""
    return {**frames, "skipped": list(frames["skipped"].values())}


def _values(where: str, old: Any, new: Any) -> Iterator[str]:
    if isinstance(old, dict) and isinstance(new, dict):
        for key in {**old, **new}:
            yield from _values(f"{where}.{key}", old.get(key), new.get(key))
    elif old != new:
        yield where


def _recordings(old: Recording, new: Recording) -> Iterator[str]:
    if old.frame_numbers != new.frame_numbers or old.variants != new.variants:
        yield "recording: frames or layers"
        return
    for variant in old.variants:
        for spec in (*variant.layers, None):
            name = "errors" if spec is None else spec.name
            for frame in old.frame_numbers:
                layers = [_layer(recording, variant.name, name, frame) for recording in (old, new)]
                if not _equal(*layers):
                    yield f"recording: {variant.name}/{name} of frame {frame}"
                    break
    for frame in old.frame_numbers:
        if old.notes(frame) != new.notes(frame):
            yield f"recording: notes of frame {frame}"
            break


def _layer(recording: Recording, variant: str, name: str, frame: int) -> Any:
    try:
        return recording.layer(variant, name, frame)
    except RoadevalError as error:  # a frame that lacks a layer lacks it in both
        return str(error).rpartition(":")[2]


def _equal(old: Any, new: Any) -> bool:
    return bool(np.array_equal(old, new)) if isinstance(old, np.ndarray) else old == new


if __name__ == "__main__":
    sys.exit(main())

"""How often truth and masks that do not fit the images are named, and how often others are.

``python -m benchmarks.fits DRIVE.mcap ... [--road V] [--ignore V]`` replays each drive with the
presets paper, gated and robust, adds a small network that learns from its first frames, and holds
their masks against truth and images: as they are, late by 1 to 5 frames, early, mirrored, upside
down, inverted, and moved by 3 to 12 pixels.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
import numpy.typing as npt
from sklearn.neural_network import MLPClassifier

import roadeval
from roadeval.data import Frame, FrameResult, Packed
from roadeval.evaluation.score import TRUTH, Finding, FitCheck, Misfit

Masks = npt.NDArray[np.uint8]
LAGS = (1, 2, 3, 4, 5, -1, -2, -3)
MOVES = ((3, 0), (-3, 0), (0, 4), (0, -4), (6, 0), (0, 6), (0, -6), (-8, 3), (12, 0), (0, -12))
CELL = 4
LEARNT = 10


def replayed(drive: Path, road: int | None, ignore: int | None) -> list[FrameResult]:
    """Return the frames of a drive with the masks of the presets."""
    presets = {name: {"preset": name} for name in ("gated", "robust")}
    tables = {"variants": presets, "output": {"record": "none", "figures": False}}
    if road is not None:
        tables["labels"] = {"road": [road], "ignore": [] if ignore is None else [ignore]}
    frames: list[FrameResult] = []
    with TemporaryDirectory() as folder:
        config = roadeval.configure(tables)
        roadeval.replay(drive, config, reports=folder, on_frame=frames.append)
    return [each for each in frames if each.frame.truth is not None]


def network(frames: Sequence[Frame]) -> Masks:
    """Return masks of a network of one hidden layer on cells of 4x4, learnt on the first frames."""
    height, width = frames[0].image.shape[:2]
    size = width // CELL, height // CELL
    places = np.stack(np.meshgrid(*(np.linspace(-1, 1, n) for n in size)), axis=2)

    def seen(frame: Frame) -> npt.NDArray[np.float64]:
        cells = cv2.resize(frame.image, size, interpolation=cv2.INTER_AREA) / 128 - 1
        around = [cv2.blur(cells, (width, width)) for width in (5, 15)]
        return np.concatenate([cells, *around, places], axis=2).reshape(-1, 11)

    truths = [cv2.resize((f.truth == 1) * 1.0, size, interpolation=cv2.INTER_AREA) for f in frames]
    learnt = MLPClassifier((24,), max_iter=60, random_state=0).fit(
        np.concatenate([seen(frame) for frame in frames[:LEARNT]]),
        np.concatenate([truth.ravel() > 0.5 for truth in truths[:LEARNT]]),
    )
    scores = (learnt.predict_proba(seen(frame))[:, 1].reshape(size[::-1]) for frame in frames)
    return np.array([cv2.resize(s, (width, height)) > 0.5 for s in scores], np.uint8)


def wrong(masks: Masks, *, moves: bool) -> Iterator[tuple[Finding, Masks]]:
    """Yield masks that do not fit, each with what is to be found."""
    places = np.arange(len(masks))
    for frames in LAGS:
        late = masks[np.clip(places - frames, 0, len(masks) - 1)]
        yield Finding("", Misfit.LAG, frames=frames), late
    yield Finding("", Misfit.MIRRORED), masks[:, :, ::-1]
    yield Finding("", Misfit.UPSIDE_DOWN), masks[:, ::-1]
    yield Finding("", Misfit.INVERTED), np.where(masks > 1, masks, 1 - masks)
    for right, down in MOVES if moves else ():
        way = np.array([[1, 0, right], [0, 1, down]], np.float32)
        size = masks.shape[2], masks.shape[1]
        moved = np.array([cv2.warpAffine(m, way, size, flags=cv2.INTER_NEAREST) for m in masks])
        yield Finding("", Misfit.MOVED, right=right, down=down), moved


def named(frames: Sequence[FrameResult], truth: Masks, masks: Masks | None) -> list[Finding]:
    """Return what is found of frames with a truth, and with masks from elsewhere."""
    check = FitCheck(range(len(frames)))
    for place, each in enumerate(frames):
        external = {} if masks is None else {"masks": np.ascontiguousarray(masks[place])}
        frame = each.frame
        own = [Packed.of(v.final()) for v in each.variants if v.variant == "filtered"]
        kept = np.ascontiguousarray(truth[place])
        times = place, place, place
        check.add(Frame(*times, frame.image, b"", truth=kept, external=external), own)
    return [*check.findings()]


def is_it(found: Sequence[Finding], wanted: Finding, subject: str) -> bool:
    """Return whether that alone was found which was to be found, moves within two pixels."""
    if len(found) != 1 or (found[0].subject, found[0].misfit) != (subject, wanted.misfit):
        return False
    off = found[0].right - wanted.right, found[0].down - wanted.down
    return found[0].frames == wanted.frames and float(np.hypot(*off)) <= 2


def main() -> None:
    """Print a line for each drive, and the sums."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("drives", nargs="+", type=Path)
    parser.add_argument("--road", type=int)
    parser.add_argument("--ignore", type=int)
    options = parser.parse_args()
    sums: Counter[str] = Counter()
    for drive in options.drives:
        frames = replayed(drive, options.road, options.ignore)
        truth = np.array([each.frame.truth for each in frames])
        methods = {
            name: np.array([v.final() for e in frames for v in e.variants if v.variant == name])
            for name in ("filtered", "gated", "robust")
        }
        methods["network"] = network([each.frame for each in frames])
        missed = []
        for change, moved in wrong(truth, moves=False):
            ok = is_it(named(frames, moved, None), change, TRUTH)
            sums["truth named"] += ok
            sums["truth"] += 1
            missed += [] if ok else [f"truth {change}"]
        for name, masks in methods.items():
            for change, moved in wrong(masks, moves=True):
                ok = is_it(named(frames, truth, moved), change, "masks")
                sums["masks named"] += ok
                sums["masks"] += 1
                missed += [] if ok else [f"{name} {change}"]
            for part in range(0, len(frames) - 39, 10):
                for step in (1, 2):
                    own = slice(part, part + 40 * step, step)
                    sums["untouched"] += 1
                    if wrongly := named(frames[own], truth[own], masks[own]):
                        sums["untouched named"] += 1
                        missed.append(f"{name} untouched {wrongly}")
        start = time.process_time()
        named(frames, truth, methods["robust"])
        print(f"{drive.stem}: {time.process_time() - start:.2f} s of CPU; not as planted: {missed}")
    print(dict(sums))


if __name__ == "__main__":
    main()

"""How often truth and masks that do not fit the images are named, and how often fitting ones.

``python -m benchmarks.fits DRIVE.mcap ... [--road V] [--ignore V]`` replays each drive with the
presets paper, gated and robust, adds a small network that learns from its first frames, and holds
their masks against truth and images: unchanged, late by 1 to 5 frames, early, mirrored, upside
down, inverted, and moved by 3 to 12 pixels. It prints a line of a table for each drive. A misfit
counts as named with its kind, side, frames and pixels, the last two within two; a lag of 3 frames
and more only has to be named as late or early. Pixels are judged by the planted offset, without a
method's own offset from the truth. CPU is that of one run with masks from elsewhere.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
import numpy.typing as npt
from sklearn.neural_network import MLPClassifier

import roadeval
from roadeval.data import Frame, FrameResult, Packed
from roadeval.evaluation.score.fit import TRUTH, Finding, FitCheck, Misfit

Masks = npt.NDArray[np.uint8]
LAGS = (1, 2, 3, 4, 5, -1, -2, -3)
MOVES = ((3, 0), (-3, 0), (0, 4), (0, -4), (6, 0), (0, 6), (0, -6), (-8, 3), (12, 0), (0, -12))
CELL = 4
LEARNT = 10
LATE = 3
"""Frames of a lag whose number need not be named."""
NEAR = 2.0
"""Pixels by which a move may be named wrongly."""


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
    return [result for result in frames if result.frame.truth is not None]


def network(frames: Sequence[Frame]) -> Masks:
    """Return masks of a network of one hidden layer on cells of 4x4, learnt on the first frames."""
    height, width = frames[0].image.shape[:2]
    size = width // CELL, height // CELL
    places = np.stack(np.meshgrid(*(np.linspace(-1, 1, n) for n in size)), axis=2)

    def features(frame: Frame) -> npt.NDArray[np.float64]:
        cells = cv2.resize(frame.image, size, interpolation=cv2.INTER_AREA) / 128 - 1
        around = [cv2.blur(cells, (width, width)) for width in (5, 15)]
        return np.concatenate([cells, *around, places], axis=2).reshape(-1, 11)

    truths = [cv2.resize((f.truth == 1) * 1.0, size, interpolation=cv2.INTER_AREA) for f in frames]
    learnt = MLPClassifier((24,), max_iter=60, random_state=0).fit(
        np.concatenate([features(frame) for frame in frames[:LEARNT]]),
        np.concatenate([truth.ravel() > 0.5 for truth in truths[:LEARNT]]),
    )
    scores = (learnt.predict_proba(features(frame))[:, 1].reshape(size[::-1]) for frame in frames)
    return np.array([cv2.resize(s, (width, height)) > 0.5 for s in scores], np.uint8)


def wrong(masks: Masks, *, moves: bool) -> Iterator[tuple[Finding, Masks]]:
    """Yield masks that do not fit, each with the expected finding."""
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


def find_misfits(frames: Sequence[FrameResult], truth: Masks, masks: Masks | None) -> list[Finding]:
    """Return the misfits of frames with a truth, and with masks from elsewhere."""
    check = FitCheck(range(len(frames)))
    for place, result in enumerate(frames):
        external = {} if masks is None else {"masks": np.ascontiguousarray(masks[place])}
        computed = [Packed.of(v.final()) for v in result.variants if v.variant == "filtered"]
        labels = np.ascontiguousarray(truth[place])
        frame = Frame(
            *(place, place, place, result.frame.image, b""), truth=labels, external=external
        )
        check.add(frame, computed)
    return [*check.findings()]


def is_it(findings: Sequence[Finding], planted: Finding, subject: str) -> bool:
    """Return whether the planted misfit is named, and nothing else."""
    if len(findings) != 1:
        return False
    (finding,) = findings
    if (finding.subject, finding.misfit) != (subject, planted.misfit):
        return False
    is_late = abs(planted.frames) >= LATE and finding.frames * planted.frames > 0
    off = finding.right - planted.right, finding.down - planted.down
    return (is_late or finding.frames == planted.frames) and math.hypot(*off) <= NEAR


def main() -> None:
    """Print a table with a line for each drive, and below it the wrong findings."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("drives", nargs="+", type=Path)
    parser.add_argument("--road", type=int)
    parser.add_argument("--ignore", type=int)
    options = parser.parse_args()
    print("| drive | truth named | masks named | untouched named | CPU |")
    print("| --- | --- | --- | --- | --- |")
    mistakes = []
    for drive in options.drives:
        frames = replayed(drive, options.road, options.ignore)
        truth = np.array([result.frame.truth for result in frames])
        methods = {
            name: np.array([v.final() for f in frames for v in f.variants if v.variant == name])
            for name in ("filtered", "gated", "robust")
        }
        methods["network"] = network([result.frame for result in frames])
        counts = dict.fromkeys(("truth", "masks"), (0, 0))
        untouched = []
        cases = [(TRUTH, TRUTH, *case) for case in wrong(truth, moves=False)]
        cases += [
            ("masks", name, *case)
            for name, masks in methods.items()
            for case in wrong(masks, moves=True)
        ]
        for subject, name, planted, changed in cases:
            is_truth = subject == TRUTH
            findings = find_misfits(frames, *((changed, None) if is_truth else (truth, changed)))
            is_named = is_it(findings, planted, subject)
            counts[subject] = counts[subject][0] + is_named, counts[subject][1] + 1
            mistakes += [] if is_named else [f"{drive.stem} {name} {planted}: {findings}"]
        for name, masks in methods.items():
            for first in range(0, len(frames) - 39, 10):
                for step in (1, 2):
                    part = slice(first, first + 40 * step, step)
                    untouched.append(find_misfits(frames[part], truth[part], masks[part]))
                    mistakes += [f"{drive.stem} {name} {part}: {f}" for f in untouched[-1]]
        start = time.process_time()
        find_misfits(frames, truth, methods["robust"])
        took = time.process_time() - start
        shares = [f"{good} of {every}" for good, every in counts.values()]
        shares.append(f"{sum(map(bool, untouched))} of {len(untouched)}")
        print(f"| {drive.stem} | {' | '.join(shares)} | {took:.2f} s |", flush=True)
    print("\n".join(mistakes))


if __name__ == "__main__":
    main()

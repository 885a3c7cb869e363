"""How many wrong labels an audit names, beside cleanlab's rank and chance.

``python -m benchmarks.label_errors DRIVE.mcap ... [--road V] [--ignore V] [--seeds N]`` plants
errors in 20 labels of each drive, replays it with them by the preset robust, which learns from its
first ten labels, wrong ones included, and audits the recording. A line of a table says how many of
the first 20 are planted ones: by `roadeval audit`; without any method, from labels and images
alone; by cleanlab's quality of labels (pixels' quality is the probability of their label, an
image's is their softmin at a temperature of 0.1) with the same probabilities; and by chance. Below
stand how many of those named have the box on the planted area, how many are called clearly wrong,
and the planted ones among these; and the reasons that were given for each kind.
"""

from __future__ import annotations

import argparse
from collections import Counter, defaultdict
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
import numpy.typing as npt

import roadeval
from roadeval.data import IGNORE, ROAD
from roadeval.evaluation.score.label_errors import LabelledView, find_suspects, rank_suspects

Masks = npt.NDArray[np.uint8]
COUNT = 20
APART = 3
"""Frames from one planted error to the next, at least."""
TEMPERATURE = 0.1
KINDS = ("specks", "shadow", "cut", "moved", "another", "mirrored")
LEAST = {"specks": 0.001}
"""Least share of an image's pixels whose label is wrong; 0.01 of the other kinds."""


def plant(truths: Masks, images: Masks, rng: np.random.Generator) -> tuple[Masks, dict[int, str]]:
    """Return labels of which 20 are wrong, and the kind of each of these."""
    chosen: list[int] = []
    for frame in rng.permutation(len(truths)).tolist():
        if len(chosen) < COUNT and all(abs(frame - other) >= APART for other in chosen):
            chosen.append(frame)
    labels, kinds = truths.copy(), {}
    for place, frame in enumerate(chosen):
        kind = KINDS[place % len(KINDS)]
        for _ in range(50):
            label = spoil(kind, truths, images, frame, rng)
            if (label != truths[frame]).mean() >= LEAST.get(kind, 0.01):
                labels[frame], kinds[frame] = label, kind
                break
    return labels, kinds


def spoil(
    kind: str, truths: Masks, images: Masks, frame: int, rng: np.random.Generator
) -> npt.NDArray[np.uint8]:
    """Return a frame's label with an error of one kind."""
    truth, (height, width) = truths[frame], truths.shape[1:]
    road, label = truth == ROAD, truths[frame].copy()
    if not road.any():
        return label
    if kind == "specks":
        near = cv2.dilate(road.astype(np.uint8), np.ones((41, 41))) > 0
        y, x = np.nonzero(near & (truth != IGNORE))
        for at in rng.integers(len(y), size=rng.integers(6, 13)).tolist():
            speck = np.zeros_like(truth)
            radius = int(rng.integers(3, 8))
            cv2.circle(speck, (int(x[at]), int(y[at])), radius, 1, -1)
            label[(speck == 1) & (truth != IGNORE)] = 1 - truth[y[at], x[at]]
    elif kind == "shadow":
        grey = cv2.GaussianBlur(cv2.cvtColor(images[frame], cv2.COLOR_RGB2GRAY), (0, 0), 4)
        dark = road & (grey < np.percentile(grey[road], rng.uniform(20, 45)))
        count, areas, stats, _ = cv2.connectedComponentsWithStats(dark.astype(np.uint8))
        if count > 1:
            label[areas == 1 + stats[1:, cv2.CC_STAT_AREA].argmax()] = 0
    elif kind == "cut":
        y, x = np.nonzero(road)
        angle = rng.uniform(0, 2 * np.pi)
        along = x * np.cos(angle) + y * np.sin(angle)
        off = along > np.quantile(along, rng.uniform(0.75, 0.9))
        label[y[off], x[off]] = 0
    elif kind == "moved":
        angle, far = rng.uniform(0, 2 * np.pi), rng.uniform(8, 16) * width / 480
        way = np.array([[1, 0, far * np.cos(angle)], [0, 1, far * np.sin(angle)]], np.float32)
        how = {"flags": cv2.INTER_NEAREST, "borderMode": cv2.BORDER_REPLICATE}
        label = np.asarray(cv2.warpAffine(truth, way, (width, height), **how), np.uint8)
    elif kind == "another":
        other = frame + int(rng.choice([-1, 1])) * int(rng.integers(3, 15))
        label = truths[min(max(other, 0), len(truths) - 1)].copy()
    else:
        label = truth[:, ::-1].copy()
    return label


def softmin_quality(labels: Masks, probabilities: npt.NDArray[np.float32]) -> float:
    """Return cleanlab's quality of an image's labels, given the probability of road."""
    seen = labels != IGNORE
    quality = np.where(labels == ROAD, probabilities, 1 - probabilities)[seen].astype(np.float64)
    weights = np.exp((1 - quality) / TEMPERATURE)
    return float((weights * quality).sum() / weights.sum())


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("drives", nargs="+", type=Path)
    parser.add_argument("--road", type=int)
    parser.add_argument("--ignore", type=int)
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args()
    tables = {"preset": "robust", "output": {"figures": False}, "run": {"jobs": 1}}
    reasons = defaultdict[str, Counter[str]](Counter)
    print("| drive, draw | audit | no method | cleanlab | chance | box | clear | right |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for drive in options.drives:
        named = {} if options.road is None else {"road": [options.road]}
        named |= {} if options.ignore is None else {"ignore": [options.ignore]}
        with TemporaryDirectory() as place:
            save, folder = Path(place, "drive.rrd"), Path(place, "labels")
            config = roadeval.configure({**tables, "labels": named})
            roadeval.replay(drive, config, save=save, reports=Path(place, "r"))
            original = roadeval.Recording(save)
            stamps = original.stamps
            images = np.array([original.image(frame) for frame in stamps])
            truths = np.array([original.truth(frame) for frame in stamps])
            for seed in range(options.seeds):
                labels, kinds = plant(truths, images, np.random.default_rng(seed))
                folder.mkdir(exist_ok=True)
                for stamp, label in zip(stamps.values(), labels, strict=True):
                    levels = np.select([label == ROAD, label == IGNORE], [255, 128], 0)
                    cv2.imwrite(str(folder / f"{stamp:019d}.png"), levels.astype(np.uint8))
                config = roadeval.configure({**tables, "truth": {"path": str(folder)}})
                save = Path(place, f"{seed}.rrd")
                roadeval.replay(drive, config, save=save, reports=Path(place, f"r{seed}"))
                recording = roadeval.Recording(save)
                found = roadeval.audit(save, COUNT).suspects
                views = [
                    LabelledView.of(frame, stamps[frame], image, label, {})
                    for frame, image, label in zip(stamps, images, labels, strict=True)
                ]
                alone = rank_suspects(find_suspects(views), len(views), COUNT)
                qualities = [
                    softmin_quality(label, recording.layer("robust", "probability", frame))
                    for frame, label in zip(stamps, labels, strict=True)
                ]
                worst = np.argsort(qualities)[:COUNT].tolist()
                hits = [
                    sum(frame in kinds for frame in some)
                    for some in (found.frame, alone.frame, worst)
                ]
                boxes = 0
                for row in found.to_dict("records"):
                    if row["frame"] in kinds:
                        reasons[kinds[row["frame"]]][row["reason"]] += 1
                        y, x = np.nonzero(labels[row["frame"]] != truths[row["frame"]])
                        inside = (row["top"] <= y) & (y < row["bottom"])
                        inside &= (row["left"] <= x) & (x < row["right"])
                        boxes += inside.mean() > 0.3
                clear = found[found.clear].frame
                right = sum(frame in kinds for frame in clear)
                chance = COUNT * len(kinds) / len(labels)
                cells = *hits, f"{chance:.1f}", boxes, len(clear), right
                print("|", " | ".join(map(str, (f"{drive.stem}, {seed}", *cells))), "|", flush=True)
    print("\n| planted | reasons given |\n| --- | --- |")
    for kind, counts in reasons.items():
        given = ", ".join(f"{reason} {count}" for reason, count in counts.most_common())
        print(f"| {kind} | {given} |")


if __name__ == "__main__":
    main()

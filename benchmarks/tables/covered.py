"""`robust` where the reference patch is no bare road, with and without covered training frames.

On the drives that it was developed on a red cycle box with white marks is painted on the road in
front of the vehicle, in every scored frame. On IDD vehicles cover the patch of some frames as they
are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from benchmarks.tables import idd
from benchmarks.tables.drives import DRIVES, Sources
from benchmarks.tables.idd import SEEDS_OF_ROBUST
from roadeval import logs
from roadeval.config import RunConfig, configure
from roadeval.data import ROAD, Frame
from roadeval.pipeline.reference_patch import ReferencePatch, patch_mask
from roadeval.training import fit

SHARES: Final = (0.0, 0.5)
"""Of `TrainingSettings.covered`."""
PAINTED: Final = ("camvid_0006R0_1hz", "camvid_0016E5_15hz", "synthetic_0")
BOX: Final = ReferencePatch(top=0.66, bottom=1.0, top_width=0.42, bottom_width=1.0)
RED: Final = (1.35, 0.8, 0.75)
"""Gains of the brightness on red tar."""
WHITE: Final = 235
ROAD_ON_PATCH: Final = 0.7
"""Least share of road on a patch that counts as bare."""

View = Callable[[Frame], Frame]


def measured(sources: Sources, idd_lite: Path) -> dict[str, Any]:
    """Return ERR with each of `SHARES`: of drives, with each seed, and of half of IDD's frames."""
    return {
        "painted": {name: _on_drive(name, sources) for name in PAINTED},
        "idd": _on_idd(idd_lite),
    }


def painted(frame: Frame) -> Frame:
    """Return a frame with a cycle box and the marks of a cycle on its road."""
    height, width = frame.image.shape[:2]
    box = (patch_mask(height, width, BOX) > 0) & (frame.truth == ROAD)
    image = frame.image.copy()
    red = image[box].mean(axis=1, keepdims=True) * RED
    image[box] = np.clip(np.rint(red), 0, 255)
    marks = np.zeros((height, width), np.uint8)
    middle, down, radius = width // 2, round(0.84 * height), height // 18
    for aside in (-width // 16, width // 16):
        cv2.circle(marks, (middle + aside, down), radius, 1, 2)
        cv2.line(marks, (middle + aside, down), (middle, down - radius), 1, 3)
    image[(marks > 0) & box] = WHITE
    return replace(frame, image=image)


def _on_drive(name: str, sources: Sources) -> dict[str, list[list[float]]]:
    """Return the mean ERR of the frames after the first ten, by share of covered ones, by seed."""
    frames = _labelled(name, sources)
    learn, rest = frames[:10], frames[10:]
    views: dict[str, View] = {"bare": lambda frame: frame, "painted": painted}
    shown = {view: [change(frame) for frame in rest] for view, change in views.items()}
    found: dict[str, list[list[float]]] = {view: [] for view in views}
    for share in SHARES:
        chains = [_chain(_robust(share), learn, seed) for seed in range(SEEDS_OF_ROBUST)]
        for view, seen in shown.items():
            found[view].append(
                [
                    float(np.mean([idd.err(idd.counts(idd.last(chain, f), f)) for f in seen]))
                    for chain in chains
                ]
            )
    return found


def _labelled(name: str, sources: Sources) -> list[Frame]:
    drive = DRIVES[name]
    config = configure({"labels": drive.labels})
    with logs.open_log(drive.find(sources, name)) as log:
        selection = log.select(config.topics, config.labels)
        return [each.decode() for each in log.frames(selection) if each.labelled]


def _on_idd(folder: Path) -> dict[str, Any]:
    """Return the pooled ERR of frames with a covered patch, and of the others, by share."""
    train, test = idd.both_ways(folder)[0]
    learn = [frame for drive in train.values() for frame in drive]
    shown = [frame for drive in test.values() for frame in drive]
    bare = np.array([_is_bare(frame) for frame in shown])
    found: dict[str, Any] = {"frames": [int((~bare).sum()), int(bare.sum())], "ERR": []}
    for share in SHARES:
        chain = _chain(_robust(share, idd.FEWER_PIXELS), learn, 0)
        counted = np.array([idd.counts(idd.last(chain, frame), frame) for frame in shown])
        found["ERR"].append([float(idd.err(counted[which].sum(axis=0))) for which in (~bare, bare)])
    return found


def _is_bare(frame: Frame) -> bool:
    assert frame.truth is not None
    inside = frame.truth[patch_mask(*frame.truth.shape, ReferencePatch()) > 0]
    return bool((inside == ROAD).mean() >= ROAD_ON_PATCH)


def _robust(share: float, pixels: int | None = None) -> RunConfig:
    fewer = {} if pixels is None else {"max_pixels": pixels}
    return configure({"preset": "robust", "training": {"covered": share, **fewer}})


def _chain(config: RunConfig, frames: Sequence[Frame], seed: int) -> Any:
    model = fit(frames, {"it": config.pipeline}, replace(config.training, seed=seed))
    return config.pipeline.bind(model.parameters["it"])

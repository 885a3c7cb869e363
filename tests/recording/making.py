"""A drive of tiny frames, and a pipeline's results on them, made by hand."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from roadeval import Recording
from roadeval.data import (
    ERRORS,
    Counts,
    Frame,
    FrameResult,
    Health,
    LabelClass,
    Layer,
    LayerKind,
    LayerSpec,
    Output,
    Packed,
    Role,
    StageResult,
    Tally,
    VariantLayout,
    VariantResult,
    mask_spec,
)
from roadeval.evaluation.metrics import METRICS
from roadeval.recording import rrd_file
from roadeval.recording.layout import Layout
from roadeval.recording.recorder import Recorder
from roadeval.recording.rrd_file import RrdFile
from roadeval.results.schema import TABLES
from tests.results.making import facts_of, lines

HEIGHT, WIDTH = 6, 8

NDI = LayerSpec("ndi", LayerKind.SCALAR, "NDI (Eq. 6)", value_range=(-1.0, 1.0))
RINGS = LayerSpec(
    "rings",
    LayerKind.LABELS,
    "Rings",
    (
        LabelClass(0, "none", (0, 0, 0, 0)),
        LabelClass(1, "shadow", (0, 0, 255, 128)),
        LabelClass(2, "ring", (255, 255, 0, 255)),
    ),
)
POST = mask_spec("post", "Road")
VARIANT = VariantLayout("filtered", "with the filter", ("post",), (NDI, RINGS, POST))
SUMMARY = json.loads(facts_of(seconds={"filtered": {"post": 0.5}}).text())
WINDOW = {
    "drive": "street",
    "camera": "/camera/image",
    "window": 0,
    "first_frame": 2,
    "last_frame": 18,
    "frames": 17,
} | {**dict.fromkeys(TABLES["windows"].names[8:], 0.25), "variant": "filtered", "stage": "post"}
WINDOWS = ",".join(str(WINDOW[name]) for name in TABLES["windows"].names)
RESULTS = {"summary": json.dumps(SUMMARY), "windows": f"{TABLES['windows'].header}{WINDOWS}\n"}
RERUN = Path(sys.executable).with_name("rerun")


def layout(**changes):
    """The layout of the drive that `result` makes frames of."""
    plain = Layout(
        "street",
        WIDTH,
        HEIGHT,
        (VARIANT,),
        ("ERR", "FNR"),
        tables={"frames": TABLES["frames"].header},
    )
    return replace(plain, **changes)


def frame(number, **changes):
    """A frame whose image and truth depend on its number."""
    draw = np.random.default_rng(number)
    image = draw.integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)
    truth = draw.choice(np.array([0, 1, 255], np.uint8), (HEIGHT, WIDTH))
    plain = Frame(number, 10**9 * number + 7, 10**9 * number + 9, image, image.tobytes())
    return replace(plain, truth=truth, **changes)


def result(number, *, err=0.25, fnr=0.5, **changes):
    """An evaluated frame's result: one filter that gives layers, one stage that gives a mask."""
    shown = frame(number)
    draw = np.random.default_rng(1000 + number)
    ndi = draw.integers(0, 256, (HEIGHT, WIDTH), np.uint8)
    rings = draw.integers(0, 3, (HEIGHT, WIDTH), np.uint8)
    mask = draw.integers(0, 2, (HEIGHT, WIDTH), np.uint8)
    errors = draw.integers(0, 5, (HEIGHT, WIDTH), np.uint8)
    found = Output((Layer(NDI, ndi), Layer(RINGS, rings)), facts={"components": 3.0})
    filtering = StageResult("shadow", found, 0.004)
    packed = Packed.of(mask)
    final = StageResult("post", Output((Layer(POST, packed),), mask=packed), 0.002)
    tally = Tally(
        "filtered",
        "post",
        Counts(1, 2, 3, 4),
        rates=dict.fromkeys(METRICS, 0.5) | {"ERR": err, "FNR": fnr},
    )
    plain = FrameResult(
        shown,
        Role.EVALUATED,
        (VariantResult("filtered", (filtering, final)),),
        errors={"filtered": Layer(ERRORS, errors)},
        tallies=(tally,),
        health={"filtered": Health.OK},
    )
    return replace(plain, **changes)


def unscored(number, role=Role.TRAINING):
    """A frame that is recorded, but not counted."""
    return result(number, role=role, errors={}, tallies=(), health={})


def rows_of(recording, path, component):
    """How many values each frame's row of an entity has: none where nothing is to be shown."""
    file, found = recording._file, {}
    for place in file.messages.get(path, ()):
        with file.path.open("rb") as opened:
            opened.seek(place.offset)
            _, batch = rrd_file.rows_of(opened.read(place.size))
        if place.span != rrd_file.ALWAYS and component in batch.schema.names:
            values = batch.column(component).to_pylist()
            found |= zip(batch.column("frame").to_pylist(), map(len, values), strict=True)
    return found


def some_frames():
    """Two training frames, 17 evaluated ones with two notes on one."""
    frames = [*map(unscored, range(2)), *map(result, range(2, 19))]
    frames[5] = replace(frames[5], notes=("It rains.", "It pours."))
    return frames


def record(path, results, known=None, texts=None):
    """Write a complete recording of these frames, and open it."""
    with Recorder(path, known or layout()) as recorder:
        for each in results:
            recorder.write(recorder.encode(each, 0), lines(each))
        recorder.finish(RESULTS if texts is None else texts)
    return Recording(path)


def paths_of(recording):
    """The paths of all entities that hold something."""
    return {*RrdFile(recording).messages}


def rerun(*words):
    """Run Rerun's own tool; its exit code."""
    quiet = {**os.environ, "CI": "1"}
    words = [RERUN, "rrd", *map(str, words)]
    return subprocess.run(words, env=quiet, capture_output=True, check=False).returncode

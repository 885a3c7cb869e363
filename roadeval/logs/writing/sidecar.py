"""The sidecar: a log of results beside the camera's log, for Foxglove and Lichtblick.

Viewers merge files that are open together by their times, so the sidecar's messages bear the
images' own stamps and log times; the camera's log is not changed.
"""

from __future__ import annotations

import json
import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import Frame, FrameResult, Layer, Tally
from roadeval.logs.writing.writer import LogWriter

ROOT: Final = "/roadeval"
METRICS: Final = "roadeval.Metrics"
_INTEGER: Final = {"type": "integer"}
_RATE: Final = {"type": ["number", "null"], "description": "a fraction; null if undefined"}


class SidecarWriter(LogWriter):
    """Writes masks, error maps and metrics of each frame.

    ``/roadeval/<variant>/<stage>`` holds a mask (PNG, road 255), ``/roadeval/<variant>/errors``
    the error map in its colours (PNG), ``/roadeval/metrics/<variant>/<stage>`` counts and rates
    (JSON with a schema).
    """

    def write(self, result: FrameResult) -> None:
        """Write a frame's results; frames come in the order of their log times.

        A `LogError` if the disk is full.
        """
        stamp, log_time = result.frame.stamp_ns, result.frame.log_time_ns
        for variant in result.variants:
            for stage, mask in variant.masks():
                topic, levels = f"{ROOT}/{variant.variant}/{stage}", mask.pixels() * np.uint8(255)
                self.mask(topic, stamp, levels, log_time_ns=log_time)
        for name, errors in result.errors.items():
            topic = f"{ROOT}/{name}/{errors.spec.name}"
            self.mask(topic, stamp, _coloured(errors), log_time_ns=log_time)
        for tally in result.tallies:
            topic = f"{ROOT}/metrics/{tally.variant}/{tally.stage}"
            schema = METRICS, _schema(tuple(tally.rates))
            self.json(topic, stamp, _message(result.frame, tally), schema, log_time_ns=log_time)


def _message(frame: Frame, tally: Tally) -> dict[str, Any]:
    counts = tally.counts
    rates = {name: None if math.isnan(rate) else rate for name, rate in tally.rates.items()}
    return {
        "timestamp": {"sec": frame.stamp_ns // 10**9, "nsec": frame.stamp_ns % 10**9},
        "frame": frame.number,
        "variant": tally.variant,
        "stage": tally.stage,
        "TP": counts.tp,
        "TN": counts.tn,
        "FP": counts.fp,
        "FN": counts.fn,
        "N": counts.n,
        **rates,
    }


class NoSidecar:
    """Writes nothing, for a run without a sidecar."""

    path: Final = None

    def write(self, result: FrameResult) -> None:
        """Write nothing."""

    def finish(self) -> None:
        """Write nothing."""

    def __enter__(self) -> NoSidecar:
        return self

    def __exit__(self, *error: object) -> None:
        """Nothing is open."""


def _coloured(layer: Layer) -> npt.NDArray[np.uint8]:
    """Paint a label layer in its classes' colours: ``(H, W, 4)`` RGBA."""
    palette = np.zeros((256, 4), np.uint8)
    for label in layer.spec.classes:
        palette[label.value] = label.rgba
    return palette[np.asarray(layer.array, np.uint8)]


def _schema(rates: tuple[str, ...]) -> str:
    """Return the JSON Schema of the metrics, with Foxglove's own form of a time."""
    time = {
        "type": "object",
        "title": "time",
        "properties": {"sec": _INTEGER, "nsec": _INTEGER},
    }
    counts = dict.fromkeys(("frame", "TP", "TN", "FP", "FN", "N"), _INTEGER)
    properties = {"timestamp": time, "variant": {"type": "string"}, "stage": {"type": "string"}}
    properties |= counts | dict.fromkeys(rates, _RATE)
    return json.dumps({"title": METRICS, "type": "object", "properties": properties})

"""The sidecar: a log of results beside the camera's log, for Foxglove and Lichtblick.

Viewers merge files that are open together by their times, so the sidecar's messages bear the
images' own stamps and log times; the camera's log is not changed.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import Frame, FrameResult, Layer, Tally
from roadeval.logs.writing.writer import LogWriter

ROOT: Final = "/roadeval"
METRICS: Final = "roadeval.Metrics"
_INTEGER: Final = {"type": "integer"}
_RATE: Final = {"type": ["number", "null"], "description": "a fraction; null if undefined"}


class SidecarWriter:
    """Writes masks, error maps and metrics of each frame.

    ``/roadeval/<variant>/<stage>`` holds a mask (PNG, road 255), ``/roadeval/<variant>/errors``
    the error map in its colours (PNG), ``/roadeval/metrics/<variant>/<stage>`` counts and rates
    (JSON with a schema).

    Parameters
    ----------
    path
        The file to write; it appears under its name when it is complete.

    Raises
    ------
    LogError
        If it cannot be written.
    """

    def __init__(self, path: str | Path) -> None:
        self._log = LogWriter(path)

    @property
    def path(self) -> Path:
        """The file to write."""
        return self._log.path

    def write(self, result: FrameResult) -> None:
        """Write a frame's results; frames come in the order of their log times.

        Raises
        ------
        LogError
            If the disk is full.
        """
        frame = result.frame
        for variant in result.variants:
            for stage, mask in variant.masks():
                self._png(f"{ROOT}/{variant.variant}/{stage}", frame, mask.pixels() * np.uint8(255))
        for name, errors in result.errors.items():
            self._png(f"{ROOT}/{name}/{errors.spec.name}", frame, _coloured(errors))
        for tally in result.tallies:
            self._metrics(frame, tally)

    def _png(self, topic: str, frame: Frame, pixels: npt.NDArray[np.uint8]) -> None:
        self._log.mask(topic, frame.stamp_ns, pixels, log_time_ns=frame.log_time_ns)

    def _metrics(self, frame: Frame, tally: Tally) -> None:
        counts = tally.counts
        message: dict[str, Any] = {
            "timestamp": {"sec": frame.stamp_ns // 10**9, "nsec": frame.stamp_ns % 10**9},
            "frame": frame.number,
            "variant": tally.variant,
            "stage": tally.stage,
            "TP": counts.tp,
            "TN": counts.tn,
            "FP": counts.fp,
            "FN": counts.fn,
            "N": counts.n,
        }
        rates = tally.rates.items()
        message |= {name: None if math.isnan(rate) else rate for name, rate in rates}
        topic = f"{ROOT}/metrics/{tally.variant}/{tally.stage}"
        schema = (METRICS, _schema(tuple(tally.rates)))
        self._log.json(topic, frame.stamp_ns, message, schema, log_time_ns=frame.log_time_ns)

    def finish(self) -> None:
        """Write the end of the file, which takes its name when the context ends."""
        self._log.finish()

    def __enter__(self) -> SidecarWriter:
        return self

    def __exit__(self, *error: Any) -> None:
        self._log.__exit__(*error)


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

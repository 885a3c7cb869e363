"""Results back to MCAP: a log beside the log, for Foxglove and Lichtblick.

Viewers merge files that are open together by their times, so the sidecar bears the images' own
stamps and log times, and the log itself stays as it is.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import Counts, Frame, FrameResult, Layer, Tally
from roadeval.logs.writing.writer import LogWriter

ROOT: Final = "/roadeval"
METRICS: Final = "roadeval.Metrics"
_INTEGER: Final = {"type": "integer"}
_RATE: Final = {"type": ["number", "null"], "description": "a fraction; null if undefined"}

Rates = Callable[[Counts], Mapping[str, float]]


class SidecarWriter:
    """Writes masks, error maps and metrics of each frame.

    ``/roadeval/<variant>/<stage>`` holds a mask (PNG, road 255), ``/roadeval/<variant>/errors``
    the error map in its colours (PNG), ``/roadeval/metrics/<variant>/<stage>`` counts and rates
    (JSON with a schema).

    Parameters
    ----------
    path
        The file to write; it appears under its name when it is complete.
    rates
        Names and values of the rates of a frame's counts; NaN where undefined.

    Raises
    ------
    LogError
        If it cannot be written.
    """

    def __init__(self, path: str | Path, rates: Rates) -> None:
        self._log = LogWriter(path)
        self._rates = rates
        self._schema = _schema(tuple(rates(Counts(1, 1, 1, 1))))

    @property
    def path(self) -> Path:
        """The file to write."""
        return self._log.path

    def write(self, result: FrameResult) -> None:
        """Write what became of a frame; frames in the order of their log times.

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
        rates = self._rates(counts).items()
        message |= {name: None if math.isnan(rate) else rate for name, rate in rates}
        topic = f"{ROOT}/metrics/{tally.variant}/{tally.stage}"
        schema = (METRICS, self._schema)
        self._log.json(topic, frame.stamp_ns, message, schema, log_time_ns=frame.log_time_ns)

    def close(self) -> None:
        """Complete the file and give it its name."""
        self._log.close()

    def __enter__(self) -> SidecarWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._log.__exit__(kind, error, trace)


class NoSidecar:
    """Writes nothing, for a run that was not asked for one."""

    path: Final = None

    def write(self, result: FrameResult) -> None:
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
    """Describe the metrics in JSON Schema, with Foxglove's own form of a time."""
    time = {
        "type": "object",
        "title": "time",
        "properties": {"sec": _INTEGER, "nsec": _INTEGER},
    }
    counts = dict.fromkeys(("frame", "TP", "TN", "FP", "FN", "N"), _INTEGER)
    properties = {"timestamp": time, "variant": {"type": "string"}, "stage": {"type": "string"}}
    properties |= counts | dict.fromkeys(rates, _RATE)
    return json.dumps({"title": METRICS, "type": "object", "properties": properties})

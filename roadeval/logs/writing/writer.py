"""The writer of camera logs, which Foxglove and Rerun open too."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
import numpy.typing as npt
from mcap.writer import Writer

from roadeval.data import Frame, FrameResult, Layer, Tally
from roadeval.logs.errors import LogError
from roadeval.runtime.files import NewFile
from roadeval.version import VERSION

FORMATS: Final = ("jpeg", "png", "webp")
FRAME_ID: Final = "camera"
"""The camera's coordinate frame, by name."""


class LogWriter:
    """Writes images to an MCAP file with Foxglove's protobuf schemas.

    The same calls give the same bytes. The file appears under its name when it is complete: at the
    end of the ``with`` statement, and never if that ends by an exception. An existing file is
    replaced, and the folder is made if it does not exist. A `LogError` if it cannot be written.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._new = NewFile(self.path)
        with self._explained():
            self._new.begin()
            self._file = self._new.partial.open("wb")
        self._writer = Writer(self._file)
        self._writer.start(library=f"roadeval {VERSION}")
        self._schemas: dict[tuple[str, str], int] = {}
        self._channels: dict[str, int] = {}
        self._counts: dict[int, int] = {}

    def image(
        self,
        topic: str,
        stamp_ns: int,
        data: bytes,
        format: str,  # noqa: A002
        *,
        log_time_ns: int | None = None,
    ) -> None:
        """Write an image file as it is.

        ``format`` is ``jpeg``, ``png`` or ``webp``; the log time is the stamp by default. A
        `LogError` if the disk is full, or the format is another.
        """
        from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage

        if format not in FORMATS:
            raise LogError(f"{topic}: format {format!r} is none of {', '.join(FORMATS)}")
        message = CompressedImage(frame_id=FRAME_ID, data=data, format=format)
        message.timestamp.FromNanoseconds(stamp_ns)

        def text() -> bytes:
            from mcap_protobuf.schema import build_file_descriptor_set

            described: bytes = build_file_descriptor_set(CompressedImage).SerializeToString(
                deterministic=True
            )
            return described

        schema = CompressedImage.DESCRIPTOR.full_name, "protobuf"
        channel = self._channel(topic, "protobuf", schema, text)
        data = message.SerializeToString(deterministic=True)
        self._write(channel, stamp_ns, log_time_ns, data)

    def mask(
        self,
        topic: str,
        stamp_ns: int,
        mask: npt.NDArray[np.uint8],
        *,
        log_time_ns: int | None = None,
    ) -> None:
        """Write a ``(H, W)`` mask, or an image in RGB or RGBA, uint8, as a PNG without loss.

        A `LogError` if the disk is full.
        """
        import cv2

        codes = {3: cv2.COLOR_RGB2BGR, 4: cv2.COLOR_RGBA2BGRA}
        stored = mask if mask.ndim == 2 else cv2.cvtColor(mask, codes[mask.shape[2]])
        _, png = cv2.imencode(".png", stored)
        self.image(topic, stamp_ns, png.tobytes(), "png", log_time_ns=log_time_ns)

    def json(
        self,
        topic: str,
        stamp_ns: int,
        message: Mapping[str, Any],
        schema: tuple[str, str],
        *,
        log_time_ns: int | None = None,
    ) -> None:
        """Write a message in JSON, with its schema's name and text (JSON Schema).

        A `LogError` if the disk is full.
        """
        name, text = schema
        channel = self._channel(topic, "json", (name, "jsonschema"), text.encode)
        data = json.dumps(message, allow_nan=False, separators=(",", ":")).encode()
        self._write(channel, stamp_ns, log_time_ns, data)

    def _channel(
        self, topic: str, encoding: str, schema: tuple[str, str], text: Callable[[], bytes]
    ) -> int:
        """Return the channel of a topic, with a schema's name and encoding; made if it is new."""
        if topic not in self._channels:
            if schema not in self._schemas:
                self._schemas[schema] = self._writer.register_schema(*schema, text())
            number = self._schemas[schema]
            self._channels[topic] = self._writer.register_channel(topic, encoding, number)
        return self._channels[topic]

    def _write(self, channel: int, stamp_ns: int, log_time_ns: int | None, data: bytes) -> None:
        sequence = self._counts[channel] = self._counts.get(channel, -1) + 1
        log_time = stamp_ns if log_time_ns is None else log_time_ns
        with self._explained():
            self._writer.add_message(channel, log_time, data, stamp_ns, sequence)

    def finish(self) -> None:
        """Write the end of the file; `close` gives it its name.

        A `LogError` if the disk is full.
        """
        if not self._file.closed:
            with self._explained():
                self._writer.finish()  # type: ignore[no-untyped-call]
                self._file.close()

    def close(self) -> None:
        """Complete the file and give it its name; a `LogError` if the disk is full."""
        try:
            self.finish()
            with self._explained():
                self._new.publish()
        except BaseException:
            self._discard()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_error: object) -> None:
        if kind is None:
            self.close()
        else:
            self._discard()

    def _discard(self) -> None:
        """Remove the unfinished file."""
        # On a full disk closing fails as well, but the first error is the one to report.
        with suppress(OSError):
            self._file.close()
        self._new.discard()

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise LogError(f"{self.path}: cannot be written: {error.strerror}") from error


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

"""The writer of camera logs, which Foxglove and Rerun open too."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
import numpy.typing as npt
from mcap.writer import Writer

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

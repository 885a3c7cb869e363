"""Writing camera logs that Foxglove and Rerun open too."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from mcap.writer import Writer

from roadeval.logs.errors import LogError
from roadeval.version import VERSION

FORMATS: Final = ("jpeg", "png", "webp")


class LogWriter:
    """Writes images to an MCAP file with Foxglove's protobuf schemas.

    The same calls give the same bytes. The file appears under its name when it is complete:
    at the end of the ``with`` statement, and never if that ends by an exception.

    Parameters
    ----------
    path
        The file to write; an existing one is replaced.

    Raises
    ------
    LogError
        If it cannot be written.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._temporary = self.path.with_name(f".{self.path.stem}.part.mcap")
        try:
            self._file = self._temporary.open("wb")
        except OSError as error:
            raise LogError(f"{self.path}: cannot be written: {error.strerror}") from error
        self._writer = Writer(self._file)
        self._writer.start(library=f"roadeval {VERSION}")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._counts: dict[int, int] = {}

    def image(
        self,
        topic: str,
        stamp_ns: int,
        data: bytes,
        format: str,  # noqa: A002
        *,
        frame_id: str = "camera",
        log_time_ns: int | None = None,
    ) -> None:
        """Write an image file as it is.

        Parameters
        ----------
        topic
            Where to.
        stamp_ns
            Header stamp.
        data, format
            The file's bytes, and ``jpeg``, ``png`` or ``webp``.
        frame_id
            The camera's coordinate frame.
        log_time_ns
            Log time; the stamp by default.

        Raises
        ------
        LogError
            If the disk is full, or the format is another.
        """
        from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage

        if format not in FORMATS:
            raise LogError(f"{topic}: format {format!r} is none of {', '.join(FORMATS)}")
        message = CompressedImage(frame_id=frame_id, data=data, format=format)
        message.timestamp.FromNanoseconds(stamp_ns)
        self._write(topic, message, stamp_ns, stamp_ns if log_time_ns is None else log_time_ns)

    def mask(
        self,
        topic: str,
        stamp_ns: int,
        mask: npt.NDArray[np.uint8],
        *,
        frame_id: str = "camera",
        log_time_ns: int | None = None,
    ) -> None:
        """Write a ``(H, W)`` uint8 mask or ``(H, W, 3)`` RGB image as a PNG, without loss.

        Raises
        ------
        LogError
            If the disk is full.
        """
        import cv2

        bgr = mask if mask.ndim == 2 else cv2.cvtColor(mask, cv2.COLOR_RGB2BGR)
        _, png = cv2.imencode(".png", bgr)
        self.image(
            topic, stamp_ns, png.tobytes(), "png", frame_id=frame_id, log_time_ns=log_time_ns
        )

    def _write(self, topic: str, message: Any, stamp_ns: int, log_time_ns: int) -> None:
        channel = self._channel(topic, type(message))
        sequence = self._counts[channel] = self._counts.get(channel, -1) + 1
        data = message.SerializeToString(deterministic=True)
        try:
            self._writer.add_message(channel, log_time_ns, data, stamp_ns, sequence)
        except OSError as error:
            raise LogError(f"{self.path}: cannot be written: {error.strerror}") from error

    def _channel(self, topic: str, message: Any) -> int:
        from mcap_protobuf.schema import build_file_descriptor_set

        if topic not in self._channels:
            name = message.DESCRIPTOR.full_name
            if name not in self._schemas:
                schema = build_file_descriptor_set(message).SerializeToString(deterministic=True)
                self._schemas[name] = self._writer.register_schema(name, "protobuf", schema)
            self._channels[topic] = self._writer.register_channel(
                topic, "protobuf", self._schemas[name]
            )
        return self._channels[topic]

    def close(self) -> None:
        """Complete the file and give it its name.

        Raises
        ------
        LogError
            If the disk is full.
        """
        try:
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._file.close()
            self._temporary.replace(self.path)
        except OSError as error:
            raise LogError(f"{self.path}: cannot be written: {error.strerror}") from error

    def __enter__(self) -> LogWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self.close()
        else:
            self._file.close()
            self._temporary.unlink(missing_ok=True)

"""The writer of camera logs, which Foxglove and Rerun open too; of images, a video, or results.

Viewers merge files that are open together by their times, so the messages of a sidecar of results
bear the images' own stamps and log times; the camera's log is not changed.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
import numpy.typing as npt
from mcap.writer import Writer

from roadeval.data import Frame, FrameResult, Layer, Tally
from roadeval.images import ImageError, format_of, png_of, size_of
from roadeval.logs.errors import LogError
from roadeval.logs.files import IMAGES, images_of, listed, of_ids, ordered, some
from roadeval.logs.settings import NS
from roadeval.runtime.files import NewFile, check_input
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
        frame_id: str = FRAME_ID,
    ) -> None:
        """Write an image file as it is.

        ``format`` is ``jpeg``, ``png`` or ``webp``; the log time is the stamp by default. A
        `LogError` if the disk is full, or the format is another.
        """
        from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage

        if format not in FORMATS:
            raise LogError(f"{topic}: format {format!r} is none of {', '.join(FORMATS)}")
        message = CompressedImage(frame_id=frame_id, data=data, format=format)
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
        frame_id: str = FRAME_ID,
    ) -> None:
        """Write a ``(H, W)`` mask, or an image in RGB or RGBA, uint8, as a PNG without loss.

        A `LogError` if the disk is full.
        """
        png = png_of(mask)
        self.image(topic, stamp_ns, png, "png", log_time_ns=log_time_ns, frame_id=frame_id)

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
    (JSON with a schema). Of a rig the camera's name follows after ``/roadeval``.
    """

    def write(self, result: FrameResult, frame_id: str, camera: str = "") -> None:
        """Write a frame's results; frames come in the order of their log times.

        ``frame_id`` is the source's, ``camera`` its name in a rig. A `LogError` if the disk is
        full.
        """
        root = "/".join(filter(None, (ROOT, camera.strip("/"))))
        stamp, log_time = result.frame.stamp_ns, result.frame.log_time_ns
        images: dict[str, npt.NDArray[np.uint8]] = {}
        for variant in result.variants:
            for stage, mask in variant.masks():
                images[f"{root}/{variant.variant}/{stage}"] = mask.pixels() * np.uint8(255)
        for name, errors in result.errors.items():
            images[f"{root}/{name}/{errors.spec.name}"] = _coloured(errors)
        for topic, image in images.items():
            self.mask(topic, stamp, image, log_time_ns=log_time, frame_id=frame_id or FRAME_ID)
        for tally in result.tallies:
            topic = f"{root}/metrics/{tally.variant}/{tally.stage}"
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

    def write(self, result: FrameResult, frame_id: str, camera: str = "") -> None:
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
    time = {"type": "object", "title": "time", "properties": {"sec": _INTEGER, "nsec": _INTEGER}}
    counts = dict.fromkeys(("frame", "TP", "TN", "FP", "FN", "N"), _INTEGER)
    properties = {"timestamp": time, "variant": {"type": "string"}, "stage": {"type": "string"}}
    properties |= counts | dict.fromkeys(rates, _RATE)
    return json.dumps({"title": METRICS, "type": "object", "properties": properties})


CAMERA: Final = "/camera/image"
TRUTH: Final = "/truth/road"
DEFAULT_RATE_HZ: Final = 10.0
LABEL_DELAY_NS: Final = 1
"""A label is logged right after its image."""

VIDEO_SUFFIXES: Final = (".mp4", ".m4v", ".mov", ".avi", ".mkv", ".webm", ".ts", ".mpg", ".mpeg")
QUALITY: Final = 95
"""JPEG quality of a video's frames, 0 to 100."""


@dataclass(frozen=True, slots=True)
class PackResult:
    """The log that was written, and what a user should know of it."""

    path: Path
    frames: int
    labelled: int
    """Images, and how many of them have a mask."""
    stamps: str
    """Source of the stamps, in words."""
    warnings: tuple[str, ...] = ()
    """Images without a mask (if there are masks), and masks without an image."""


def pack(
    images: str | Path,
    output: str | Path,
    *,
    masks: str | Path | None = None,
    rate_hz: float | None = None,
) -> PackResult:
    """Write a folder of images, in natural order, or a video as a log: see `roadeval.pack`.

    JPEGs and PNGs go in as they are, a video's frames as JPEGs of quality 95. ``masks`` is a folder
    of label images without loss; each belongs to the image of the same name, endings such as
    ``_mask`` aside. The same files give the same bytes. A `LogError` if there is nothing to pack, a
    file is unreadable, or no mask belongs to an image.

    ``rate_hz`` is images a second: by default a video's own; of images, the times in their names if
    every name is a time (seconds, or milli-, micro- or nanoseconds since 1970), else 10.
    """
    images, output = Path(images), Path(output)
    if rate_hz is not None and not 1e-4 <= rate_hz <= 1000:
        raise LogError(f"{rate_hz:g} images a second: must be at least 0.0001 and at most 1000")
    if images.suffix.lower() in VIDEO_SUFFIXES and images.is_file():
        if masks is not None:
            raise LogError(f"{images}: masks go with a folder of images, not with a video")
        count = 0
        with LogWriter(output) as log:
            for count, (time_ns, jpeg) in enumerate(_frames_of(images), start=1):
                if rate_hz is not None:
                    time_ns = round((count - 1) * NS / rate_hz)  # noqa: PLW2901
                log.image(CAMERA, time_ns, jpeg, "jpeg")
            if not count:
                raise LogError(f"{images}: a video without frames")
        words = "the video's own times" if rate_hz is None else f"{rate_hz:g} images a second"
        return PackResult(output, count, 0, words)
    if not images.is_dir():
        raise LogError(f"{images}: neither a folder of images nor a video")
    return _pack_folder(images, output, Path(masks) if masks else None, rate_hz)


def _pack_folder(
    images: Path, output: Path, masks: Path | None, rate_hz: float | None
) -> PackResult:
    files, labels = listed(images, IMAGES), _label_images(masks, images) if masks else []
    belong = images_of(labels, files)
    if labels and not belong:
        raise LogError(f"{masks}: no mask has the name of an image in {images} ({some(labels)})")
    by_image = {image: label for label, image in belong.items()}
    if len(by_image) < len(belong):
        extra = next(label for label in belong if by_image[belong[label]] != label)
        other = by_image[belong[extra]]
        raise LogError(f"{masks}: {extra.name} and {other.name} belong to the same image")
    stamps, words = _stamps(files, rate_hz)
    with LogWriter(output) as log:
        for file, stamp in stamps.items():
            log.image(CAMERA, stamp, *_image(file))
            if file in by_image:
                label = _image(by_image[file], is_label=True)
                log.image(TRUTH, stamp, *label, log_time_ns=stamp + LABEL_DELAY_NS)
    used = set(by_image.values())
    warnings = (
        *_unpaired("images without a mask", [f for f in files if labels and f not in by_image]),
        *_unpaired("masks without an image", [label for label in labels if label not in used]),
    )
    return PackResult(output, len(files), len(by_image), words, warnings)


def _label_images(masks: Path, images: Path) -> Sequence[Path]:
    try:
        if masks.resolve() == images.resolve():
            raise LogError(f"{masks}: the images themselves")
        return of_ids(listed(masks, IMAGES))
    except LogError as error:
        if not masks.exists():
            raise
        raise LogError(
            f"{error}; labels of an annotation tool are for the packed log: pack without them, "
            f"then roadeval replay LOG.mcap --truth {masks} --truth-images {images}"
        ) from error


def _unpaired(what: str, files: Sequence[Path]) -> Iterator[str]:
    """Yield a sentence that names some of the files, if there are any."""
    if files:
        yield f"{what}: {some(files)} ({len(files)} in all)"


def _stamps(files: list[Path], rate_hz: float | None) -> tuple[dict[Path, int], str]:
    """Return each file's stamp, in the order of the stamps, and their source in words."""
    in_order, times = ordered(files)
    if rate_hz is None and times is not None:
        return dict(zip(in_order, times, strict=True)), "the times in the files' names"
    rate = rate_hz or DEFAULT_RATE_HZ
    regular = {file: round(i * NS / rate) for i, file in enumerate(files)}
    return regular, f"{rate:g} images a second"


def _frames_of(video: Path) -> Iterator[tuple[int, bytes]]:
    """Yield each frame's time in nanoseconds after the first, and the frame as a JPEG.

    A `LogError` if it cannot be read, or holds no video.
    """
    import av
    import cv2

    try:
        with av.open(str(video)) as container:
            if not container.streams.video:
                raise LogError(f"{video}: it holds no video")
            stream = container.streams.video[0]
            first: int | None = None
            for index, frame in enumerate(container.decode(stream)):
                pts = index if frame.pts is None else frame.pts
                first = pts if first is None else first
                unit = stream.time_base or Fraction(1, 25)
                bgr = frame.to_ndarray(format="bgr24")
                _, jpeg = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
                yield round((pts - first) * unit * NS), jpeg.tobytes()
    except (av.FFmpegError, OSError) as error:
        raise LogError(f"{video}: not a readable video ({error.strerror})") from error


def _image(file: Path, *, is_label: bool = False) -> tuple[bytes, str]:
    """Read a JPEG or PNG file as it is, whatever its ending; a label must not be a JPEG."""
    try:
        check_input(file)
        data = file.read_bytes()
        size_of(data)
        format_ = format_of(data)
        assert format_ is not None
        if is_label and not format_.exact:
            raise LogError(f"{file}: {format_.name} changes label values; masks must be lossless")
        if format_.media_type is None:
            raise LogError(f"{file}: {format_.name}, which not all viewers know: save it as PNG")
        return data, format_.media_type.removeprefix("image/")
    except OSError as error:
        raise LogError(f"{file}: {error.strerror}") from error
    except ImageError as error:
        raise LogError(f"{file}: {error}") from error

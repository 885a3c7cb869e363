"""Writers of camera logs from images, a video, or results; Foxglove and Rerun can open the logs.

Viewers merge open files by time, so the messages of a sidecar of results have the stamps and log
times of the images. The camera's log is not changed.
"""

from __future__ import annotations

import json
import math
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from heapq import heappop, heappush
from itertools import chain, count, repeat
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
from mcap.records import Channel
from mcap.records import Schema as McapSchema
from mcap.writer import Writer

from roadeval.data import FrameResult
from roadeval.data.arrays import Image
from roadeval.data.words import counted
from roadeval.images.decoding import orientation_of, png_of, size_of, upright
from roadeval.images.formats import ImageError, Limits, format_of
from roadeval.logs.container.records import Message
from roadeval.logs.errors import LogError
from roadeval.logs.files import (
    IMAGES,
    first_names,
    images_of,
    list_files,
    order_by_time,
    prefer_ids,
)
from roadeval.logs.messages.pictures import turn_of
from roadeval.logs.settings import NS
from roadeval.logs.writing import kitti
from roadeval.runtime.files import NewFile, check_input, reading, writing
from roadeval.version import VERSION

FRAME_ID: Final = "camera"
"""The default name of the camera's coordinate frame."""


Schema = tuple[str, str, bytes]
"""Name, encoding and text."""


class LogWriter:
    """Writes images to an MCAP file with Foxglove's protobuf schemas.

    The same calls give the same bytes. The file appears under its name at the end of the ``with``
    statement, unless that ends by an exception. An existing file is replaced, and the folder is
    made if necessary. A `LogError` if it cannot be written.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._new = NewFile(self.path)
        with writing(self.path, LogError):
            self._new.begin()
            self._file = self._new.partial.open("wb")
        self._writer = Writer(self._file)
        self._writer.start(library=f"roadeval {VERSION}")
        self._schemas: dict[Schema, int] = {}
        self._channels: dict[Any, tuple[int, Iterator[int]]] = {}
        """The channel of each topic, and the numbers of its messages."""

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
        """Write an image file unchanged.

        ``format`` is ``jpeg``, ``png`` or ``webp``; the log time is the stamp by default. A
        `LogError` if the disk is full, or the format is another.
        """
        from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage

        if format not in (formats := ("jpeg", "png", "webp")):
            raise LogError(f"format {format!r} is none of {', '.join(formats)}", where=topic)
        message = CompressedImage(frame_id=frame_id, data=data, format=format)
        self.message(topic, stamp_ns, message, log_time_ns)

    def message(self, topic: str, stamp_ns: int, proto: Any, logged_ns: int | None = None) -> None:
        """Write a message of Foxglove's protobuf schemas; its stamp is set."""
        proto.timestamp.FromNanoseconds(stamp_ns)
        data = proto.SerializeToString(deterministic=True)
        self._write(topic, _schema_of(proto.__class__), stamp_ns, logged_ns, data)

    def names(self, names: Sequence[str], stamp_ns: int = 0) -> None:
        """Write the names of all images, in their order: labels are found by them."""
        schema = "roadeval.ImageNames", "jsonschema", b'{"type": "object"}'
        data = json.dumps({"names": [*names]}).encode()
        self._write("/camera/names", schema, stamp_ns, None, data)

    def mask(
        self,
        topic: str,
        stamp_ns: int,
        mask: Image,
        *,
        log_time_ns: int | None = None,
        frame_id: str = FRAME_ID,
    ) -> None:
        """Write a ``(H, W)`` mask, or an RGB or RGBA image, as a PNG; errors as in `image`."""
        png = png_of(mask)
        self.image(topic, stamp_ns, png, "png", log_time_ns=log_time_ns, frame_id=frame_id)

    def copy(self, channel: Channel, about: McapSchema | None, message: Message, at: int) -> None:
        """Write another log's message at a log time; a `LogError` if the disk is full."""
        if (key := (str(channel), about and about.data)) not in self._channels:
            described = (about.name, about.encoding, about.data) if about else None
            schema = self._writer.register_schema(*described) if described else 0
            names = channel.topic, channel.message_encoding
            made = self._writer.register_channel(*names, schema, channel.metadata)
            self._channels[key] = made, count()
        (made, _), data = self._channels[key], bytes(message.data)
        with writing(self.path, LogError):
            self._writer.add_message(made, at, data, message.publish_time, message.sequence)

    def _write(
        self, topic: str, schema: Schema, stamp_ns: int, log_time_ns: int | None, data: bytes
    ) -> None:
        if topic not in self._channels:
            if schema not in self._schemas:
                self._schemas[schema] = self._writer.register_schema(*schema)
            encoding = schema[1].removesuffix("schema")
            channel = self._writer.register_channel(topic, encoding, self._schemas[schema])
            self._channels[topic] = channel, count()
        channel, sequence = self._channels[topic]
        log_time = stamp_ns if log_time_ns is None else log_time_ns
        with writing(self.path, LogError):
            self._writer.add_message(channel, log_time, data, stamp_ns, next(sequence))

    def finish(self) -> None:
        """Write the end of the file; a `LogError` if the disk is full."""
        if not self._file.closed:
            with writing(self.path, LogError):
                self._writer.finish()  # type: ignore[no-untyped-call]
                self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_error: object) -> None:
        try:
            if kind is None:
                self.finish()
                with writing(self.path, LogError):
                    self._new.publish()
        finally:
            # On a full disk closing fails as well; the first error is reported.
            with suppress(OSError):
                self._file.close()
            self._new.discard()


@cache
def _schema_of(kind: Any) -> Schema:
    from mcap_protobuf.schema import build_file_descriptor_set

    described = build_file_descriptor_set(kind).SerializeToString(deterministic=True)
    return kind.DESCRIPTOR.full_name, "protobuf", described


ROOT: Final = "/roadeval"
METRICS: Final = "roadeval.Metrics"
_COUNTS: Final = ("TP", "TN", "FP", "FN", "N")
_INTEGER: Final = {"type": "integer"}
_RATE: Final = {"type": ["number", "null"], "description": "a fraction; null if undefined"}


class SidecarWriter(LogWriter):
    """Writes masks, error maps and metrics of each frame.

    ``/roadeval/<variant>/<stage>`` has masks (PNG, road 255), ``/roadeval/<variant>/errors`` error
    maps in colours (PNG), and ``/roadeval/metrics/<variant>/<stage>`` counts and rates (JSON with a
    schema). In a rig the camera's name follows after ``/roadeval``.
    """

    def write(self, result: FrameResult, frame_id: str, camera: str = "") -> None:
        """Write the results of a frame; frames come in the order of their log times.

        ``frame_id`` is the image's, ``camera`` its name in a rig. A `LogError` if the disk is full.
        """
        root = "/".join(filter(None, (ROOT, camera.strip("/"))))
        frame = result.frame
        stamp, log_time = frame.stamp_ns, frame.log_time_ns
        images: dict[str, Image] = {}
        for variant in result.variants:
            for stage, mask in variant.masks():
                images[f"{root}/{variant.variant}/{stage}"] = mask.pixels() * np.uint8(255)
        for name, errors in result.errors.items():
            palette = np.zeros((256, 4), np.uint8)
            for label in errors.spec.classes:
                palette[label.value] = label.rgba
            codes = np.asarray(errors.array, np.uint8)
            images[f"{root}/{name}/{errors.spec.name}"] = palette[codes]
        for topic, image in images.items():
            self.mask(topic, stamp, image, log_time_ns=log_time, frame_id=frame_id or FRAME_ID)
        for tally in result.tallies:
            message: dict[str, Any] = {
                "timestamp": {"sec": stamp // NS, "nsec": stamp % NS},
                "frame": frame.number,
                "variant": tally.variant,
                "stage": tally.stage,
                **{name: getattr(tally.counts, name.lower()) for name in _COUNTS},
                **{name: None if math.isnan(rate) else rate for name, rate in tally.rates.items()},
            }
            data = json.dumps(message, allow_nan=False, separators=(",", ":")).encode()
            topic = f"{root}/metrics/{tally.variant}/{tally.stage}"
            self._write(topic, _metrics_schema(tuple(tally.rates)), stamp, log_time, data)


@cache
def _metrics_schema(rates: tuple[str, ...]) -> Schema:
    """Return the JSON Schema of the metrics, with Foxglove's form of a time."""
    time = {"type": "object", "title": "time", "properties": {"sec": _INTEGER, "nsec": _INTEGER}}
    counts = dict.fromkeys(("frame", *_COUNTS), _INTEGER)
    properties = {"timestamp": time, "variant": {"type": "string"}, "stage": {"type": "string"}}
    properties |= counts | dict.fromkeys(rates, _RATE)
    text = json.dumps({"title": METRICS, "type": "object", "properties": properties})
    return METRICS, "jsonschema", text.encode()


CAMERA: Final = "/camera/image"
TRUTH: Final = "/truth/road"
REORDERED: Final = 16
"""Frames of a video among which their times may be in another order."""
VIDEO_SUFFIXES: Final = (".mp4", ".m4v", ".mov", ".avi", ".mkv", ".webm", ".ts", ".mpg", ".mpeg")


@dataclass(frozen=True)
class PackResult:
    """The log that was written, and facts about it for the user."""

    path: Path
    frames: int
    labelled: int
    """Images, and images with a mask."""
    stamps: str
    """Source of the stamps, in words."""
    warnings: tuple[str, ...] = ()
    """Images without a mask (if there are masks), and masks without an image."""
    losses: tuple[str, ...] = ()
    """Parts of a damaged video that are not in the log."""


def pack(
    images: str | Path,
    output: str | Path,
    *,
    masks: str | Path | None = None,
    rate_hz: float | None = None,
) -> PackResult:
    """Write a folder of images in natural order, or a video, as a log: see `roadeval.pack`.

    JPEGs and PNGs are copied unchanged, frames of a video become JPEGs of quality 95. ``masks`` is
    a folder of lossless label images; each belongs to the image of the same name, without endings
    such as ``_mask``. The same files give the same bytes.

    ``rate_hz`` is images a second. By default a video has its own times; images have the times in
    their names if every name is a time (seconds, or milli-, micro- or nanoseconds since 1970), else
    10 images a second. The readable frames of a damaged video are written. A `LogError` if there is
    nothing to pack, a file is unreadable, or no mask belongs to an image.
    """
    images, output = Path(images), Path(output)
    if rate_hz is not None and not 1e-4 <= rate_hz <= 1000:
        raise LogError(f"{rate_hz:g} images a second: must be at least 0.0001 and at most 1000")
    if images.is_dir():
        return _pack_folder(images, output, Path(masks) if masks else None, rate_hz)
    if images.suffix.lower() not in VIDEO_SUFFIXES or not images.is_file():
        raise LogError("neither a folder of images nor a video", where=images)
    if masks is not None:
        raise LogError("masks go with a folder of images, not with a video", where=images)
    number, orientations, losses = 0, set[int](), list[str]()
    with LogWriter(output) as log:
        frames = _read_frames(images, orientations, losses)
        for number, (time_ns, jpeg) in enumerate(frames, start=1):
            regular = 0 if rate_hz is None else round((number - 1) * NS / rate_hz)
            log.image(CAMERA, time_ns if rate_hz is None else regular, jpeg, "jpeg")
        if not number:
            raise LogError("a video without frames", where=images)
    words = "the video's own times" if rate_hz is None else f"{rate_hz:g} images a second"
    matrix = "frames are turned as the video's display matrix asks; calibrations are of the sensor"
    warnings = (matrix,) if orientations - {1} else ()
    return PackResult(output, number, 0, words, warnings, tuple(losses))


def _pack_folder(
    images: Path, output: Path, masks: Path | None, rate_hz: float | None
) -> PackResult:
    folder = images if kitti.is_road(images) else None
    images = folder / kitti.IMAGES if folder else images
    road_files = kitti.truth_files(folder) if folder and not masks else []
    files = list_files(images, IMAGES)
    labels = _list_labels(masks, images) if masks else road_files
    belong = images_of(labels, files)
    if labels and not belong:
        raise LogError(
            f"no mask has the name of an image in {images} ({first_names(labels)})", where=masks
        )
    by_image: dict[Path, Path] = {}
    for label, image in belong.items():
        if (other := by_image.setdefault(image, label)) != label:
            raise LogError(f"{other.name} and {label.name} belong to the same image", where=masks)
    in_order, times = order_by_time(files)
    if rate_hz is None and times is not None:
        files, words = in_order, "the times in the files' names"
    else:
        rate = rate_hz or 10.0
        words = f"{rate:g} images a second"
        times = [round(i * NS / rate) for i in range(len(files))]
    turned: list[Path] = []
    with LogWriter(output) as log:
        if folder:
            log.names([file.stem for file in files])
        for file, stamp in zip(files, times, strict=True):
            data, name = _image(file)
            turned += [file] * (orientation_of(data) != 1)
            log.image(CAMERA, stamp, data, name)
            for topic, proto in kitti.messages(folder, file.stem, data, FRAME_ID) if folder else ():
                log.message(topic, stamp, proto)
            if file in by_image:
                label_file = _image(by_image[file], is_label=True, of_kitti=bool(road_files))
                log.image(TRUTH, stamp, *label_file, log_time_ns=stamp + 1)  # after its image
    unpaired = {
        "images without a mask": [file for file in files if labels and file not in by_image],
        "masks without an image": [label for label in labels if label not in belong],
        "images that their EXIF orientation turns, in replay as in viewers": turned,
    }
    warnings = tuple(
        f"{what}: {first_names(odd)} ({len(odd)} in all)" for what, odd in unpaired.items() if odd
    )
    return PackResult(output, len(files), len(by_image), words, warnings)


def _list_labels(masks: Path, images: Path) -> Sequence[Path]:
    """List the label images for a folder of images; a `LogError` if there are none."""
    try:
        if masks.resolve() == images.resolve():
            raise LogError("the images themselves", where=masks)
        return prefer_ids(list_files(masks, IMAGES))
    except LogError as error:
        if not masks.exists():
            raise
        refused = LogError.of(error)
        refused.remedy = (
            "labels of an annotation tool belong to the packed log: pack without them, then "
            f"roadeval replay LOG.mcap --truth {masks} --truth-images {images}"
        )
        raise refused from error


def _read_frames(
    video: Path, orientations: set[int], losses: list[str]
) -> Iterator[tuple[int, bytes]]:
    """Yield each frame's time in nanoseconds after the first, and the frame as a JPEG.

    Frames are in the order in which they are shown, and so are their times; an AVI with B-frames
    has times in the order of decoding. Adds to the ``orientations`` from which frames are
    turned, and to the ``losses``. A `LogError` if the video cannot be read, or holds no video.
    """
    import av
    import cv2

    try:
        with av.open(str(video)) as container:
            if not container.streams.video:
                raise LogError("it holds no video", where=video)
            stream = container.streams.video[0]
            times, jpegs, first = list[int](), deque[bytes](), None
            unit = stream.time_base or Fraction(1, 25)
            step = round(1 / (stream.average_rate or 25) / unit)
            last = latest = -step
            frames = _readable_frames(container, stream, video, losses)
            for frame in chain(frames, repeat(None, REORDERED)):
                if frame is not None:
                    last = last + step if frame.pts is None else frame.pts
                    latest = max(latest, last)
                    heappush(times, last)
                    orientations.add(orientation := turn_of(frame))
                    bgr = upright(frame.to_ndarray(format="bgr24"), orientation)
                    _, jpeg = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, 95])
                    jpegs.append(jpeg.tobytes())
                if jpegs and (frame is None or len(jpegs) > REORDERED):
                    pts = heappop(times)
                    first = pts if first is None else first
                    yield round((pts - first) * unit * NS), jpegs.popleft()
            seconds = float((latest + step - (first or 0)) * unit)
            stated = _stated_seconds(container, stream)
            if seconds < stated - float(3 * step * unit):
                problem = f"its frames end after {seconds:.1f} of the {stated:.1f} s that it states"
                losses.append(f"{video.name}: {problem}; the file may be cut off")
    except (av.FFmpegError, OSError) as error:
        raise LogError(f"not a readable video ({error.strerror})", where=video) from error


def _readable_frames(container: Any, stream: Any, video: Path, losses: list[str]) -> Iterator[Any]:
    """Yield decoded frames in their order; the ``losses`` name packets that cannot be decoded."""
    import av

    lost, is_damaged = 0, False
    for packet in container.demux(stream):
        if packet.is_corrupt or (is_damaged and not packet.is_keyframe and packet.size):
            lost, is_damaged = lost + 1, True  # it may build upon a damaged one
            continue
        try:
            yield from packet.decode()
            is_damaged = False
        except av.InvalidDataError:
            lost, is_damaged = lost + 1, True
    if lost:
        losses.append(f"{video.name}: {counted(lost, 'packet')} cannot be decoded")
    size = video.stat().st_size
    if container.format.name == "mpegts" and all(size % length for length in (188, 192, 204)):
        losses.append(f"{video.name}: it ends within a packet; the file may be cut off")


def _stated_seconds(container: Any, stream: Any) -> float:
    """Return how long a video is by its header; 0 if that says nothing of this stream."""
    if container.format.name == "avi":  # its duration is guessed from the size of the file
        return float(stream.frames / (stream.average_rate or 25))
    if stream.duration is not None and stream.time_base is not None:
        return float(stream.duration * stream.time_base)
    is_alone = len(container.streams) == 1  # another stream may be longer
    return (container.duration or 0) / 1e6 if is_alone else 0.0


def _image(file: Path, *, is_label: bool = False, of_kitti: bool = False) -> tuple[bytes, str]:
    """Read a JPEG or PNG file with any ending; a label must not be a JPEG."""
    try:
        with reading(file, LogError):
            check_input(file)
            data = file.read_bytes()
        size_of(data, Limits())
        format_ = format_of(data)
        assert format_ is not None
        if is_label and not format_.exact:
            problem, remedy = f"{format_.name} changes label values", "masks must be lossless"
            raise LogError(problem, where=file, remedy=remedy)
        if format_.media_type is None:
            problem = f"{format_.name}, which not all viewers know: save it as PNG"
            raise LogError(problem, where=file)
        if of_kitti:
            return png_of(kitti.road_mask(data)), "png"
        return data, format_.media_type.removeprefix("image/")
    except ImageError as error:
        raise LogError.of(error, file) from error

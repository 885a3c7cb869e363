"""Small intact logs, and what is read of them."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Chunk, Message
from mcap.stream_reader import breakup_chunk
from mcap.writer import CompressionType, IndexType

from roadeval.logs.errors import FrameError, LogError
from roadeval.logs.log import open_log
from roadeval.logs.settings import LabelSettings, LogConfig
from tests.fixtures import broken, drives
from tests.fixtures.flavours import file_of, png, protobuf
from tests.fixtures.writing import Logged, Topic, Written
from tests.fuzz.harness import scratch
from tests.logs.making import COMPRESSED, IMAGE, compressed, raw

FRAMES = 6
SIZE = (24, 18)
CAMERA, MASK = "/camera/image", "/camera/road_mask"
CHUNK = 1700
"""Bytes of a chunk, uncompressed: two frames, about."""
UNSAID, SAID = LabelSettings(), LabelSettings(road=(255,))
"""The masks' meaning: to be understood from their values, or named."""


class Seen(NamedTuple):
    """A frame as it was read: all that results are computed from."""

    stamp_ns: int
    image: bytes
    truth: bytes | None


@dataclass(frozen=True)
class Reading:
    """What came of reading a log: frames in their order, and every sentence on a loss."""

    frames: tuple[tuple[int, Seen], ...]
    told: tuple[str, ...]
    without_truth: str
    """Why there is no truth at all."""


@dataclass(frozen=True)
class Intact:
    """A log, and whether checksums protect each chunk or only the whole."""

    written: Written
    by_chunk: bool = True
    finished: bool = True

    @cached_property
    def data(self) -> bytes:
        """The bytes of the file; those of one that was never finished end with its data."""
        data = self.written.bytes()
        return data if self.finished else data[: broken.data_end(data)]

    @cached_property
    def records(self) -> list[tuple[int, int, int]]:
        """Opcode, begin and end of every record outside chunks."""
        return list(records(self.data))

    @cached_property
    def frames(self) -> dict[int, Seen]:
        """What is read of it, by log time."""
        path = scratch() / "intact.mcap"
        path.write_bytes(self.data)
        reading = read(path)
        assert len(reading.frames) == FRAMES
        assert not (self.finished and reading.told)
        return dict(reading.frames)

    @cached_property
    def blocks(self) -> dict[int, list[tuple[int, int]]]:
        """Begin and end of the chunks, or the messages outside them, that a frame lies in."""
        blocks: dict[int, list[tuple[int, int]]] = {time: [] for time in self.frames}
        for opcode, begin, end in self.records:
            for log_time in times_in(opcode, self.data[begin:end]):
                blocks[self.frame_of(log_time)].append((begin, end))
        return blocks

    def frame_of(self, log_time: int) -> int:
        """Return the log time of the image that a message belongs to."""
        return max(time for time in self.frames if time <= log_time)

    def number_of(self, time: int) -> int:
        """Return the number of the frame of this log time."""
        return list(self.frames).index(time)

    @cached_property
    def descriptions(self) -> list[tuple[int, int]]:
        """Begin and end of what tells how messages are to be read: the first chunk, the summary."""
        chunks = [(begin, end) for opcode, begin, end in self.records if opcode == Opcode.CHUNK]
        summaries = [(broken.data_end(self.data), len(self.data))] if self.finished else []
        return chunks[:1] + summaries

    def is_whole(self, time: int, data: bytes) -> bool:
        """Whether all of a frame's bytes, their checksums and a description are in a damaged file.

        A topic whose description lies in a damaged chunk may be read by what is left of it.
        """
        described = any(self.data[begin:end] in data for begin, end in self.descriptions)
        return (described or not self.by_chunk) and all(
            self.data[begin:end] in data for begin, end in self.blocks[time]
        )


def times_in(opcode: int, record: bytes) -> list[int]:
    """Return the log times of the messages in a chunk, or of a message."""
    if opcode == Opcode.MESSAGE:
        return [int.from_bytes(record[broken.HEAD + 6 :][:8], "little")]
    if opcode != Opcode.CHUNK:
        return []
    chunk = Chunk.read(ReadDataStream(io.BytesIO(record[broken.HEAD :])))
    return [one.log_time for one in breakup_chunk(chunk) if isinstance(one, Message)]


def records(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, begin and end of the records of a file."""
    at = len(broken.MAGIC)
    while at + broken.HEAD <= len(data):
        end = at + broken.length_of(data, at)
        yield data[at], at, end
        at = end


def read(path: Path, labels: LabelSettings = UNSAID) -> Reading:
    """Read a log as a replay does."""
    frames, told, without_truth = [], [], ""
    try:
        with open_log(path, LogConfig(labels=labels)) as log:
            log.verify()
            selection = log.select()
            stream = log.frames(selection)
            for logged in stream:
                try:
                    frame = logged.decode()
                except FrameError as error:
                    told.append(str(error))
                    continue
                truth = None if frame.truth is None else frame.truth.tobytes()
                seen = Seen(frame.stamp_ns, frame.image.tobytes(), truth)
                frames.append((frame.log_time_ns, seen))
            told += [*log.losses, *stream.accounting.notes]
            without_truth = selection.no_truth
    except LogError as error:
        told.append(str(error))
    return Reading(tuple(frames), tuple(told), without_truth)


@cache
def intact_logs() -> dict[str, Intact]:
    """Return the logs by name."""
    zstd: dict[str, Any] = {"compression": CompressionType.ZSTD}
    plain: dict[str, Any] = {"compression": CompressionType.NONE}
    return {
        "uncompressed": Intact(street(**plain)),
        "zstd": Intact(street(**zstd)),
        "lz4": Intact(street(compression=CompressionType.LZ4)),
        "data_checksum": Intact(street(**plain, enable_data_crcs=True)),
        "unchunked": Intact(street(use_chunking=False, enable_data_crcs=True), by_chunk=False),
        "no_index": Intact(street(**zstd, index_types=IndexType.NONE)),
        "no_statistics": Intact(street(**plain, use_statistics=False)),
        "protobuf": Intact(car_park(**plain)),
        "raw": Intact(unlabelled(**plain)),
        "unfinished": Intact(street(**plain), finished=False),
    }


def street(**options: Any) -> Written:
    """Return JPEGs and raw masks in ROS 2."""
    camera, encode = drives.ros2_topic(CAMERA, "CompressedImage", COMPRESSED)
    mask, encode_mask = drives.ros2_topic(MASK, "Image", IMAGE)
    messages = []
    for number in range(FRAMES):
        (image, road), at = scene(number), drives.stamp(number)
        jpeg, road_mask = compressed(at, file_of(".jpg", image)), raw(at, road * 255, "mono8")
        messages.append(Logged(CAMERA, at, at + 1000, encode(jpeg)))
        messages.append(Logged(MASK, at, at + 2000, encode_mask(road_mask)))
    return written((camera, mask), messages, options)


def car_park(**options: Any) -> Written:
    """Return JPEGs and PNG masks in Foxglove's protobuf."""
    scenes = [scene(number) for number in range(FRAMES)]
    images = [{"data": file_of(".jpg", image), "format": "jpeg"} for image, _ in scenes]
    masks = [{"data": png(road * 255), "format": "png"} for _, road in scenes]
    topics, messages = [], []
    for name, files in ((CAMERA, images), (MASK, masks)):
        made = protobuf("CompressedImage", files)
        topics.append(Topic(name, "protobuf", made.topics[0].schema))
        messages += [replace(message, topic=name) for message in made.messages]
    messages.sort(key=lambda message: message.log_time)
    return written(tuple(topics), messages, options)


def unlabelled(**options: Any) -> Written:
    """Return raw images in ROS 2, without truth."""
    camera, encode = drives.ros2_topic(CAMERA, "Image", IMAGE)
    messages = []
    for number in range(FRAMES):
        bgr, at = np.ascontiguousarray(scene(number)[0][..., ::-1]), drives.stamp(number)
        messages.append(Logged(CAMERA, at, at + 1000, encode(raw(at, bgr, "bgr8"))))
    return written((camera,), messages, options)


def written(topics: tuple[Topic, ...], messages: list[Logged], options: Any) -> Written:
    options = {"chunk_size": CHUNK} | options
    return Written(topics, tuple(messages), "ros2", beside=True, options=options)


@cache
def scene(number: int) -> tuple[Any, Any]:
    """Return a small image and its road, 0 or 1."""
    image, road = drives.scene(number)
    small = cv2.resize(image, SIZE, interpolation=cv2.INTER_AREA)
    return small, cv2.resize(road, SIZE, interpolation=cv2.INTER_NEAREST)

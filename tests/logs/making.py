"""Small logs for the tests, written by the MCAP project's own writers."""

import struct
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from mcap.writer import CompressionType, Writer
from mcap_ros2._dynamic import serialize_dynamic
from mcap_ros2.writer import Writer as Ros2Writer

from roadeval.data import Frame
from roadeval.logs.log import open_log
from roadeval.logs.settings import FrameSettings, LogConfig

SECOND = 1_000_000_000

HEADER = """std_msgs/Header header
{fields}
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
IMAGE = HEADER.format(
    fields="uint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\n"
    "uint8[] data"
)
COMPRESSED = HEADER.format(fields="string format\nuint8[] data")


def grey(level: int, width: int = 8, height: int = 6) -> npt.NDArray[np.uint8]:
    """A plain image."""
    return np.full((height, width), level, np.uint8)


def jpeg(image: npt.NDArray[np.uint8]) -> bytes:
    return cv2.imencode(".jpg", image)[1].tobytes()


def png(image: npt.NDArray[np.uint8]) -> bytes:
    return cv2.imencode(".png", image)[1].tobytes()


def header(stamp_ns: int) -> dict[str, Any]:
    stamp = {"sec": stamp_ns // SECOND, "nanosec": stamp_ns % SECOND}
    return {"stamp": stamp, "frame_id": "camera"}


def raw(stamp_ns: int, pixels: npt.NDArray[Any], encoding: str, **changed: Any) -> dict[str, Any]:
    """A ``sensor_msgs/msg/Image``."""
    return {
        "header": header(stamp_ns),
        "height": pixels.shape[0],
        "width": pixels.shape[1],
        "encoding": encoding,
        "is_bigendian": 0,
        "step": pixels.strides[0],
        "data": pixels.tobytes(),
    } | changed


def compressed(stamp_ns: int, data: bytes, name: str = "jpeg") -> dict[str, Any]:
    """A ``sensor_msgs/msg/CompressedImage``."""
    return {"header": header(stamp_ns), "format": name, "data": data}


def ros2_log(
    path: Path,
    messages: Iterable[tuple[str, int, dict[str, Any]]],
    empty: Iterable[str] = (),
    **options: Any,
) -> Path:
    """Write (topic, log time, message) in the order given; and topics without messages."""
    with path.open("wb") as file:
        writer = Ros2Writer(file, **options)
        image = writer.register_msgdef("sensor_msgs/msg/Image", IMAGE)
        packed = writer.register_msgdef("sensor_msgs/msg/CompressedImage", COMPRESSED)
        for topic, log_time, message in messages:
            schema = packed if "format" in message else image
            writer.write_message(topic, schema, message, log_time)
        for topic in empty:
            writer._writer.register_channel(topic, "cdr", packed.id)
        writer.finish()
    return path


def drive(
    path: Path, stamps: Iterable[int], labels: Iterable[int] = (), delay: int = 0, **options: Any
) -> Path:
    """A log of images whose level is their position, and of 0/255 masks, at these stamps."""
    messages = [
        ("/camera", stamp, compressed(stamp, jpeg(grey(20 * level % 256))))
        for level, stamp in enumerate(stamps)
    ]
    mask = grey(0)
    mask[3:] = 255
    messages += [("/labels", stamp + delay, raw(stamp, mask, "mono8")) for stamp in labels]
    return ros2_log(path, sorted(messages, key=lambda message: message[1]), **options)


FRAMES = 12
START = 1_700_000_000 * SECOND
PERIOD = SECOND // 10
CAMERA = "/camera"
CHANNELS = (
    (CAMERA, "sensor_msgs/msg/CompressedImage", COMPRESSED),
    ("/labels", "sensor_msgs/msg/Image", IMAGE),
)
CONTAINERS: dict[str, dict[str, Any]] = {
    "zstd": {"compression": CompressionType.ZSTD},
    "lz4": {"compression": CompressionType.LZ4},
    "uncompressed": {"compression": CompressionType.NONE},
    "unchunked": {"use_chunking": False},
}


def frames(path: Path, **settings: Any) -> list[Frame]:
    """Decode the frames of a log."""
    with open_log(path, LogConfig(frames=FrameSettings(**settings))) as log:
        return [frame.decode() for frame in log.frames(log.select())]


def small_log(path: Path, container: str) -> dict[int, bytes]:
    """Write a camera and its labels in small chunks; give each image by its log time."""
    images = {START + i * PERIOD: jpeg(grey(20 * i)) for i in range(FRAMES)}
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=1500, enable_data_crcs=True, **CONTAINERS[container])
        writer.start("ros2", "test")
        encoders = []
        for topic, name, text in CHANNELS:
            schema = writer.register_schema(name, "ros2msg", text.encode())
            writer.register_channel(topic, "cdr", schema)
            encoders.append(serialize_dynamic(name, text)[name])
        for stamp, data in images.items():
            image, label = compressed(stamp, data), raw(stamp, grey(255), "mono8")
            writer.add_message(1, stamp, encoders[0](image), stamp)
            writer.add_message(2, stamp + 5, encoders[1](label), stamp)
        writer.finish()
    return images


def chunk_record(data: bytes, compression: str, size: int, crc: int = 0, start: int = 0) -> bytes:
    """A chunk of compressed data that claims to hold so many bytes, of one time."""
    head = struct.pack("<QQQII", start, start, size, crc, len(compression)) + compression.encode()
    body = head + struct.pack("<Q", len(data)) + data
    return b"\x06" + struct.pack("<Q", len(body)) + body

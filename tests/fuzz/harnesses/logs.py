"""Logs: whatever the bytes, a log is read, or refused in one line."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

from roadeval.logs.errors import LogError
from roadeval.logs.log import describe
from tests.fixtures import broken
from tests.fixtures.flavours import FLAVOURS, NoEncoderError
from tests.fixtures.writing import Written
from tests.fuzz.harness import Harness, scratch
from tests.fuzz.intact import intact_logs, read

KINDS = (
    *("ros2_CompressedImage_jpeg", "ros2_Image_ros2idl", "foxmsgs_ros2_CompressedImage"),
    *("ros1_CompressedImage", "fox_pb_CompressedImage", "fox_json_CompressedImage"),
    *("fox_fb_CompressedImage", "ros2_Image_32FC1", "fox_pb_CompressedVideo_h264"),
    "ros2_FFMPEGPacket_h264",
)
"""Kinds of messages that are decoded each in another way."""


def check(data: bytes) -> None:
    """Read a log as a replay does, and describe it."""
    path = scratch() / "drive.mcap"
    path.write_bytes(data)
    read(path)
    with suppress(LogError):
        describe(path)


def seeds() -> list[bytes]:
    """Return small logs: each container, and each kind of message, outside chunks."""
    found = [intact.data for intact in intact_logs().values()]
    found += [broken.log([0, 1]).bytes(), broken.killed().data]
    for name in KINDS:
        with suppress(NoEncoderError):
            found.append(_first(FLAVOURS[name].log()).bytes())
    return found


def _first(log: Written) -> Written:
    return replace(log, messages=log.messages[:2], options={"use_chunking": False})


HARNESS = Harness(check, seeds, quick=60)

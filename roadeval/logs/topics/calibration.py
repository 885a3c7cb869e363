"""The calibration of a camera, and where it is mounted, from the messages of a log.

Read are ``sensor_msgs/CameraInfo`` and Foxglove's ``CameraCalibration``, the first message of a
topic; and static transforms, ROS's ``tf2_msgs/TFMessage`` and Foxglove's ``FrameTransform(s)``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, Final

import numpy as np

from roadeval.data import Calibration, Mounting
from roadeval.data.arrays import Vector
from roadeval.logs.errors import BadMessage, FrameError
from roadeval.logs.messages.encoding import TopicKind
from roadeval.logs.topics.reader import TopicInfo, TopicReader

LOOKED_AT: Final = 100
"""Messages of static transforms that are read, at most, of each topic."""
FARTHEST, NOT_UNIT = 1e9, 0.01
"""Metres between two frames, and how far a quaternion's length may be from 1, at most."""
DEEPEST: Final = 50
"""Frames on the way from a camera to the root, at most: more are a loop."""

_UNREADABLE: Final = FrameError, BadMessage, AttributeError, TypeError, ValueError, OverflowError
Transform = tuple[str, Vector, Vector]
"""The parent frame, and translation and quaternion (x, y, z, w) in it."""


_RECTIFIED: Final = re.compile(r"(?:^|[_.-])(?:rect(?:ified)?|undist\w*)(?:$|[_.-])", re.I)


def is_rectified(name: str) -> bool:
    """Return whether images or labels without distortion have this name, as ``image_rect_color``.

    The last two parts of a path tell.
    """
    return any(map(_RECTIFIED.search, name.rstrip("/").split("/")[-2:]))


def calibration_of(
    image: TopicInfo, topics: Sequence[TopicInfo], readers: Mapping[str, TopicReader]
) -> tuple[Calibration | None, str]:
    """Return the calibration of a camera and an empty text, or None and why there is none.

    The topic is that whose ``frame_id`` is the images' own; of several, that whose path shares most
    with theirs. The text is empty, too, where the log has no calibration at all.
    """
    found = list[Calibration]()
    for topic in topics:
        if topic.kind is TopicKind.CALIBRATION and topic.count:
            with suppress(*_UNREADABLE):
                found.append(_read(topic.name, readers[topic.name].fields(0), image.name))
    own = [each for each in found if each.frame_id in ("", image.frame_id)]
    near = [_shared(each.topic, image.name) for each in own]
    best = [each for each, shared in zip(own, near, strict=True) if shared == max(near)]
    if len(best) != 1 or not (best[0].frame_id or max(near)):
        names = ", ".join(each.topic for each in found)
        return None, f"none of {names} is clearly of {image.name}" if found else ""
    (made,) = best
    if made.problem:
        return None, f"{made.topic}: its {made.problem}"
    if image.size not in (None, (made.width, made.height)):
        return None, f"{made.topic}: it is for images of {made.width}x{made.height}"
    with suppress(*_UNREADABLE):
        reader = readers[made.topic]
        if _read(made.topic, reader.fields(len(reader) - 1), image.name) != made:
            return None, f"{made.topic}: it changes within the log"
    static = [each for each in topics if each.kind is TopicKind.TRANSFORMS]
    transforms = dict(_transforms(readers[each.name] for each in static))
    try:
        return replace(made, mounting=_mounting(made.frame_id, transforms)), ""
    except ValueError as error:
        return made, f"its place is not known: the transform of {error}"


def _shared(one: str, other: str) -> int:
    """Return how many parts at the begin two paths share."""
    pairs = zip(one.strip("/").split("/"), other.strip("/").split("/"), strict=False)
    return next((n for n, (a, b) in enumerate(pairs) if a != b), 1)


def _read(topic: str, message: Any, image: str) -> Calibration:
    """Read a message. Of rectified images it is the projection that holds, without distortion."""

    def numbers(name: str) -> tuple[float, ...]:
        value = getattr(message, name, None)
        return tuple(map(float, getattr(message, name.upper()) if value is None else value))

    header = getattr(message, "header", message)
    matrix = numbers("k")
    lens = str(message.distortion_model), numbers("d")
    if is_rectified(image):
        p, lens = numbers("p"), ("", ())
        matrix = (*p[:3], *p[4:7], *p[8:11])
    size = int(message.width), int(message.height)
    return Calibration(topic, *size, matrix, *lens, str(header.frame_id))


def _transforms(readers: Iterator[TopicReader]) -> Iterator[tuple[str, Transform]]:
    """Yield each frame's transform in its parent; later ones replace earlier ones."""
    for reader in readers:
        for position in range(min(len(reader), LOOKED_AT)):
            with suppress(*_UNREADABLE):
                message = reader.fields(position)
                for each in getattr(message, "transforms", [message]):
                    yield _transform(each)


def _transform(each: Any) -> tuple[str, Transform]:
    moved = getattr(each, "transform", each)
    at = np.array([getattr(moved.translation, axis) for axis in "xyz"], np.float64)
    turn = np.array([getattr(moved.rotation, axis) for axis in "xyzw"], np.float64)
    parent = each.header.frame_id if hasattr(each, "header") else each.parent_frame_id
    return str(each.child_frame_id), (str(parent), at, turn)


def _mounting(frame: str, transforms: Mapping[str, Transform]) -> Mounting | None:
    """Follow the transforms from a camera's frame to the root; None if they begin nowhere.

    A loop has no root: then there is none, too. A `ValueError` names a transform that is none.
    """
    names = {name.lstrip("/"): transform for name, transform in transforms.items()}
    at, turn, name = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), frame.lstrip("/")
    for depth in range(DEEPEST):
        if name not in names:
            if not depth:
                return None
            return Mounting(name, tuple(at.tolist()), tuple(turn.tolist()))
        parent, offset, rotation = names[name]
        length = np.linalg.norm(rotation)
        if not (np.abs(offset) < FARTHEST).all():
            raise ValueError(f"{name} is moved by {', '.join(f'{each:.6g}' for each in offset)} m")
        if not abs(length - 1) < NOT_UNIT:
            raise ValueError(f"{name} has a quaternion of length {length:.6g}, not 1")
        rotation = rotation / length
        at, turn, name = (
            offset + _turned(rotation, at),
            _product(rotation, turn),
            parent.lstrip("/"),
        )
    return None


def _product(one: Vector, other: Vector) -> Any:
    """Multiply two quaternions x, y, z, w."""
    (a, b), (c, d) = (one[:3], one[3]), (other[:3], other[3])
    return np.append(b * c + d * a + np.cross(a, c), b * d - a @ c)


def _turned(rotation: Vector, point: Vector) -> Any:
    """Turn a point by a unit quaternion."""
    twice = 2 * np.cross(rotation[:3], point)
    return point + rotation[3] * twice + np.cross(rotation[:3], twice)

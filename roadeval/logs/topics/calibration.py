"""The calibration of a camera and its mounting, from the messages of a log.

These are the first usable message of ``sensor_msgs/CameraInfo`` or Foxglove's
``CameraCalibration``, and static transforms in ROS's ``tf2_msgs/TFMessage`` or Foxglove's
``FrameTransform(s)``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from os.path import commonprefix
from typing import Any, Final

import numpy as np

from roadeval.data import Calibration, Mounting
from roadeval.data.arrays import Floats
from roadeval.images.formats import Size
from roadeval.logs.errors import BadMessage, FrameError
from roadeval.logs.messages.encoding import TopicKind
from roadeval.logs.topics.choose import words
from roadeval.logs.topics.reader import TopicInfo, TopicReader
from roadeval.runtime.sentence import Sentence

OPTICAL: Final = np.array([-0.5, 0.5, -0.5, 0.5])
"""The rotation from a camera's axes to a vehicle's: x ahead, y left, z up (REP 103)."""

_UNREADABLE: Final = FrameError, BadMessage, AttributeError, TypeError, ValueError, OverflowError
Transform = tuple[str, Floats, Floats]
"""The parent frame, and translation and quaternion (x, y, z, w) in it."""
LensAndNote = tuple[Calibration | None, str]
"""A calibration for the images and remarks on it, or None and why there is none."""

RECTIFIED: Final = frozenset({"rect", "rectified", "undist", "undistort", "undistorted"})
"""Words in the topics of images without distortion."""


def is_rectified(name: str) -> bool:
    """Return whether a topic's name says that its images are rectified: ``/cam/rect/image``.

    RealSense calls images with distortion ``image_rect_raw``.
    """
    parts = map(words, name.split("/"))
    return any(part & RECTIFIED and "raw" not in part for part in parts)


def calibration_of(
    image: TopicInfo, topics: Sequence[TopicInfo], readers: Mapping[str, TopicReader]
) -> LensAndNote:
    """Return the calibration of a camera and remarks on it, or None and why there is none.

    Its topic has the ``frame_id`` of the images; among several, its path shares most with theirs.
    The text is empty if the log has no calibration at all.
    """
    if image_names(topics, readers):
        return None, "each image has its own, and only the rates of KITTI's benchmark use it"
    lenses = {
        topic.name: _read_lens(topic, readers[topic.name], image)
        for topic in topics
        if topic.kind is TopicKind.CALIBRATION and topic.count
    }
    matching = {name: lens for name, lens in lenses.items() if lens[0] in ("", image.frame_id)}
    near = max((shared_parts(name, image.name) for name in matching), default=0)
    best = [name for name in matching if shared_parts(name, image.name) == near]
    best = [name for name in best if matching[name][1]] or best
    if len(best) != 1 or not (near or matching[best[0]][0] or matching[best[0]][1] is None):
        why = f"none of {', '.join(lenses)} is clearly of {image.name}"
        return None, why if lenses else ""
    (topic,) = best
    frame, lens, why = matching[topic]
    if lens is None:
        return None, Sentence("{}: {}", topic, why)
    reader = readers[topic]
    with suppress(*_UNREADABLE):
        last, _ = _lens_in(topic, reader.fields(len(reader) - 1), image)
        if last not in (None, lens):
            return None, f"{topic}: it changes within the log"
    static = [info.name for info in topics if info.kind is TopicKind.TRANSFORMS and info.count]
    transforms = dict[str, Transform]()
    for reader in (readers[name] for name in static):
        for position in range(min(len(reader), 100)):
            with suppress(*_UNREADABLE):  # later ones replace earlier ones
                transforms.update(_transforms_in(reader.fields(position)))
    notes, mounting = [why] * bool(why), None
    if static and not transforms:
        notes.append(f"its place is not known: {', '.join(static)} cannot be read")
    try:
        mounting = _find_mounting(frame, transforms)
    except ValueError as error:
        notes.append(f"its place is not known: the transform of {error}")
    if mounting and mounting.has_body_axes:
        notes.append(f"{frame} has the axes of a vehicle, x ahead, and is read as such")
        mounting = replace(mounting, rotation=tuple(_product(np.array(mounting.rotation), OPTICAL)))
        lens = replace(lens, frame_id=f"{frame}_optical")
    return replace(lens, mounting=mounting), Sentence("; ").join(notes)


def image_names(topics: Sequence[TopicInfo], readers: Mapping[str, TopicReader]) -> Sequence[str]:
    """Return the names that the images had before they were packed; none if the log has none."""
    names = [topic.name for topic in topics if topic.kind is TopicKind.NAMES and topic.count]
    with suppress(*_UNREADABLE):
        return [str(name) for topic in names for name in readers[topic].fields(0).names]
    return ()


def lens_at(
    topics: Sequence[TopicInfo], readers: Mapping[str, TopicReader], log_time_ns: int
) -> Calibration | None:
    """Return the calibration and mounting that are logged at an image's log time, if any."""
    lens, transforms = None, dict[str, Transform]()
    with suppress(*_UNREADABLE):
        for topic in topics:
            reader, kind = readers[topic.name], topic.kind
            for at in np.flatnonzero(reader.log_times == log_time_ns).tolist():
                if kind is TopicKind.CALIBRATION:
                    lens, _ = _lens_in(topic.name, reader.fields(at), topic)
                elif kind is TopicKind.TRANSFORMS:
                    transforms |= _transforms_in(reader.fields(at))
        return lens and replace(lens, mounting=_find_mounting(lens.frame_id, transforms))
    return None


def shared_parts(one: str, other: str) -> int:
    """Return the number of parts at the beginning that two paths share."""
    paths = [path.strip("/").split("/") for path in (one, other)]
    return len(commonprefix(paths))  # noqa: RUF071 - of lists it compares part by part


def _read_lens(
    topic: TopicInfo, reader: TopicReader, image: TopicInfo
) -> tuple[str, Calibration | None, str]:
    """Return a topic's ``frame_id``, and the calibration and note of its first usable message.

    Some drivers send zeros until they are ready. A few messages are read, ever farther apart.
    """
    frame: str = ""
    why: str = "no message can be read"
    positions = {0, *(1 << power for power in range(7)), len(reader) - 1}
    for position in sorted(positions & {*range(len(reader))}):
        try:
            message = reader.fields(position)
            frame = str(getattr(message, "header", message).frame_id)
            lens, why = _lens_in(topic.name, message, image)
        except _UNREADABLE:
            unread = "its {} messages of {} cannot be read: give its lens with {ground}"
            why = Sentence(unread, topic.encoding, topic.schema)
            continue
        if lens is not None:
            return frame, lens, why
    return frame, None, why


def _lens_in(topic: str, message: Any, image: TopicInfo) -> LensAndNote:
    """Read a message; for rectified images take its projection, without distortion."""

    def numbers(name: str) -> tuple[float, ...]:
        value = getattr(message, name, None)
        return tuple(map(float, getattr(message, name.upper(), ()) if value is None else value))

    size, p = (int(message.width), int(message.height)), numbers("p")
    bent = str(getattr(message, "distortion_model", "")), numbers("d")
    frame = str(getattr(message, "header", message).frame_id)
    lens, note = Calibration(topic, *size, numbers("k"), *bent, frame), ""
    if is_rectified(image.name):
        flat = replace(lens, matrix=(*p[:3], *p[4:7], *p[8:11]), model="", distortion=())
        if lens.bends and not any(p):
            zero = "its projection P is zero, and the images are rectified: "
            return None, Sentence(zero + "give its lens with {ground}")
        if lens.bends and np.array_equal(flat.matrix, lens.matrix):
            note = "the images are taken as not rectified: P is K, and there is distortion"
        elif any(p):
            lens, turn = flat, np.reshape(numbers("r") if any(numbers("r")) else np.eye(3), (3, 3))
            if (angle := np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1)))) > 0.1:
                turned = (
                    "its R turns rectified images by {}\N{DEGREE SIGN}, and is not used: {} is "
                )
                turned += "taken as the frame of the rectified camera, as stereo_image_proc does"
                note = Sentence(turned, f"{angle:.1f}", frame)
    if lens.problem:
        return None, f"its {lens.problem}"
    fitting, remark = _fit_to_size(lens, message, image.size or size)
    return fitting, Sentence("; ").join(filter(None, (note, remark)))


def _fit_to_size(full: Calibration, message: Any, size: Size) -> LensAndNote:
    """Return the calibration for images of a size: a part of the sensor, binned, or scaled."""
    region = getattr(message, "roi", None)
    left, top, across, down = (
        int(getattr(region, name, 0)) for name in ("x_offset", "y_offset", "width", "height")
    )
    bins = [max(1, int(getattr(message, f"binning_{axis}", 1))) for axis in "xy"]
    across, down = across or full.width - left, down or full.height - top
    if min(left, top) < 0 or left + across > full.width or top + down > full.height:
        return None, f"its region of interest lies outside its images of {full.width}x{full.height}"
    part = full.part((left, top), (across // bins[0], down // bins[1]), bins)
    if part.problem:
        return None, f"its {part.problem} of its region of interest, binned"
    if max(abs(part.width - size[0]), abs(part.height - size[1])) <= (max(bins) > 1):
        note = "" if left or top else part.doubt
        return replace(part, width=size[0], height=size[1]), note
    if size == (full.width, full.height):
        return full, "its region of interest and binning are not those of the images, and not used"
    for lens in (part, full):
        if lens.has_shape(*size):
            note = f"it is for images of {lens.width}x{lens.height}, and scaled"
            return lens.scaled(*size), Sentence("; ").join(filter(None, (note, lens.doubt)))
    return None, f"it is for images of {part.width}x{part.height}"


def _transforms_in(message: Any) -> Iterator[tuple[str, Transform]]:
    """Yield the frame and the transform of each part of a message of ROS or Foxglove."""
    for frame in getattr(message, "transforms", [message]):
        moved = getattr(frame, "transform", frame)
        at = np.array([getattr(moved.translation, axis) for axis in "xyz"], float)
        turn = np.array([getattr(moved.rotation, axis) for axis in "xyzw"], float)
        parent = getattr(frame, "header", None)
        parent = frame.parent_frame_id if parent is None else parent.frame_id
        yield str(frame.child_frame_id), (str(parent), at, turn)


def _find_mounting(frame: str, transforms: Mapping[str, Transform]) -> Mounting | None:
    """Follow the transforms from a camera's frame to the root.

    None if the frame has no transform, or the transforms form a loop. A `ValueError` names an
    impossible transform.
    """
    names = {name.lstrip("/"): transform for name, transform in transforms.items()}
    at, turn, name = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), frame.lstrip("/")
    for depth in range(50):  # more are a loop
        if name not in names:
            if not depth:
                return None
            return Mounting(name, tuple(at.tolist()), tuple(turn.tolist()))
        parent, offset, rotation = names[name]
        length = np.linalg.norm(rotation)
        if not (np.abs(offset) < 1e9).all():
            metres = ", ".join(f"{length:.6g}" for length in offset)
            raise ValueError(f"{name} is moved by {metres} m")
        if not abs(length - 1) < 0.01:
            raise ValueError(f"{name} has a quaternion of length {length:.6g}, not 1")
        rotation = rotation / length
        twice = 2 * np.cross(rotation[:3], at)
        at = offset + (at + rotation[3] * twice + np.cross(rotation[:3], twice))
        turn, name = _product(rotation, turn), parent.lstrip("/")
    return None


def _product(one: Floats, other: Floats) -> Any:
    """Multiply two quaternions x, y, z, w."""
    (a, b), (c, d) = (one[:3], one[3]), (other[:3], other[3])
    return np.append(b * c + d * a + np.cross(a, c), b * d - a @ c)

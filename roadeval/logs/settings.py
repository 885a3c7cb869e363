"""Settings of reading a log: its topics, the meaning of its labels, and the frames to read."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from annotated_types import Interval, Len

from roadeval.errors import SettingError
from roadeval.geometry.settings import GroundSettings
from roadeval.images.formats import MAX_PIXELS
from roadeval.logs.errors import LogError
from roadeval.runtime.sentence import Sentence
from roadeval.runtime.settings import Checked, Flag
from roadeval.runtime.text import elide

NS: Final = 1_000_000_000
_EPOCH: Final = datetime.fromisoformat("1970-01-01T00:00:00+00:00")
_RFC_3339: Final = re.compile(
    r"(\d{4}-\d\d-\d\d[Tt ]\d\d:\d\d:\d\d)(?:\.(\d{1,9}))?([Zz]|[+-]\d\d:\d\d)"
)


def parse_time(text: str, start_ns: int = 0) -> int:
    """Parse a moment as people write it; return nanoseconds of the clock of a log.

    ``2.5`` and ``90`` are seconds after the log's first message, at ``start_ns``; a whole number
    from 1000000000 on is nanoseconds of the log's clock; ``12s`` and ``12ns`` have a unit; and
    ``2013-05-01T12:00:00.5Z`` is RFC 3339. A `LogError` if it is none of these.
    """
    text = text.strip()
    if match := _RFC_3339.fullmatch(text):
        moment, fraction, zone = match.groups()
        try:
            at = datetime.fromisoformat(moment.upper() + zone.upper().replace("Z", "+00:00"))
        except ValueError as error:
            raise LogError(f"{text!r} is not a time: {error}") from error
        since = at - _EPOCH
        seconds = since.days * 86400 + since.seconds
        return seconds * NS + int((fraction or "").ljust(9, "0"))
    if match := re.fullmatch(r"(\d{1,19})(ns)?", text):
        number = int(match[1])
        return number if match[2] or number >= NS else start_ns + number * NS
    if match := re.fullmatch(r"(\d{0,19})(?:\.(\d*))?s?", text):
        seconds_text, fraction = match.groups("")
        if seconds_text or fraction:
            return start_ns + int(seconds_text or 0) * NS + int(fraction[:9].ljust(9, "0"))
    raise LogError(
        f"{elide(text, 40)!r} is not a time: give seconds from the start (2.5), nanoseconds, or "
        "2013-05-01T12:00:00Z"
    )


def _time(moment: object) -> object:
    """Return the text of a moment; in TOML it may be a number or a date as well."""
    if isinstance(moment, int | float) and not isinstance(moment, bool):
        moment = str(moment)
    if isinstance(moment, str):
        try:
            parse_time(moment)
        except LogError as error:
            raise SettingError.of(error) from error
    return moment


def _disturbances(value: object) -> object:
    """Return disturbances as they are named, one a text; several may stand in one."""
    from roadeval.images.disturbing import Disturbance

    texts = [value] if isinstance(value, str) else value
    if not isinstance(texts, list | tuple) or not all(isinstance(text, str) for text in texts):
        return value
    words = [word for text in texts for word in text.split(",")]
    return tuple(dict.fromkeys(str(Disturbance.parse(word)) for word in words))


Time = Annotated[str, Checked(_time)]
"""A moment as `roadeval.logs.settings.parse_time` reads it."""
Count = Interval(ge=1, le=1_000_000_000)
Value = Annotated[int, Interval(ge=-32768, le=65535)]
Name = Annotated[str, Len(1, 200)]
Level = Annotated[int, Interval(ge=0, le=255)]
Color = tuple[Level, Level, Level]
"""Red, green and blue, 0..255 each."""
_LABEL: Final = re.compile(r"-?\d{1,5}|\d{1,3},\d{1,3},\d{1,3}")
"""A label's value or colour, as a key of TOML."""


@dataclass(frozen=True)
class TopicSettings:
    """Topics, if the log leaves a choice, and how label images are paired with images.

    image: The camera's topic, if the log has several.
    frame_id: The ``frame_id`` in the headers of the images to read, if cameras share a topic.
    truth: The topic of label images that show where road is; an empty name means none.
    shadow: The topic of masks that show where shadow truly is; an empty name means none.
    masks: The topic of road masks, such as a network's output, that are scored as one more variant.
    sync_tolerance_ms: Greatest difference in milliseconds between the stamps of an image and its
        truth. Default: half the frame period.
    sync_offset_ms: Milliseconds to add to the stamps of the truth before it is paired; below 0 if
        it is late.
    resize_truth: Scaling of label images of another size to the image's (nearest pixel).
    """

    image: str | None = None
    frame_id: Annotated[str | None, Flag("--frame-id", "ID")] = None
    truth: Annotated[str | None, Flag("--truth-topic", "T")] = None
    shadow: Annotated[str | None, Flag("--shadow-topic", "T")] = None
    masks: Annotated[Mapping[str, str], Flag("--mask-topic", "NAME=TOPIC", "Methods")] = field(
        default_factory=dict
    )
    sync_tolerance_ms: Annotated[
        float | None, Interval(ge=0, le=86_400_000), Flag("--sync-tolerance", "MS")
    ] = None
    sync_offset_ms: Annotated[
        float, Interval(ge=-86_400_000, le=86_400_000), Flag("--sync-offset", "MS")
    ] = 0.0
    resize_truth: Annotated[bool, Flag("--resize-truth")] = False

    @property
    def of_labels(self) -> frozenset[str | None]:
        """The named topics that hold labels or masks, and so no camera's images."""
        return frozenset((self.truth, self.shadow, *self.masks.values()))


@dataclass(frozen=True)
class CameraSettings:
    """One of several cameras of a log: its topics, which replace ``[topics]``."""

    image: Annotated[str, Len(min_length=1)]
    """The topic of its images."""
    name: str = ""
    """Its name in tables and in the recording. Default: its topic."""
    truth: str | None = None
    """The topic of its road truth."""
    shadow: str | None = None
    """The topic of its true shadow."""
    masks: Mapping[str, str] = field(default_factory=dict)
    """Topics of masks to score as one more variant, by the variant's name."""
    ground: GroundSettings = field(default_factory=GroundSettings)
    """Its height, angles and lens, if the log lacks them."""


@dataclass(frozen=True)
class LabelSettings:
    """The values, or colours, of label images that mean road, and those that are ignored.

    All others are non-road. By default a mask has 0, 255 for road and 128 for ignore; or 0, 1 for
    road and 255 for ignore. Negative values mean no label: they are ignored, unless they are named.

    road: Truth values (of a palette: its indices), or names of classes, that mean road.
    ignore: Truth values, or names of classes, that are not counted.
    road_colors: Truth colours that mean road, as red, green and blue.
    ignore_colors: Truth colours that are not counted.
    names: Names of classes by their values, or by their colours such as ``"64,32,32"``, for use in
        ``road`` and ``ignore``. Default: a ``vision_msgs/LabelInfo`` beside the labels' topic.
    """

    road: Annotated[tuple[Value | Name, ...], Flag("--road-label", "V|NAME")] = ()
    ignore: Annotated[tuple[Value | Name, ...], Flag("--ignore-label", "V|NAME")] = ()
    road_colors: Annotated[tuple[Color, ...], Flag("--road-color", "R,G,B")] = ()
    ignore_colors: Annotated[tuple[Color, ...], Flag("--ignore-color", "R,G,B")] = ()
    names: Mapping[str, Name] = field(default_factory=dict)

    def __post_init__(self) -> None:
        kinds = {key.count(",") if _LABEL.fullmatch(key) else -1 for key in self.names}
        if len(kinds) > 1 or -1 in kinds:
            raise SettingError("its keys must all be values, or all colours", setting="names")
        numbers = any(isinstance(label, int) for label in (*self.road, *self.ignore))
        mixed = (self.road or self.ignore) and (self.road_colors or self.ignore_colors)
        if mixed or (numbers and self.by_color):
            raise ValueError("the truth's labels are given as values or as colours, not as both")
        if self.ignore and not self.road:
            remedy = "name the values that mean road"
            raise SettingError(Sentence("needs {road}"), setting="ignore", remedy=remedy)
        if self.ignore_colors and not self.road_colors:
            needs, remedy = Sentence("needs {road_colors}"), "name the colours that mean road"
            raise SettingError(needs, setting="ignore_colors", remedy=remedy)
        for both in {*self.road} & {*self.ignore} or {*self.road_colors} & {*self.ignore_colors}:
            raise ValueError(f"label {both} cannot mean road and ignore at once")

    @property
    def by_color(self) -> bool:
        """Whether labels are colours."""
        return bool(self.road_colors) or any("," in key for key in self.names)

    def with_values(
        self, where: str, names: Mapping[str, str] | None = None, classes: Collection[str] = ()
    ) -> LabelSettings:
        """Return the settings with values, or colours, in place of the names of classes.

        ``names`` are further names by value, from the log. ``classes`` are names that stand in the
        labels themselves. A `LogError` if there are names, but a class is none of them.
        """
        names = self.names if self.by_color else {**(names or {}), **self.names}
        chosen = dict[str, Any]()
        for setting in ("road", "ignore"):
            labels: list[Any] = []
            for label in getattr(self, setting):
                keys = [key for key, name in names.items() if name == label not in classes]
                if names and not (keys or classes) and isinstance(label, str):
                    problem = f"{label} is none of the classes of {where}"
                    remedy = f"these are {', '.join(dict.fromkeys(names.values()))}"
                    raise LogError(problem, setting=f"labels.{setting}", remedy=remedy)
                labels += keys or [label]
            colors = tuple(tuple(map(int, key.split(","))) for key in labels if "," in str(key))
            chosen |= {f"{setting}_colors": colors} if colors else {}
            labels = [] if colors else labels
            chosen[setting] = tuple(int(key) if str(key) in names else key for key in labels)
        return replace(self, names=names, **chosen)


@dataclass(frozen=True)
class LabelPlace:
    """Road truth that lies beside the log, and how it is paired with the log's frames.

    path: Folder of labels, one a frame (images, NPY); COCO, CVAT, LabelMe, YOLO, Label Studio,
        Cityscapes, BDD100K, VIA; or LOG.mcap:/topic. In the path ``{drive}`` is the name of the
        drive's file without its ending.
    pair: The pairing of labels with frames: by the ``number`` in the labels' names, or by the
        ``stamp``, if each name is a time (seconds, or milli-, micro- or nanoseconds since 1970).
        Default: stamps for a log, and for files if all names are times of more than ten digits.
    first: The number of the first frame's label. Default: found, if the labels' numbers allow one.
    names: A pattern of the names of labels to read, such as ``left/*`` for one of several cameras.
        In ``*_{number}_v?.png`` the part ``{number}`` is the frame's number; ``*`` and ``?`` are
        any text and any letter.
    images: The folder of the images in the log, in their order: a label belongs to the image of the
        same name, without endings such as ``_mask``. It may contain ``{drive}``.
    skip_roadless: Only drawn labels that contain road. By default an image with shapes of other
        classes alone counts as an image without road.
    """

    path: Annotated[str, Flag("--truth", "PATH[:TOPIC]")] = ""
    pair: Annotated[Literal["number", "stamp"] | None, Flag("--truth-pair", "number|stamp")] = None
    first: Annotated[int | None, Interval(ge=0, le=1_000_000_000), Flag("--truth-first", "N")] = (
        None
    )
    names: Annotated[str, Flag("--truth-names", "PATTERN")] = "*"
    images: Annotated[str | None, Flag("--truth-images", "FOLDER")] = None
    skip_roadless: Annotated[bool, Flag("--skip-roadless")] = False

    def __post_init__(self) -> None:
        if self.images is not None and (self.pair, self.first) != (None, None):
            raise ValueError("with images labels are paired by name: leave out pair and first")


@dataclass(frozen=True)
class MaskSettings(LabelPlace):
    """Another method's road masks that lie beside the log.

    threshold: For confidence maps: the least confidence of road, from 0 to 1. Whole numbers of 8 or
        16 bits are divided by the greatest one.
    decide: For confidence maps: ``threshold``, or ``trained`` for the one with the fewest errors on
        the training frames.
    labels: The meaning of masks with other values than 0 and 255 (road), or 0 and 1 (road).
    """

    threshold: Annotated[float | None, Interval(gt=0, le=1)] = None
    decide: Literal["threshold", "trained"] = "threshold"
    labels: LabelSettings = LabelSettings()

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.threshold is not None and self.labels != LabelSettings():
            raise ValueError("threshold is for confidence maps, labels are for masks of classes")
        if self.threshold is None and self.decide == "trained":
            raise ValueError("a trained threshold is for confidence maps: give threshold as well")


@dataclass(frozen=True)
class FrameSettings:
    """The frames of the log that are read, and how they are decoded.

    start: First time: seconds from the log's start, nanoseconds, or RFC 3339.
    end: End time, exclusive.
    every: Step from frame to frame: 5 reads every fifth one.
    labelled: Only frames that have truth. Windows and flicker then join neighbouring labelled
        frames, however far apart they are.
    max_frames: Greatest number of frames to read.
    scale: Factor by which width and height of frames and truth are reduced. A smaller one is faster
        and coarser, and gives other results.
    disturb: Disturbances of the evaluated frames with their strengths, such as fog:2, under which
        every variant is scored again: dark, fog, blur, dirt, rain, jpeg, noise or exposure.
    max_pixels: Greatest number of pixels of an image. Larger images are not decoded: a damaged head
        may claim any size.
    unturned: Images as they are stored, without the turn of their EXIF orientation or a video's
        display matrix. Viewers and annotation tools turn them; calibrations are for the sensor.
    full_range: A luma range of 0 to 255 for videos, as in converted JPEGs. Default: the range that
        a video states, else 16 to 235.
    white: The sample value of white in images of more than 8 bits. Default: the greatest value of
        8, 10, 12, 14 or 16 bits, the fewest that hold the samples of some images; 1 for fractions.
    """

    start: Annotated[Time | None, Flag("-S --start", "TIME")] = None
    end: Annotated[Time | None, Flag("-E --end", "TIME")] = None
    every: Annotated[int, Count, Flag("--every", "N")] = 1
    labelled: Annotated[bool, Flag("--labelled")] = False
    max_frames: Annotated[int | None, Count, Flag("--max-frames", "N")] = None
    scale: Annotated[float, Interval(gt=0, le=1), Flag("--scale", "F", "Input")] = 1.0
    disturb: Annotated[
        tuple[str, ...], Checked(_disturbances), Flag("--disturb", "KIND:STRENGTH,...")
    ] = ()
    max_pixels: Annotated[int, Interval(ge=1, le=1 << 30), Flag("--max-pixels", "N", "Input")] = (
        MAX_PIXELS
    )
    unturned: Annotated[bool, Flag("--unturned", group="Input")] = False
    full_range: Annotated[bool, Flag("--full-range", group="Input")] = False
    white: Annotated[float | None, Interval(gt=0), Flag("--white", "V", "Input")] = None


AUDIT: Final = "audit.json"
"""The file that marks a folder of corrected labels: the drive's other labels are read, too."""


@dataclass(frozen=True)
class LogConfig:
    """All settings of reading a log."""

    masks: Mapping[str, MaskSettings] = field(default_factory=dict)
    """Masks of other methods that lie beside the log, by the name of their variant."""
    topics: TopicSettings = field(default_factory=TopicSettings)
    truth: LabelPlace = field(default_factory=LabelPlace)
    labels: LabelSettings = field(default_factory=LabelSettings)
    frames: FrameSettings = field(default_factory=FrameSettings)
    ground: GroundSettings = field(default_factory=GroundSettings)

    def __post_init__(self) -> None:
        is_audit = Path(self.truth.path, AUDIT).is_file()
        if self.truth.path and self.topics.truth and not is_audit:
            problem = Sentence("says where the truth is, and so does {topics.truth}")
            raise LogError(problem, setting="truth.path", remedy="give one of them")

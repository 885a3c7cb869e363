"""The layout of a recording: its images, tables and numbers with their entity paths."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Final

from pydantic import TypeAdapter

from roadeval.data import (
    BASELINE,
    ERRORS,
    FINAL_STAGE,
    OUTCOMES,
    RESERVED,
    TRUTH,
    Calibration,
    LabelClass,
    LayerKind,
    LayerSpec,
    VariantLayout,
    as_plain,
    is_plain,
)
from roadeval.data.colours import CLEAR, SHADOW
from roadeval.data.layer import IGNORED_CLASS
from roadeval.errors import RoadevalError
from roadeval.geometry.ground import Ground, Plan
from roadeval.runtime.documents import read_json

APPLICATION: Final = "roadeval"
"""This program's name in its recordings."""
FORMAT: Final = 3
"""Version of the format. Only this one is read; a change that a reader must know of raises it."""

FRAME: Final = "frame"
STAMP: Final = "stamp"
"""Names of the timelines: the frame's number, and its header stamp in nanoseconds."""
LOG_TIME: Final = "message_log_time"
HEADER_TIME: Final = "ros2_timestamp"
FOXGLOVE_TIME: Final = "timestamp"
"""Timelines of the log time and of the header stamp, as Rerun names them when it reads an MCAP file
with ROS's or Foxglove's messages: one viewer shows both recordings in step."""

CAMERA: Final = "/camera"
TRUTH_PATH: Final = "/truth"
TRUE_SHADOW: Final = "/true_shadow"
GROUND: Final = "/ground"
"""The camera's image seen from above; below this path lie the truth and each variant's errors."""
CELL: Final = 0.16
"""Side of a cell of the ground seen from above, in metres."""
DISTURBED: Final = "/disturbed"
"""Below this path and the name of each disturbance lie the image, and the variants' masks."""
NOTES: Final = "/notes"
GUIDE: Final = "/results/guide"
FRAME_RATES: Final = "/results/frame"
"""Below this path lie each variant's rates of a frame, in percent, as a text for the viewer."""
PERCENT: Final = "/results/percent"
"""Below this path lie the rates of short tables in percent: the viewer plots what is logged."""
LAYOUT: Final = "/results/layout"
SHOWN: Final = "/results/images"
"""The frames that have images, with their header stamps."""
CAMERAS: Final = "/results/cameras"
"""The prefix of the paths of each camera of a rig, by its name, as JSON."""
SUMMARY: Final = "summary"
"""The name of the result that holds the content of ``summary.json``."""
SECONDS: Final = "/timing/summary"
"""The summary's seconds, which differ from run to run, as all timing does."""
PROPERTIES: Final = "/__properties/roadeval"
"""The path of a recording's properties, as Rerun names it."""
ROLE: Final = "/state/frame"
COUNTS: Final = (*OUTCOMES, "N")
"""The order of the numbers under ``/counts``."""
MOST_WAITING: Final = 128
"""Greatest number of frames that wait to be written. A killed run loses their images and text."""


class RecordingError(RoadevalError):
    """A recording cannot be written or read."""


class SeveralCamerasError(RecordingError):
    """A recording has several cameras, and none of them was named."""

    def __init__(self, path: object, cameras: Sequence[str]) -> None:
        remedy = f"name one of {', '.join(cameras)}"
        super().__init__("a recording of several cameras", where=path, remedy=remedy)
        self.cameras = cameras


class DamagedError(RecordingError):
    """A part of a recording differs from what was written."""

    def __init__(self, path: object, part: str) -> None:
        problem = f"the recording is damaged inside, at {part}"
        remedy = "make it again, or read the results folder of its run"
        super().__init__(problem, where=path, remedy=remedy)


@dataclass(frozen=True)
class Layout:
    """The facts of a recording that hold before its first frame."""

    drive: str
    """Name of the log, for titles."""
    width: int
    height: int
    """Size of every image, in pixels."""
    variants: tuple[VariantLayout, ...]
    """The variants in the order in which they are shown, without the baseline."""
    rates: tuple[str, ...]
    """Names of the rates under ``/metrics``."""
    baseline: bool = True
    """Whether the baseline is counted as well."""
    has_truth: bool = True
    """Whether any frame has truth of the road."""
    has_shadow_truth: bool = False
    disturbed: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """The variants that run on the images of each disturbance, by its name."""
    focus: str = ""
    """The variant whose errors, or doubts, rank the frames; all of them if it is empty."""
    first_frame: int | None = None
    """The first frame that can be evaluated, if known."""
    rate_hz: float | None = None
    """Frames a second, if known: the speed at which the viewer plays."""
    calibration: Calibration | None = None
    """Calibration for images of this size, if known."""
    ground: Ground | None = None
    """Ground in front of the camera, if known."""
    extent: tuple[float, float, float] = (6, 46, 20)
    """Nearest and farthest metres ahead of the ground seen from above, and its metres across."""
    clouds: tuple[str, ...] = ()
    """Topics of the log's point clouds: they are not recorded, but the viewer shows them if the log
    itself is opened beside the recording."""
    header_time: str = HEADER_TIME
    """Name of the header stamp's timeline in Rerun's own recording of the log."""
    tables: Mapping[str, str] = field(default_factory=dict)
    """Header lines of the tables that grow with the frames, by the table's name."""
    properties: Mapping[str, str | int | float] = field(default_factory=dict)
    """Provenance: versions, settings, hashes."""

    def __post_init__(self) -> None:
        for variant in self.variants:
            if variant.name in RESERVED or not is_plain(variant.name):
                raise RecordingError(
                    f"a variant cannot be named {variant.name!r}: the recording uses this name, or "
                    "its characters cannot stand in a path; choose another"
                )

    @property
    def shown(self) -> tuple[VariantLayout, ...]:
        """The variants in the viewer's order: the focus first."""
        return tuple(sorted(self.variants, key=lambda variant: variant.name != self.focus))

    def images(self) -> Iterator[tuple[str, LayerSpec]]:
        """Yield the entity path and description of every layer, truth and errors included."""
        if self.has_truth:
            yield TRUTH_PATH, TRUTH
        if self.has_shadow_truth:
            yield TRUE_SHADOW, SHADOW_TRUTH
        for variant in self.variants:
            for spec in variant.layers:
                yield f"/{variant.name}/{spec.name}", spec
            if self.has_truth:
                yield f"/{variant.name}/{ERRORS.name}", ERRORS
        for name, variants in self.disturbed.items():
            for variant in (variant for variant in self.variants if variant.name in variants):
                (post,) = (spec for spec in variant.layers if spec.name == variant.stages[-1])
                for spec in (post, ERRORS):
                    yield f"{DISTURBED}/{name}/{variant.name}/{spec.name}", spec

    def plan(self) -> Plan | None:
        """Return the view of the ground from above; None if the ground is unknown."""
        return Plan(self.ground, *self.extent, CELL) if self.ground else None

    def from_above(self) -> Iterator[tuple[str, LayerSpec]]:
        """Yield the entity path and description of each layer of the ground seen from above."""
        if self.ground and self.has_truth:
            yield f"/ground/{TRUTH.name}", TRUTH
            yield from ((f"/ground/{variant.name}", ERRORS) for variant in self.variants)

    def scored(self) -> Iterator[tuple[str, str]]:
        """Yield the variant and stage of every counted mask, the baseline last."""
        if self.has_truth:
            yield from ((v.name, stage) for v in self.variants for stage in v.stages)
        if self.has_truth and self.baseline:
            yield BASELINE, FINAL_STAGE

    def to_json(self) -> str:
        """Return the layout as JSON, from which `from_json` makes an equal one."""
        return json.dumps(asdict(self), sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> Layout:
        """Return the layout that `to_json` wrote; unknown fields are ignored."""
        return TypeAdapter(cls).validate_python(read_json(text))


SHADOW_TRUTH: Final = LayerSpec(
    "true_shadow",
    LayerKind.MASK,
    "True shadow",
    (LabelClass(0, "lit", CLEAR), LabelClass(1, "shadow", (*SHADOW, 160)), IGNORED_CLASS),
)


def prefixes(cameras: Iterable[str]) -> dict[str, str]:
    """Return the prefix of the paths of each camera's entities, by the cameras' names.

    It is empty for a camera without a name, which is the only one of its drive.

    >>> prefixes(["/left/image raw", "front", ""])
    {'/left/image raw': '/left/image_raw', 'front': '/front', '': ''}
    """
    paths: dict[str, str] = {}
    for name in cameras:
        path = "".join(f"/{as_plain(part)}" for part in name.split("/") if part)
        while path and path in paths.values():
            path += "_"
        paths[name] = path
    return paths


_RULE: Final = re.compile(r"(all|masks|none)|(worst|every):([1-9][0-9]{0,8})")


@dataclass(frozen=True)
class RecordRule:
    """The setting ``output.record``: which frames have images; the rest is always recorded.

    >>> RecordRule.parse("worst:20")
    RecordRule(kind='worst', number=20)
    """

    kind: str = "all"
    """Frames with images: ``all``, the ``worst`` (with the highest ERR), or ``every`` N-th one.
    ``masks`` records masks and the camera's image of every frame; ``none`` makes no recording."""
    number: int = 0
    """K of ``worst:K``, N of ``every:N``."""

    @property
    def recorded(self) -> bool:
        """Whether there is a recording."""
        return self.kind != "none"

    @classmethod
    def parse(cls, text: str) -> RecordRule:
        """Return the rule that a text states; a `RecordingError` if it states none."""
        match = _RULE.fullmatch(text)
        if match is None:
            problem = f"there is no choice {text}"
            remedy = "choose all, masks, worst:K, every:N or none (as worst:20)"
            raise RecordingError(problem, setting="output.record", remedy=remedy)
        plain, counted, number = match.groups()
        return cls(plain or counted, int(number or 0))

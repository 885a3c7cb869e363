"""The layout of a recording: what it holds, and the entity path of each thing in it."""

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
from roadeval.geometry.ground import Ground
from roadeval.geometry.plan import Plan
from roadeval.runtime.documents import read_json

APPLICATION: Final = "roadeval"
"""Name of this program in its recordings."""
FORMAT: Final = 3
"""Version of the format. Only this one is read; a change that a reader must know of raises it."""

FRAME: Final = "frame"
STAMP: Final = "stamp"
"""Names of the timelines: the frame's number, and its header stamp in nanoseconds."""
LOG_TIME: Final = "message_log_time"
HEADER_TIME: Final = "ros2_timestamp"
FOXGLOVE_TIME: Final = "timestamp"
"""The names of timelines in recordings that Rerun itself makes of MCAP files: the log time, and the
header stamp of ROS's and of Foxglove's messages. With them both recordings are in step in one
viewer."""

CAMERA: Final = "/camera"
TRUTH_PATH: Final = "/truth"
TRUE_SHADOW: Final = "/true_shadow"
GROUND: Final = "/ground"
"""The camera's image as the ground looks from above; below it the truth, and each variant's errors.
"""
CELL: Final = 0.16
"""Metres of a cell's side there."""
NOTES: Final = "/notes"
GUIDE: Final = "/results/guide"
LAYOUT: Final = "/results/layout"
SHOWN: Final = "/results/images"
"""The frames that have images, each with its header stamp."""
CAMERAS: Final = "/results/cameras"
"""Of a rig: where the entities of each camera begin, by its name, as JSON."""
SUMMARY: Final = "summary"
"""The name of a result, the content of ``summary.json``."""
SECONDS: Final = "/timing/summary"
"""The summary's seconds, which differ from run to run, as all timing does."""
PROPERTIES: Final = "/__properties/roadeval"
"""Where Rerun keeps a recording's properties."""
ROLE: Final = "/state/frame"
COUNTS: Final = (*OUTCOMES, "N")
"""The order of the numbers under ``/counts``."""
MOST_WAITING: Final = 128
"""Most frames whose images and text wait to be written. A killed run loses them."""


class RecordingError(RoadevalError):
    """A recording cannot be written or read."""


class SeveralCamerasError(RecordingError):
    """A recording of several cameras, none of which was named."""

    def __init__(self, path: object, cameras: Sequence[str]) -> None:
        names = ", ".join(cameras)
        super().__init__(f"{path}: a recording of several cameras; name one of {names}")
        self.cameras = cameras


class DamagedError(RecordingError):
    """A part of a recording is not what was written."""

    def __init__(self, path: object, part: str) -> None:
        super().__init__(
            f"{path}: the recording is damaged inside, at {part}; make it again, or read the "
            "results folder of its run"
        )


@dataclass(frozen=True)
class Layout:
    """What is known about a recording before its first frame."""

    drive: str
    """Name of the log, for titles."""
    width: int
    """Of every image, in pixels."""
    height: int
    variants: tuple[VariantLayout, ...]
    """The variants in the order in which they are shown, without the baseline."""
    rates: tuple[str, ...]
    """Names of the rates under ``/metrics``."""
    baseline: bool = True
    """Whether the baseline is counted, too."""
    has_truth: bool = True
    """Whether any frame has a truth of the road."""
    has_shadow_truth: bool = False
    first_frame: int | None = None
    """The first frame that can be evaluated, if known."""
    rate_hz: float | None = None
    """Frames a second, if known: the speed at which the viewer plays."""
    calibration: Calibration | None = None
    """Of images of this size, where it is known."""
    ground: Ground | None = None
    """Before the camera, where it is known."""
    extent: tuple[float, float, float] = (6, 46, 20)
    """Metres ahead between which the ground is shown from above, and metres across."""
    clouds: tuple[str, ...] = ()
    """Topics of the log's point clouds. They are not recorded, but seen where Rerun's own loader of
    the log puts them beside."""
    header_time: str = HEADER_TIME
    """The name of the header stamp's timeline in Rerun's own recording of the log."""
    tables: Mapping[str, str] = field(default_factory=dict)
    """Header line of each table that grows with the frames, by the table's name."""
    properties: Mapping[str, str | int | float] = field(default_factory=dict)
    """Provenance: versions, settings, hashes."""

    def __post_init__(self) -> None:
        for variant in self.variants:
            if variant.name in RESERVED or not is_plain(variant.name):
                raise RecordingError(
                    f"a variant cannot be named {variant.name!r}: the recording uses that name "
                    "itself, or no path in it can hold it; choose another"
                )

    def images(self) -> Iterator[tuple[str, LayerSpec]]:
        """Yield the entity path and description of every layer, truths and errors included."""
        if self.has_truth:
            yield TRUTH_PATH, TRUTH
        if self.has_shadow_truth:
            yield TRUE_SHADOW, SHADOW_TRUTH
        for variant in self.variants:
            for spec in variant.layers:
                yield f"/{variant.name}/{spec.name}", spec
            if self.has_truth:
                yield f"/{variant.name}/{ERRORS.name}", ERRORS

    def plan(self) -> Plan | None:
        """Return the ground as it is shown from above."""
        return Plan(self.ground, *self.extent, CELL) if self.ground else None

    def from_above(self) -> Iterator[tuple[str, LayerSpec]]:
        """Yield the entity path and description of what lies on the ground seen from above."""
        if self.ground and self.has_truth:
            yield f"/ground/{TRUTH.name}", TRUTH
            yield from ((f"/ground/{each.name}", ERRORS) for each in self.variants)

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
    """Return the path below which all entities of each camera lie, by the cameras' names.

    It is empty for a camera without a name, the only one of its drive.

    >>> prefixes(["/left/image raw", "front", ""])
    {'/left/image raw': '/left/image_raw', 'front': '/front', '': ''}
    """
    found: dict[str, str] = {}
    for name in cameras:
        path = "".join(f"/{as_plain(part)}" for part in name.split("/") if part)
        while path and path in found.values():
            path += "_"
        found[name] = path
    return found


_RULE: Final = re.compile(r"(all|masks|none)|(worst|every):([1-9][0-9]{0,8})")


@dataclass(frozen=True)
class RecordRule:
    """The setting ``output.record``. Numbers, notes and tables of all frames are always recorded.

    >>> RecordRule.parse("worst:20")
    RecordRule(kind='worst', number=20)
    """

    kind: str = "all"
    """Of which frames all images are kept: ``all``, the ``worst`` (with the highest ERR), ``every``
    N-th one. Of ``masks`` those of every frame, with the camera's image; ``none`` records nothing.
    """
    number: int = 0
    """K of ``worst:K``, N of ``every:N``."""

    @property
    def recorded(self) -> bool:
        """Whether there is a recording."""
        return self.kind != "none"

    @classmethod
    def parse(cls, text: str) -> RecordRule:
        """Read a rule from the text of a setting; a `RecordingError` if it is not a rule."""
        match = _RULE.fullmatch(text)
        if match is None:
            raise RecordingError(
                f"there is no choice {text}",
                setting="output.record",
                remedy="choose all, masks, worst:K, every:N or none (as worst:20)",
            )
        plain, counted, number = match.groups()
        return cls(plain or counted, int(number or 0))

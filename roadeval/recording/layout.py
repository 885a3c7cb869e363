"""The layout of a recording: what it will hold, and under which entity path each thing lies."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any, Final

from roadeval.data import (
    BASELINE,
    ERRORS,
    FINAL_STAGE,
    RESERVED,
    TRUTH,
    LabelClass,
    LayerKind,
    LayerSpec,
    VariantLayout,
    is_plain,
)
from roadeval.data.colours import CLEAR, SHADOW, with_opacity
from roadeval.data.counts import OUTCOMES
from roadeval.data.layer import IGNORED_CLASS
from roadeval.errors import RoadevalError

APPLICATION: Final = "roadeval"
"""Name under which the viewer knows the files, and by which ours are recognised."""
FORMAT: Final = 3
"""Version of the arrangement inside the file, which alone is read; raised with every change of it
that a reader must know of."""

FRAME: Final = "frame"
STAMP: Final = "stamp"
"""The two timelines: the frame's number, and its header stamp in nanoseconds."""

CAMERA: Final = "/camera"
TRUTH_PATH: Final = "/truth"
TRUE_SHADOW: Final = "/true_shadow"
NOTES: Final = "/notes"
GUIDE: Final = "/results/guide"
LAYOUT: Final = "/results/layout"
SUMMARY: Final = "summary"
OVERVIEW: Final = "overview"
"""Names of two results: the content of ``summary.json``, and the same for people."""
SUMS: Final = "/timing/sums"
"""Check sums of all that was written before; they are of bytes, which differ from run to run."""
SECONDS: Final = "/timing/summary"
"""The seconds of the summary: like all timing, they differ from run to run."""
PROPERTIES: Final = "/__properties/roadeval"
"""Where the viewer and `rerun.RecordingStream.send_property` keep a recording's properties."""
ROLE: Final = "/state/frame"
COUNTS: Final = (*OUTCOMES, "N")
"""The order of the five numbers under ``/counts``."""
MOST_WAITING: Final = 128
"""Frames whose images and text may wait to be written, at most: a killed run loses them."""


class RecordingError(RoadevalError):
    """A recording cannot be written or read: one line that says why."""


class DamagedError(RecordingError):
    """A recording that is damaged inside, so that a part of it is not what was written."""

    def __init__(self, path: object, part: str) -> None:
        super().__init__(
            f"{path}: the recording is damaged inside, at {part}; make it anew, or read the "
            "results folder of its run"
        )


@dataclass(frozen=True, slots=True)
class Layout:
    """What is known about a recording before its first frame.

    Parameters
    ----------
    drive
        Name of the log, for titles.
    width, height
        Size of every image in pixels.
    variants
        The variants in the order in which they are shown, without the baseline.
    rates
        Names of the rates under ``/metrics``.
    baseline
        Whether tallies of the baseline come, too.
    has_truth, has_shadow_truth
        Whether any frame has a truth of the road, of shadow.
    first_frame
        The first frame that can be evaluated, if known.
    rate_hz
        Frames a second, if known: the speed at which the viewer plays them.
    tables
        Header line of each table whose lines come with the frames, by the table's name.
    properties
        Provenance: versions, settings, hashes.
    """

    drive: str
    width: int
    height: int
    variants: tuple[VariantLayout, ...]
    rates: tuple[str, ...]
    baseline: bool = True
    has_truth: bool = True
    has_shadow_truth: bool = False
    first_frame: int | None = None
    rate_hz: float | None = None
    tables: Mapping[str, str] = field(default_factory=dict)
    properties: Mapping[str, str | int | float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for variant in self.variants:
            if variant.name in RESERVED or not is_plain(variant.name):
                raise RecordingError(
                    f"a variant cannot be named {variant.name!r}: the recording uses that name "
                    "itself, or no path in it can hold it; choose another"
                )

    def images(self) -> Iterator[tuple[str, LayerSpec]]:
        """Yield the entity path and description of every layer, the truths and errors included."""
        if self.has_truth:
            yield TRUTH_PATH, TRUTH
        if self.has_shadow_truth:
            yield TRUE_SHADOW, SHADOW_TRUTH
        for variant in self.variants:
            for spec in variant.layers:
                yield layer_path(variant.name, spec.name), spec
            if self.has_truth:
                yield layer_path(variant.name, ERRORS.name), ERRORS

    def scored(self) -> Iterator[tuple[str, str]]:
        """Yield the variant and stage of everything that is counted, the baseline last."""
        if self.has_truth:
            yield from ((v.name, stage) for v in self.variants for stage in v.stages)
        if self.has_truth and self.baseline:
            yield BASELINE, FINAL_STAGE

    def to_json(self) -> str:
        """Return the layout as JSON, from which `from_json` makes an equal one."""
        return json.dumps(asdict(self), sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> Layout:
        """Return the layout that `to_json` wrote; what only other versions know is passed over."""
        known = {each.name for each in fields(cls)}
        raw = {name: value for name, value in json.loads(text).items() if name in known}
        raw["variants"] = tuple(_variant(v) for v in raw["variants"])
        raw["rates"] = tuple(raw["rates"])
        return cls(**raw)


SHADOW_TRUTH: Final = LayerSpec(
    "true_shadow",
    LayerKind.MASK,
    "True shadow",
    (
        LabelClass(0, "lit", CLEAR),
        LabelClass(1, "shadow", with_opacity(SHADOW, 160)),
        IGNORED_CLASS,
    ),
)


def layer_path(variant: str, layer: str) -> str:
    """Return the entity path of a variant's layer."""
    return f"/{variant}/{layer}"


def guide_path(variant: str) -> str:
    """Return the entity path of the text that introduces a variant."""
    return f"{GUIDE}/{variant}"


def scalar_path(kind: str, variant: str, stage: str, name: str = "") -> str:
    """Return the entity path of numbers about a stage.

    ``kind`` is metrics, counts, timing or facts.
    """
    return "/".join(("", kind, variant, stage, *([name] if name else [])))


def state_path(variant: str) -> str:
    """Return the entity path of a variant's lane of health."""
    return f"/state/{variant}"


def result_path(name: str) -> str:
    """Return the entity path of a table or a document."""
    return f"/results/{name}"


def _variant(raw: dict[str, Any]) -> VariantLayout:
    layers = tuple(_spec(layer) for layer in raw["layers"])
    return VariantLayout(raw["name"], raw["title"], tuple(raw["stages"]), layers)


def _spec(raw: dict[str, Any]) -> LayerSpec:
    classes = tuple(LabelClass(c["value"], c["name"], tuple(c["rgba"])) for c in raw["classes"])
    low, high = raw["value_range"]
    kind = LayerKind(raw["kind"])
    return LayerSpec(raw["name"], kind, raw["title"], classes, (low, high), raw["exact"])

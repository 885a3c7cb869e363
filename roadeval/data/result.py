"""Results of a frame: what each variant's stages give, their score and names."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any, Final, NamedTuple, TypeVar

import numpy.typing as npt

from roadeval.data.arrays import Floats, Packed, Sums, TruthBits
from roadeval.data.frame import Frame, Histogram, Mask, Probability, Rgb, Role
from roadeval.data.layer import Layer, LayerSpec

CAMERA: Final = "camera"
FILTERED: Final = "filtered"
UNFILTERED: Final = "unfiltered"
TUNED: Final = "_tuned"
"""Ends the name of a tuned variant; before it stands that of its method."""
"""The names of the two variants that come by default: with the chain's filters, and without."""
BASELINE: Final = "blind"
"""The variant name of the baseline that never looks at the image."""
FINAL_STAGE: Final = "post"
"""The stage whose mask is the pipeline's answer, and under which the baseline is filed."""

RESERVED: Final = frozenset(
    {
        *("blind", "camera", "counts", "facts", "frame", "ground", "metrics", "notes", "results"),
        *("roadeval", "state", "timing", "true_shadow", "truth"),
    }
)
"""Reserved names, which no variant may have: tables and recordings use them otherwise."""

_PLAIN: Final = re.compile(r"[A-Za-z0-9_-]{1,200}")
"""No longer than the name of a file can be, with an ending."""
OUTCOMES: Final = ("TP", "TN", "FP", "FN")
"""The columns of `Counts` in tables, in the order of its fields."""


def is_plain(name: str) -> bool:
    """Return whether results can hold a name of a variant, stage or region.

    It is a column's cell, a part of a path in the recording, and a word in figures and tables.
    """
    return _PLAIN.fullmatch(name) is not None


def as_plain(name: str) -> str:
    """Return a name as letters, digits, ``-`` and ``_`` alone, for files, identities and paths.

    >>> as_plain("/front/image raw")
    'front_image_raw'
    """
    return re.sub(r"[^A-Za-z0-9_-]+", "_", name).strip("_")


class Counts(NamedTuple):
    """Pixels by outcome; road is the positive class, ignored pixels are in none (section 5)."""

    tp: int = 0
    tn: int = 0
    fp: int = 0
    fn: int = 0

    @property
    def n(self) -> int:
        """Road and non-road pixels of the truth, N in Eq. 24-25."""
        return self.tp + self.tn + self.fp + self.fn


@dataclass(frozen=True)
class Tally:
    """The counts of one stage of one variant on one frame, whole and by region.

    ``rates`` are the fractions of Eq. 24-29 by name; an undefined one is NaN.
    """

    variant: str
    stage: str
    counts: Counts
    regions: Mapping[str, Counts] = field(default_factory=dict)
    rates: Mapping[str, float] = field(default_factory=dict)


class Change(NamedTuple):
    """Pixels that one mask repairs and spoils against another.

    ``repaired`` are newly right, ``spoiled`` newly wrong, of the ``labelled`` ones.
    """

    repaired: int = 0
    spoiled: int = 0
    labelled: int = 0


Contour = tuple[float, float, Sums]
"""A final mask's boundary F and boundary IoU, NaN where undefined, and its trimap, ``(w, 2)``."""
Transition = tuple[str, str, str, str]
"""A change of masks: variant and stage before, variant and stage after."""


@dataclass(frozen=True, eq=False)
class Output:
    """The output of a stage for a frame."""

    layers: tuple[Layer, ...] = ()
    """Named arrays to record."""
    image: Rgb | None = None
    """``(H, W, 3)`` uint8 RGB that replaces the image for the stages after it, if any."""
    mask: Packed | None = None
    """Its road mask, if it makes one; also among its layers, under the stage's name."""
    regions: Mapping[str, Packed] = field(default_factory=dict)
    """Sets of pixels to count separately, by name."""
    facts: Mapping[str, float] = field(default_factory=dict)
    """Numbers about the frame, by name, as the ``threshold`` that it chose."""
    probability: Probability | None = None
    """How probable road is, ``(H, W)`` uint16 codes 0..65535 that span 0..1, where the mask is a
    threshold on it.
    """
    by_class: tuple[Probability, ...] = ()
    """Probabilities of each class of road, where there are several."""


@dataclass(frozen=True, eq=False)
class StageResult:
    """The output of one stage of one variant on one frame, and the wall time it took."""

    stage: str
    output: Output
    seconds: float

    def without_layers(self) -> StageResult:
        """Return the mask and the facts, which are needed after the layers are encoded."""
        kept = Output(mask=self.output.mask, facts=self.output.facts)
        return StageResult(self.stage, kept, self.seconds)


@dataclass(frozen=True, eq=False)
class VariantResult:
    """The outputs of a variant's stages for one frame, in the order they ran.

    ``oracles`` holds, by the name of a stage that was replaced by the truth, the road masks of
    the stages after it by theirs. They are no results: see `roadeval.pipeline.chain.Chain`.
    """

    variant: str
    stages: tuple[StageResult, ...]
    oracles: Mapping[str, Mapping[str, Packed]] = field(default_factory=dict)

    def masks(self) -> Iterator[tuple[str, Packed]]:
        """Yield each stage that has a road mask, with the mask; `Packed.pixels` gives its array."""
        for result in self.stages:
            if result.output.mask is not None:
                yield result.stage, result.output.mask

    def layers(self) -> Iterator[Layer]:
        """Yield every layer of every stage, in order."""
        for result in self.stages:
            yield from result.output.layers

    def final(self) -> Mask:
        """Return the pixels of the last stage's mask, ``(H, W)`` uint8."""
        *_, (_, mask) = self.masks()
        return mask.pixels()


@dataclass(frozen=True)
class VariantLayout:
    """A variant as known before the first frame: its stages with masks and its layers."""

    name: str
    title: str
    stages: tuple[str, ...]
    layers: tuple[LayerSpec, ...]


class Health(StrEnum):
    """How a variant fared on a frame, for the recording's state lanes."""

    OK = "ok"
    DEGRADED = "degraded"
    FAILED = "failed"


@dataclass(frozen=True)
class Doubt:
    """How much a variant's final mask is in doubt on a frame without truth; never an error rate."""

    variant: str
    stage: str
    entropy: float
    """Mean over pixels of how unsure road is, in bits; NaN where no stage says how probable it is.
    """
    differs: Mapping[str, float] = field(default_factory=dict)
    """The share of pixels on which each other variant's final mask differs."""
    flicker: float = math.nan
    """The share of pixels that change from the frame before; NaN where that was not seen."""

    @property
    def disagreement(self) -> float:
        """The mean of ``differs``; NaN for a variant alone."""
        return sum(self.differs.values()) / len(self.differs) if self.differs else math.nan


@dataclass(frozen=True, eq=False)
class FrameMetres:
    """The measures of a final mask of a frame in metres.

    Of S stances of the camera the first is as it is said to stand.
    """

    measures: Sequence[tuple[str, int]]
    """M names, and the metres ahead at which each is taken; 0 of one that is not."""
    ends: Floats
    """``(S, M, 2)``: where the mask and where the truth ends, in metres; NaN where none is seen."""
    regions: Sequence[str]
    """R names: the bands of distance, then the ground seen from above."""
    counts: Sums
    """``(S, R, 4)``: TP, TN, FP and FN."""


@dataclass(frozen=True, eq=False)
class FrameResult:
    """Everything known about one replayed frame: what is recorded and what is tabled.

    ``tallies`` is empty unless the frame is evaluated. ``truth_bits`` is what the masks were held
    against. ``changes`` are from stage to stage and from final mask to final mask, ``contours``
    those of the final masks by variant, ``histograms`` the labelled pixels by how probable road is,
    for each variant and stage that says so, and ``oracles`` the counts of what the stages
    made once one was replaced by the truth, by that one. ``metres`` are the measures of each
    final mask by variant where the camera is known, and ``above`` the ground seen from above by how
    probable road is. ``doubts`` has each variant's,
    without truth. ``notes`` are sentences for a person.
    """

    frame: Frame
    role: Role
    variants: tuple[VariantResult, ...]
    errors: Mapping[str, Layer] = field(default_factory=dict)
    tallies: tuple[Tally, ...] = ()
    health: Mapping[str, Health] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    truth_bits: TruthBits | None = None
    changes: Mapping[Transition, Change] = field(default_factory=dict)
    contours: Mapping[str, Contour] = field(default_factory=dict)
    histograms: Mapping[tuple[str, str], Histogram] = field(default_factory=dict)
    oracles: Mapping[str, tuple[Tally, ...]] = field(default_factory=dict)
    doubts: tuple[Doubt, ...] = ()
    metres: Mapping[str, FrameMetres] = field(default_factory=dict)
    above: Mapping[tuple[str, str], Histogram] = field(default_factory=dict)
    apart: Mapping[str, float] = field(default_factory=dict)
    """ERR by variant of a frame that was labelled because it was in doubt, which no sum counts."""

    def without_layers(self) -> FrameResult:
        """Return the result without layers, which take most memory, for summing up."""
        variants = tuple(
            VariantResult(v.variant, tuple(stage.without_layers() for stage in v.stages))
            for v in self.variants
        )
        return replace(self, variants=variants)


Cells = npt.NDArray[Any]


T = TypeVar("T")


def as_tree(items: Iterable[tuple[tuple[str, str], T]]) -> dict[str, dict[str, T]]:
    """Return what there is by two names, as a variant's and a stage's, one within the other."""
    tree: dict[str, dict[str, T]] = {}
    for (one, other), item in items:
        tree.setdefault(one, {})[other] = item
    return tree

"""Results of a frame: the outputs of each variant's stages, their counts and names."""

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
"""The names of the two default variants: with the chain's filters, and without."""
TUNED: Final = "_tuned"
"""The ending of a tuned variant's name, after the name of its method."""
BASELINE: Final = "blind"
"""The variant name of the baseline that never looks at the image."""
FINAL_STAGE: Final = "post"
"""The stage with the pipeline's final mask; the baseline has this stage, too."""

RESERVED: Final = frozenset(
    {
        *("blind", "camera", "counts", "disturbed", "facts", "frame", "ground", "metrics"),
        *("notes", "results", "roadeval", "state", "timing", "true_shadow", "truth"),
    }
)
"""Names that no variant may have, because tables and recordings use them."""

OUTCOMES: Final = ("TP", "TN", "FP", "FN")
"""The columns of `Counts` in tables, in the order of its fields."""


def is_plain(name: str) -> bool:
    """Return whether a variant, stage or region may have this name in paths, tables and figures."""
    return re.fullmatch(r"[A-Za-z0-9_-]{1,200}", name) is not None


def as_plain(name: str) -> str:
    """Return a name with only letters, digits, ``-`` and ``_``, for files, identities and paths.

    >>> as_plain("/front/image raw")
    'front_image_raw'
    """
    return re.sub(r"[^A-Za-z0-9_-]+", "_", name).strip("_")


class Counts(NamedTuple):
    """Pixels by outcome. Road is the positive class; ignored pixels do not count (section 5)."""

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
    """The counts of one stage of one variant on one frame, in the whole frame and by region.

    ``rates`` are the fractions of Eq. 24-29 by name; an undefined one is NaN.
    """

    variant: str
    stage: str
    counts: Counts
    regions: Mapping[str, Counts] = field(default_factory=dict)
    rates: Mapping[str, float] = field(default_factory=dict)


class Change(NamedTuple):
    """Pixels that a mask repairs (newly right) and spoils (newly wrong) compared with another."""

    repaired: int = 0
    spoiled: int = 0
    labelled: int = 0


Contour = tuple[float, float, Sums]
"""A final mask's boundary F and boundary IoU, NaN if undefined, and its trimap, ``(w, 2)``."""
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
    """Its road mask, if any; its layers contain it, too, under the stage's name."""
    regions: Mapping[str, Packed] = field(default_factory=dict)
    """Sets of pixels to count separately, by name."""
    facts: Mapping[str, float] = field(default_factory=dict)
    """Numbers about the frame by name, such as the chosen ``threshold``."""
    probability: Probability | None = None
    """The probability of road, if a threshold on it gives the mask."""
    by_class: tuple[Probability, ...] = ()
    """Probabilities of each class of road, if there are several."""


@dataclass(frozen=True, eq=False)
class StageResult:
    """The output of one stage of one variant on one frame, and the wall time it took."""

    stage: str
    output: Output
    seconds: float

    def without_layers(self) -> StageResult:
        """Return the mask and the facts, which are needed after the layers are encoded."""
        output = Output(mask=self.output.mask, facts=self.output.facts)
        return StageResult(self.stage, output, self.seconds)


@dataclass(frozen=True, eq=False)
class VariantResult:
    """The outputs of a variant's stages for one frame, in the order in which they ran.

    ``oracles[a][b]`` is the road mask of stage b after the output of stage a was replaced by the
    truth. These masks are not results: see `roadeval.pipeline.chain.Chain`.
    """

    variant: str
    stages: tuple[StageResult, ...]
    oracles: Mapping[str, Mapping[str, Packed]] = field(default_factory=dict)

    def masks(self) -> Iterator[tuple[str, Packed]]:
        """Yield the name and the mask of each stage with a road mask."""
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
    """The stages with masks and the layers of a variant, known before the first frame."""

    name: str
    title: str
    stages: tuple[str, ...]
    layers: tuple[LayerSpec, ...]


class Health(StrEnum):
    """The health of a variant on a frame, for the recording's state lanes."""

    OK = "ok"
    DEGRADED = "degraded"
    FAILED = "failed"


@dataclass(frozen=True)
class Doubt:
    """Measures of doubt about a variant's final mask without truth; none is an error rate."""

    variant: str
    stage: str
    entropy: float
    """Mean entropy of road over pixels, in bits; NaN if no stage gives a probability."""
    differs: Mapping[str, float] = field(default_factory=dict)
    """The share of pixels in which each other variant's final mask differs."""
    flicker: float = math.nan
    """The share of pixels that change from the frame before; NaN without such a frame."""

    @property
    def disagreement(self) -> float:
        """The mean of ``differs``; NaN if there is no other variant."""
        return sum(self.differs.values()) / len(self.differs) if self.differs else math.nan


@dataclass(frozen=True, eq=False)
class FrameMetres:
    """Measures of a final mask in metres for S poses of the camera, the calibrated pose first."""

    measures: Sequence[tuple[str, int]]
    """M names, and the metres ahead of each measure; 0 if it has none."""
    ends: Floats
    """``(S, M, 2)``: the ends of the mask and of the truth in metres; NaN if none is seen."""
    regions: Sequence[str]
    """R names: the bands of distance, and the ground seen from above."""
    counts: Sums
    """``(S, R, 4)``: TP, TN, FP and FN."""


@dataclass(frozen=True, eq=False)
class FrameResult:
    """Everything about one replayed frame that is recorded or written to tables.

    ``tallies`` is empty if the frame is not evaluated, and ``doubts`` if it has truth.
    ``truth_bits`` is the truth of the counts. ``changes`` are from stage to stage and from final
    mask to final mask. ``contours``, and ``metres`` if the camera is known, measure final masks by
    variant. ``histograms`` count labelled pixels by their probability of road, for each variant and
    stage with one; ``above`` counts cells of the ground seen from above. ``oracles`` are the counts
    of later stages after one stage is replaced by the truth, by the name of the replaced stage.
    ``disturbed`` has the final masks of the disturbed frame, by the name of the disturbance, such
    as ``fog:2``. ``notes`` are sentences.
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
    disturbed: Mapping[str, FrameResult] = field(default_factory=dict)
    doubts: tuple[Doubt, ...] = ()
    metres: Mapping[str, FrameMetres] = field(default_factory=dict)
    above: Mapping[tuple[str, str], Histogram] = field(default_factory=dict)
    kitti: Mapping[tuple[str, str], Histogram] = field(default_factory=dict)
    """``(2, 256)`` cells for KITTI's road benchmark, by variant and category."""
    apart: Mapping[str, float] = field(default_factory=dict)
    """ERR by variant of a frame that was labelled because it was in doubt; no total counts it."""
    classes: Mapping[str, Sums] = field(default_factory=dict)
    """``(256, 3)`` by variant, a row for each code of `Frame.classes`: all its pixels, its pixels
    called road, and the missed road beside it. Empty if the truth has no classes."""

    def without_layers(self) -> FrameResult:
        """Return the result without layers, which take most memory."""
        variants = tuple(
            VariantResult(v.variant, tuple(stage.without_layers() for stage in v.stages))
            for v in self.variants
        )
        disturbed = {
            name: replace(result.without_layers(), frame=self.frame, errors={})
            for name, result in self.disturbed.items()
        }
        return replace(self, variants=variants, disturbed=disturbed)


AnyArray = npt.NDArray[Any]
"""An array of any shape and type."""


T = TypeVar("T")


def as_tree(items: Iterable[tuple[tuple[str, str], T]]) -> dict[str, dict[str, T]]:
    """Return items with two names, such as a variant's and a stage's, as a dict of dicts."""
    tree: dict[str, dict[str, T]] = {}
    for (outer, inner), item in items:
        tree.setdefault(outer, {})[inner] = item
    return tree

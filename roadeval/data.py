"""The facts that travel between the rooms: frozen, typed, and free of any library but NumPy.

Images are ``(H, W, 3)`` uint8 RGB, masks ``(H, W)`` uint8 with 1 for road (or shadow) and 0
otherwise, or `Packed`. Times are integer nanoseconds since the Unix epoch, or whatever epoch the
log uses.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Final

import numpy as np
import numpy.typing as npt

from roadeval.kernels.arrays import FN, FP, IGNORED, TN, TP, Bits
from roadeval.kernels.packing import Packed, pack

Rgb = npt.NDArray[np.uint8]
"""``(H, W, 3)`` uint8, channels red, green, blue."""
Mask = npt.NDArray[np.uint8]
"""``(H, W)`` uint8: 1 inside, 0 outside."""
Truth = npt.NDArray[np.uint8]
"""``(H, W)`` uint8: 0 non-road, 1 road, 255 ignore."""

NON_ROAD: Final = 0
ROAD: Final = 1
IGNORE: Final = 255

CAMERA: Final = "camera"
FILTERED: Final = "filtered"
UNFILTERED: Final = "unfiltered"
"""The names of the two variants that come by default: with the chain's filters, and without."""
BASELINE: Final = "blind"
"""The variant name of the baseline that never looks at the image."""
FINAL_STAGE: Final = "post"
"""The stage whose mask is the pipeline's answer, and under which the baseline is filed."""

RESERVED: Final = frozenset(
    {
        *("blind", "camera", "counts", "facts", "frame", "metrics", "notes", "results"),
        *("roadeval", "state", "timing", "true_shadow", "truth"),
    }
)
"""Names that no variant may bear: the tables or the recording use them for something else."""

NAMES: Final = (
    *("variant", "stage", "region", "oracle"),
    *("from_variant", "from_stage", "to_variant", "to_stage"),
)
"""Columns of the tables that hold names, which are text even where a variant is called ``007``."""


# --- Frames -------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One camera image with its times and, if the log has one, its truth.

    Parameters
    ----------
    number
        Position in the image topic by log time, from 0, before any range or stride.
    stamp_ns, log_time_ns
        Header stamp and log time.
    image
        ``(H, W, 3)`` uint8 RGB.
    payload
        The image as the log holds it (for a compressed image the JPEG or PNG file itself).
    media_type
        ``image/jpeg`` or ``image/png`` if ``payload`` is such a file, else None.
    truth
        ``(H, W)`` uint8 road truth (0, 1, 255), or None for an unlabelled frame.
    shadow_truth
        ``(H, W)`` uint8 (0, 1, 255) mask of truly shadowed pixels, or None.
    external
        Masks that the log itself carries (another system's output), by variant name.
    """

    number: int
    stamp_ns: int
    log_time_ns: int
    image: Rgb
    payload: bytes | memoryview
    media_type: str | None = None
    truth: Truth | None = None
    shadow_truth: Truth | None = None
    external: Mapping[str, Mask] = field(default_factory=dict)

    def digest(self) -> str:
        """Hash of the image as logged: equal for equal images, whatever log they lie in."""
        return hashlib.blake2b(self.payload, digest_size=16).hexdigest()


class Role(StrEnum):
    """What a frame is used for. Only `EVALUATED` frames are ever counted."""

    EVALUATED = "evaluated"
    TRAINING = "training"
    GAP = "gap"
    UNLABELLED = "unlabelled"


# --- Layers -------------------------------------------------------------------------------------


class LayerKind(StrEnum):
    """How a layer's array is to be read.

    `MASK`: one class or a few, told apart by their colours alone. `LABELS`: classes whose names a
    viewer is to show. `SCALAR`: a map of numbers. `RGB`: a colour image.
    """

    RGB = "rgb"
    MASK = "mask"
    LABELS = "labels"
    SCALAR = "scalar"


@dataclass(frozen=True, slots=True)
class LabelClass:
    """One value of a label image: its name and its sRGB colour with opacity (0..255 each)."""

    value: int
    name: str
    rgba: tuple[int, int, int, int]


@dataclass(frozen=True, slots=True)
class LayerSpec:
    """What a layer is, known before the first frame.

    Parameters
    ----------
    name
        Last part of the entity path, as ``ndi`` in ``/filtered/ndi``.
    kind
        How the array is to be read.
    title
        A few words for a person, as ``NDI (Eq. 6)``.
    classes
        For `LABELS` and `MASK`: the values that occur.
    value_range
        For `SCALAR`: the closed range of meaning; values outside are clipped for display.
    exact
        Whether the recording must give back the same array (masks, labels), or, for a scalar
        map, the nearest of 255 levels over ``value_range``. A layer that is not exact may be
        recorded lossily and at half resolution.
    """

    name: str
    kind: LayerKind
    title: str
    classes: tuple[LabelClass, ...] = ()
    value_range: tuple[float, float] = (0.0, 1.0)
    exact: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Layer:
    """A named array that a stage hands out; a mask of two classes may stay packed."""

    spec: LayerSpec
    content: npt.NDArray[np.uint8] | npt.NDArray[np.float32] | Packed

    @property
    def array(self) -> npt.NDArray[np.uint8] | npt.NDArray[np.float32]:
        """The array itself.

        ``(H, W, 3)`` uint8 for `RGB`, ``(H, W)`` uint8 for `MASK` and `LABELS`, and ``(H, W)``
        float32, or uint8 codes 0..255 that span ``spec.value_range``, for `SCALAR`.
        """
        return self.content.pixels() if isinstance(self.content, Packed) else self.content


TRANSPARENT: Final = (0, 0, 0, 0)
ROAD_CLASSES: Final = (
    LabelClass(0, "non-road", TRANSPARENT),
    LabelClass(1, "road", (0, 158, 115, 160)),
)
TRUTH: Final = LayerSpec(
    "truth",
    LayerKind.MASK,
    "Ground truth",
    (*ROAD_CLASSES, LabelClass(IGNORE, "ignored", (128, 128, 128, 160))),
)
ERRORS: Final = LayerSpec(
    "errors",
    LayerKind.MASK,
    "Errors of the final mask",
    (
        LabelClass(TN, "TN", TRANSPARENT),
        LabelClass(TP, "TP", (0, 158, 115, 160)),
        LabelClass(FP, "FP", (213, 94, 0, 220)),
        LabelClass(FN, "FN", (204, 121, 167, 220)),
        LabelClass(IGNORED, "ignored", (128, 128, 128, 160)),
    ),
)


def mask_spec(name: str, title: str) -> LayerSpec:
    """Describe a road mask (0 non-road, 1 road) named ``name``."""
    return LayerSpec(name, LayerKind.MASK, title, ROAD_CLASSES)


@dataclass(frozen=True, slots=True, eq=False)
class TruthBits:
    """A truth as `Bits`: ``shape`` (H, W), the ``road`` and the ``other`` (non-road) pixels."""

    shape: tuple[int, int]
    road: Bits
    other: Bits

    @classmethod
    def of(cls, truth: Truth) -> TruthBits:
        """Pack an ``(H, W)`` uint8 truth (0, 1, 255)."""
        height, width = truth.shape
        return cls((height, width), pack(truth == ROAD), pack(truth == NON_ROAD))

    @property
    def labelled(self) -> Bits:
        """The pixels that are not ignored."""
        return self.road | self.other

    def bits_of(self, masks: Iterable[Packed]) -> Bits:
        """Lay the bits of masks of the truth's shape one behind the other: ``(K, H, words)``.

        Raises
        ------
        ValueError
            If one has another shape.
        """
        bits = []
        for mask in masks:
            if mask.shape != self.shape:
                raise ValueError(f"shape {mask.shape} differs from the truth's {self.shape}")
            bits.append(mask.bits)
        return np.array(bits, np.uint64).reshape(len(bits), *self.road.shape)


# --- What a variant makes of a frame ------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class StageResult:
    """What one stage of one variant made of one frame.

    ``mask`` is the stage's road mask, packed, or None for a stage that only changes the image.
    ``regions`` are pixel sets worth counting apart, by name. ``facts`` are numbers about the
    frame (``components``, ``max_gain``); ``seconds`` is wall time.
    """

    stage: str
    layers: tuple[Layer, ...]
    mask: Packed | None
    regions: Mapping[str, Packed]
    facts: Mapping[str, float]
    seconds: float

    def without_layers(self) -> StageResult:
        """Give what is left to sum up once the pictures are encoded."""
        return StageResult(self.stage, (), self.mask, {}, self.facts, self.seconds)


@dataclass(frozen=True, slots=True, eq=False)
class VariantResult:
    """What one variant made of one frame, stage by stage in the order they ran.

    ``oracles`` holds, by the name of a stage that was replaced by the truth, the road masks of
    the stages after it by theirs. They are no results: see `roadeval.pipeline.chain.Chain`.
    """

    variant: str
    stages: tuple[StageResult, ...]
    oracles: Mapping[str, Mapping[str, Packed]] = field(default_factory=dict)

    def masks(self) -> Iterator[tuple[str, Packed]]:
        """Yield each stage that has a road mask, with the mask; `Packed.pixels` gives its array."""
        for result in self.stages:
            if result.mask is not None:
                yield result.stage, result.mask

    def layers(self) -> Iterator[Layer]:
        """Yield every layer of every stage, in order."""
        for result in self.stages:
            yield from result.layers

    def final(self) -> Mask:
        """Give the pixels of the last stage's mask, ``(H, W)`` uint8."""
        *_, (_, mask) = self.masks()
        return mask.pixels()


@dataclass(frozen=True, slots=True)
class VariantLayout:
    """A variant as known before the first frame: its stages with masks and its layers."""

    name: str
    title: str
    stages: tuple[str, ...]
    layers: tuple[LayerSpec, ...]


# --- Counts -------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Counts:
    """Pixels by outcome; road is the positive class, ignored pixels are in none (section 5)."""

    tp: int = 0
    tn: int = 0
    fp: int = 0
    fn: int = 0

    @property
    def n(self) -> int:
        """Road and non-road pixels of the truth, N in Eq. 24-25."""
        return self.tp + self.tn + self.fp + self.fn

    def __add__(self, other: Counts) -> Counts:
        return Counts(
            self.tp + other.tp, self.tn + other.tn, self.fp + other.fp, self.fn + other.fn
        )


@dataclass(frozen=True, slots=True)
class Tally:
    """The counts of one stage of one variant on one frame, whole and by region.

    ``rates`` are the fractions of Eq. 24-29 by name; an undefined one is NaN.
    """

    variant: str
    stage: str
    counts: Counts
    regions: Mapping[str, Counts] = field(default_factory=dict)
    rates: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Change:
    """What became of the pixels from one mask to another.

    ``repaired`` are newly right, ``spoiled`` newly wrong, of the ``labelled`` ones.
    """

    repaired: int = 0
    spoiled: int = 0
    labelled: int = 0

    def __add__(self, other: Change) -> Change:
        return Change(
            self.repaired + other.repaired,
            self.spoiled + other.spoiled,
            self.labelled + other.labelled,
        )


Step = tuple[str, str, str, str]
"""From one mask to another: variant and stage before, variant and stage after."""


class Health(StrEnum):
    """How a variant fared on a frame, for the recording's state lanes."""

    OK = "ok"
    DEGRADED = "degraded"
    FAILED = "failed"


class Pictures(StrEnum):
    """Which of a frame's pictures are recorded; its numbers always are."""

    ALL = "all"
    MASKS = "masks"
    NONE = "none"


@dataclass(frozen=True, slots=True, eq=False)
class FrameResult:
    """Everything known about one replayed frame: what is recorded and what is tabled.

    ``tallies`` is empty unless the frame is evaluated. ``tables`` holds this frame's finished
    lines of the tables that grow frame by frame (keys ``frames``, ``regions``, ``oracles``; no
    header). ``truth_bits`` is what the masks were held against. ``changes`` are from
    stage to stage and from final mask to final mask, ``contours`` the boundary F of each final
    mask by variant, and ``oracles`` the counts of what the stages made once one was replaced by
    the truth, by that one. ``notes`` are sentences for a person, ``pictures`` says what is
    recorded beside the numbers.
    """

    frame: Frame
    role: Role
    variants: tuple[VariantResult, ...]
    errors: Mapping[str, Layer] = field(default_factory=dict)
    tallies: tuple[Tally, ...] = ()
    health: Mapping[str, Health] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    tables: Mapping[str, str] = field(default_factory=dict)
    truth_bits: TruthBits | None = None
    changes: Mapping[Step, Change] = field(default_factory=dict)
    contours: Mapping[str, float] = field(default_factory=dict)
    oracles: Mapping[str, tuple[Tally, ...]] = field(default_factory=dict)
    pictures: Pictures = Pictures.ALL

    def without_layers(self) -> FrameResult:
        """Give what is left to sum up once the pictures, which take most memory, are encoded."""
        variants = tuple(
            VariantResult(v.variant, tuple(stage.without_layers() for stage in v.stages))
            for v in self.variants
        )
        return replace(self, variants=variants)

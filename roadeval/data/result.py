"""Results of a frame: what each variant's stages computed, and its score."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from roadeval.data.counts import Change, Step, Tally
from roadeval.data.frame import Frame, Mask, Role
from roadeval.data.layer import Layer, LayerSpec
from roadeval.data.packed import Packed, TruthBits


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
        """Return the result without layers, as it is summed up once they are encoded."""
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
        """Return the pixels of the last stage's mask, ``(H, W)`` uint8."""
        *_, (_, mask) = self.masks()
        return mask.pixels()


@dataclass(frozen=True, slots=True)
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


class Pictures(StrEnum):
    """Which of a frame's pictures are recorded; its numbers always are."""

    ALL = "all"
    MASKS = "masks"
    NONE = "none"


@dataclass(frozen=True, slots=True, eq=False)
class FrameResult:
    """Everything known about one replayed frame: what is recorded and what is tabled.

    ``tallies`` is empty unless the frame is evaluated. ``truth_bits`` is what the masks were held
    against. ``changes`` are from stage to stage and from final mask to final mask, ``contours``
    the boundary F of each final mask by variant, and ``oracles`` the counts of what the stages
    made once one was replaced by the truth, by that one. ``notes`` are sentences for a person,
    ``pictures`` says what is recorded beside the numbers.
    """

    frame: Frame
    role: Role
    variants: tuple[VariantResult, ...]
    errors: Mapping[str, Layer] = field(default_factory=dict)
    tallies: tuple[Tally, ...] = ()
    health: Mapping[str, Health] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    truth_bits: TruthBits | None = None
    changes: Mapping[Step, Change] = field(default_factory=dict)
    contours: Mapping[str, float] = field(default_factory=dict)
    oracles: Mapping[str, tuple[Tally, ...]] = field(default_factory=dict)
    pictures: Pictures = Pictures.ALL

    def without_layers(self) -> FrameResult:
        """Return the result without layers, which take most memory, for summing up."""
        variants = tuple(
            VariantResult(v.variant, tuple(stage.without_layers() for stage in v.stages))
            for v in self.variants
        )
        return replace(self, variants=variants)

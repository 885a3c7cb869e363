"""Every choice of the training, with its reason."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, Final, Literal, Self

from pydantic import ConfigDict, Field, model_validator
from pydantic.dataclasses import dataclass as validated

from roadeval.pipeline.reference_patch import ReferencePatch

GREATEST_SEED: Final = 1_000_000_000


@validated(frozen=True, config=ConfigDict(extra="forbid"))
class TrainingSettings:
    """Which frames and pixels train a model that is not read from a file."""

    model: str | None = None
    """A model file, made from other drives: then nothing is trained here. None: the log itself
    trains one."""
    adapt: bool = False
    """Learn further from the log's own frames, on top of what ``model`` has learnt from other
    drives. The result is then not one on a drive that the model has not seen. By the reference
    patch alone only where ``source`` insists on it: it may make the model worse."""
    source: Literal["auto", "truth", "patch"] = "auto"
    """``auto``: the log's truth where it has one, else the reference patch; ``truth`` or ``patch``
    insists."""
    frames: Annotated[int, Field(ge=1, le=1000)] = 10
    """So many labelled frames of the range (all frames count for ``patch``). They are held decoded,
    which bounds the number of large ones below the one allowed here."""
    placement: Literal["first", "spread"] = "first"
    """``first``: the first ones; ``spread``: at equal distances along the range, so that they show
    all its light and places. The result then says how the method fares on a drive that was
    labelled here and there, not on what comes after it."""
    gap: Annotated[int, Field(ge=0, le=1_000_000_000)] | None = None
    """Frames beside them that are not evaluated either: the neighbours of a training frame look
    like it, and flatter the result. After the ``first`` ones, none by default; on both sides of
    each that is ``spread``, by default a quarter of the distance between them."""
    pixels_per_class: Annotated[int, Field(ge=1, le=1_000_000_000)] = 200
    """Road pixels, and non-road pixels, drawn from each training frame."""
    max_pixels: Annotated[int, Field(ge=2, le=100_000)] = 8000
    """Upper bound over all frames and both classes: the SVM's training time grows with its square.
    """
    seed: Annotated[int, Field(ge=0, le=GREATEST_SEED)] = 0
    """Of the draw."""
    seeds: Annotated[int, Field(ge=1, le=100)] = 1
    """How often a replay trains: with ``seed`` and the numbers after it. Recording and tables are
    the first one's; the others tell how far each rate depends on the draw. It is not the one
    with the middle rate: which that is differs from rate to rate, and a result that was chosen
    by its numbers is no longer the result of a rule that was fixed before."""
    patch: ReferencePatch = ReferencePatch()
    """Self-supervision: the trapezoid in front of the vehicle that is taken for road."""
    horizon: Annotated[float, Field(ge=0, le=1)] = 0.4
    """Self-supervision: pixels above this share of the height are not road."""
    far: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 1.0
    """Self-supervision: pixels below the horizon whose distance from the patch is less than this
    are road, the others are not; see `roadeval.pipeline.beyond.features`. Most roads end at
    1."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.adapt and self.model is None:
            raise ValueError("`training.adapt` needs `training.model`, which it builds on")
        if self.model is not None and self.seeds > 1:
            raise ValueError(
                "`training.seeds` trains several times, and `training.model` is trained already"
            )
        if self.seed + self.seeds - 1 > GREATEST_SEED:
            raise ValueError(f"`training.seeds`: no seed may be above {GREATEST_SEED}")
        return self

    def by_seed(self) -> Iterator[TrainingSettings]:
        """Yield the settings of each training, in the order of their seeds."""
        for seed in range(self.seed, self.seed + self.seeds):
            yield replace(self, seed=seed, seeds=1)

"""Settings of the training."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from annotated_types import Interval

from roadeval.errors import SettingError
from roadeval.pipeline.reference_patch import ReferencePatch, Share
from roadeval.runtime.sentence import Sentence
from roadeval.runtime.settings import Flag


@dataclass(frozen=True)
class TrainingSettings:
    """Which frames and pixels train a model that is not read from a file.

    model: A model made by 'roadeval train' from other drives. Default: the log itself trains one.
    adapt: Let the model learn further from the drive's first frames, which are then not evaluated.
        The result then says nothing about drives that the model has not seen. The reference patch
        alone is used only if ``source`` is ``patch``: it may make the model worse.
    source: ``auto``: the log's truth if it has one, else the reference patch; ``truth``: only the
        truth; ``patch``: only the patch.
    frames: Labelled frames to train on, which are never evaluated; for ``patch`` any frames. They
        stay in memory.
    placement: The ``first`` labelled frames, or some ``spread`` along the drive at equal distances.
        These show all its light and places: the result then holds for a drive with labels here and
        there, not for frames after the labelled ones.
    gap: Number of frames to leave out after the training frames, or on both sides if ``spread``.
        Frames next to a training frame look like it, and make the result too good. Default: 0; if
        ``spread``, a quarter of their distance.
    pixels_per_class: Road pixels, and non-road pixels, drawn from each training frame.
    max_pixels: Greatest number of pixels of all frames and classes together: the SVM's training
        time grows with its square.
    seed: Seed of the random choice of pixels. Another seed gives other rates.
    patch: Self-supervision: the trapezoid in front of the vehicle that counts as road.
    horizon: Self-supervision: pixels above this share of the height are not road.
    far: Self-supervision: pixels below the horizon and nearer to the patch than this are road, all
        others are not; see `roadeval.pipeline.scene.reach`. Most roads end at 1.
    """

    model: Annotated[str | None, Flag("--model", "FILE")] = None
    adapt: Annotated[bool, Flag("--adapt")] = False
    source: Literal["auto", "truth", "patch"] = "auto"
    frames: Annotated[int, Interval(ge=0, le=1000), Flag("--train-frames", "N")] = 10
    placement: Annotated[Literal["first", "spread"], Flag("--train-on", "WHERE")] = "first"
    gap: Annotated[int | None, Interval(ge=0, le=1_000_000_000), Flag("--train-gap", "N")] = None
    pixels_per_class: Annotated[int, Interval(ge=1, le=1_000_000_000)] = 200
    max_pixels: Annotated[int, Interval(ge=2, le=100_000)] = 8000
    seed: Annotated[int, Interval(ge=0, le=1_000_000_000)] = 0
    patch: ReferencePatch = field(default_factory=ReferencePatch)
    horizon: Share = 0.4
    far: Annotated[float, Interval(gt=0, le=1_000_000)] = 1.0

    def __post_init__(self) -> None:
        if self.adapt and self.model is None:
            needs = Sentence("needs {model}, which it builds on")
            raise SettingError(needs, setting="adapt")

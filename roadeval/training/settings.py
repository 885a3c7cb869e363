"""Every choice of the training, with its reason."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass as validated

from roadeval.pipeline.reference_patch import ReferencePatch


@validated(frozen=True, config=ConfigDict(extra="forbid"))
class TrainingSettings:
    """Which frames and pixels train a model that is not read from a file.

    Parameters
    ----------
    model
        A model file, made from other drives: then nothing is trained here. None: the log itself
        trains one.
    source
        ``auto``: the log's truth where it has one, else the reference patch; ``truth`` or
        ``patch`` insists.
    frames
        The first so many labelled frames of the range (all frames count for ``patch``). They are
        held decoded, which bounds the number of large ones below the one allowed here.
    gap
        Frames after them that are not evaluated either: the neighbours of a training frame
        look like it, and flatter the result.
    pixels_per_class
        Road pixels, and non-road pixels, drawn from each training frame.
    max_pixels
        Upper bound over all frames and both classes: the SVM's training time grows with its
        square.
    seed
        Of the draw.
    patch
        Self-supervision: the trapezoid in front of the vehicle that is taken for road.
    horizon
        Self-supervision: pixels above this share of the height are not road.
    far
        Self-supervision: below the horizon, pixels whose colour is further from the patch's
        than this quantile of its own colours (chi-squared, 3 degrees of freedom) are not road.
        The rest stays undecided.
    """

    model: str | None = None
    source: Literal["auto", "truth", "patch"] = "auto"
    frames: Annotated[int, Field(ge=1, le=1000)] = 10
    gap: Annotated[int, Field(ge=0, le=1_000_000_000)] = 0
    pixels_per_class: Annotated[int, Field(ge=1, le=1_000_000_000)] = 200
    max_pixels: Annotated[int, Field(ge=2, le=100_000)] = 8000
    seed: Annotated[int, Field(ge=0, le=1_000_000_000)] = 0
    patch: ReferencePatch = ReferencePatch()
    horizon: Annotated[float, Field(ge=0, le=1)] = 0.4
    far: Annotated[float, Field(gt=0, lt=1)] = 0.9999

"""Small frames, masks and results to score."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from roadeval.data import Counts, Frame, Mask, StageResult, Tally, Truth, VariantResult
from roadeval.evaluation import rates


def pixels(*rows: str) -> npt.NDArray[np.uint8]:
    """Read an image from text: ``#`` is 1, ``.`` is 0, ``?`` is ignored."""
    values = {"#": 1, ".": 0, "?": 255}
    return np.array([[values[char] for char in row] for row in rows], np.uint8)


def a_frame(truth: Truth | None, number: int = 0, shadow: Truth | None = None) -> Frame:
    """A black frame with the given truth, at 10 Hz."""
    shape = (2, 2) if truth is None else truth.shape
    image = np.zeros((*shape, 3), np.uint8)
    return Frame(number, 10**8 * number, 10**8 * number + 7, image, b"", None, truth, shadow)


def a_variant(
    name: str, masks: Mapping[str, Mask], regions: Mapping[str, Mask] | None = None
) -> VariantResult:
    """A variant with a mask a stage; its first stage found the regions."""
    stages = [
        StageResult(stage, (), mask, regions or {} if place == 0 else {}, {}, 0.002)
        for place, (stage, mask) in enumerate(masks.items())
    ]
    return VariantResult(name, tuple(stages))


def a_tally(tp: int, tn: int, fp: int, fn: int, variant: str = "filtered") -> Tally:
    """A tally of the final mask with these counts."""
    counts = Counts(tp, tn, fp, fn)
    return Tally(variant, "post", counts, {}, rates.of(counts))

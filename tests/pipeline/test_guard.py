"""Outputs that a stage from outside may return, and those that cost its frame."""

import numpy as np
import pytest

from roadeval.data import LabelClass, Layer, LayerKind, LayerSpec, Output, Packed, mask_spec
from roadeval.pipeline.stage import Stage, StageError, View
from roadeval.pipeline.stages import guard

CLASSES = tuple(LabelClass(i, str(i), (i, 0, 0, 255)) for i in range(3))
MASK = mask_spec("mask", "Mask")
LABELS = LayerSpec("labels", LayerKind.LABELS, "Labels", CLASSES)
RGB = LayerSpec("rgb", LayerKind.RGB, "Colours")
IMAGE = np.zeros((4, 6, 3), np.uint8)


def run(spec, array):
    def bind(_settings, _parameters):
        road = Packed.of(IMAGE[..., 0])
        return lambda view: Output((Layer(spec, array),), mask=road)

    stage = Stage("own", "Own", int, bind, (spec,))
    return guard(stage).bind(0, None)(View.of(IMAGE))


@pytest.mark.parametrize("held", [bool, np.int64])
def test_a_mask_may_hold_any_whole_numbers(held):
    run(MASK, IMAGE[..., 0].astype(held))


@pytest.mark.parametrize(
    ("spec", "held"),
    [(MASK, np.float32), (LABELS, np.int64), (LABELS, bool), (RGB, np.float32), (RGB, np.uint16)],
)
def test_a_layer_that_cannot_be_recorded_is_named(spec, held):
    array = (IMAGE if spec is RGB else IMAGE[..., 0]).astype(held)
    with pytest.raises(StageError, match=f"its layer '{spec.name}' is {np.dtype(held)}"):
        run(spec, array)


def test_a_layer_of_another_size_is_named():
    message = r"its layer 'mask' is uint8 \(3, 6\): it must be bool or integer \(4, 6\)"
    with pytest.raises(StageError, match=message):
        run(MASK, IMAGE[:3, :, 0])

"""Stages from outside the package: imported by their names, and guarded in what they hand out."""

from dataclasses import replace

import numpy as np
import pytest

from roadeval.config.run import configure
from roadeval.config.tables import ConfigError
from roadeval.data import (
    LabelClass,
    Layer,
    LayerKind,
    LayerSpec,
    Moment,
    Output,
    Packed,
    mask_spec,
    ones,
)
from roadeval.pipeline.stage import Stage, StageError, View
from roadeval.pipeline.stages import UnknownStageError, guard, stages_of
from tests.pipeline.images import noise
from tests.pipeline.making import default

IMAGE = noise(8, 6)


def somebodys(name: str) -> str:
    return f"tests.pipeline.somebody:{name}"


def output_of(name, moment=None, **settings):
    (stage,) = stages_of([somebodys(name)])
    return stage.bind(stage.settings(**settings), None)(View.of(IMAGE, moment))


@pytest.mark.parametrize("name", ["lower_half", "an_object"])
def test_a_function_is_a_stage(name):
    mask = output_of(name).mask.pixels()
    assert mask.tolist() == [[0] * 6] * 4 + [[1] * 6] * 4


def test_a_functions_settings_are_those_of_its_default():
    assert ones(output_of("below").mask.bits) == 6 * 6
    assert ones(output_of("below", top=0.5).mask.bits) == 4 * 6


def test_floats_are_probabilities():
    output = output_of("gradual")
    assert output.probability[:, 0].tolist() == [round(65535 * row / 7) for row in range(8)]
    assert np.array_equal(output.mask.pixels(), output.probability > 32768)


def test_probabilities_may_have_half_precision():
    half, full = output_of("gradual_in_half_precision"), output_of("gradual")
    assert np.abs(half.probability.astype(int) - full.probability).max() <= 65535 / 2**11
    assert np.array_equal(half.mask.pixels(), full.mask.pixels())


def test_what_a_method_writes_into_its_image_no_other_method_sees():
    image = IMAGE.copy()
    (function,) = stages_of([somebodys("writes_into_the_image")])
    function.bind(function.settings(), None)(View.of(image))
    (stage,) = stages_of([somebodys("WRITES")])
    with pytest.raises(StageError, match=r"writes failed: ValueError: .*read-only"):
        stage.bind(stage.settings(), None)(View.of(image))
    assert np.array_equal(image, IMAGE)


def test_a_function_can_ask_for_the_moment():
    assert ones(output_of("fails_on_13", Moment(12, 0)).mask.bits) == 24
    with pytest.raises(StageError, match="stage fails_on_13 failed: ZeroDivisionError: no road"):
        output_of("fails_on_13", Moment(13, 0))


def test_an_error_names_the_stage_and_keeps_its_cause():
    with pytest.raises(StageError, match="stage always_fails failed: KeyError") as caught:
        output_of("always_fails")
    assert isinstance(caught.value.__cause__, KeyError)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("wrong_size", r"its mask is \(2, 2\)"),
        ("leaves", r"leaves failed: SystemExit: 0 \(somebody.py:"),
        ("levels_of_grey", "not a mask of 0 and one other level"),
        ("minus_one_elsewhere", "not a mask of 0 and one other level"),
        ("LAYERS", "a layer 'level' that its stage does not"),
    ],
)
def test_an_output_that_cannot_be_is_an_error(name, message):
    with pytest.raises(StageError, match=message):
        output_of(name)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (somebodys("nothing"), "has no attribute 'nothing'"),
        (somebodys("wrong_argument"), "its argument frame is none of image, moment, settings"),
        (somebodys("Callable"), "neither a Stage nor a function"),
        (somebodys("TAKEN"), "'svm' is that of a stage of roadeval"),
        (somebodys("UNNAMEABLE"), "must be of letters, digits"),
        ("tests.pipeline.ending:road", "cannot be used: SystemExit: 0"),
        ("no_such_module:road", "there is no module no_such_module: install it"),
        ("pickle:loads", "its argument data is none of image"),
        ("blur", "there is no stage 'blur'; choose"),
        (":", "there is no stage ':'; choose"),
    ],
)
def test_what_is_no_stage_is_named_with_the_reason(name, message):
    with pytest.raises(UnknownStageError, match=message):
        stages_of([name])
    with pytest.raises(ConfigError, match=message):
        configure({"chain": [name, "post"]})


def test_its_settings_stand_in_a_table_of_its_own_name():
    config = configure({"chain": [somebodys("below"), "post"], "below": {"top": 0.75}})
    assert config.pipeline.settings["below"].top == 0.75
    assert configure(config.as_dict()) == config
    with pytest.raises(ConfigError, match=r"`below\.tip`: there is no such setting; choose top"):
        configure({"chain": [somebodys("below"), "post"], "below": {"tip": 1}})
    with pytest.raises(ConfigError, match=r"`below\.top`: must be a number"):
        configure({"chain": [somebodys("below"), "post"], "below": {"top": "high"}})


def test_a_pipeline_keeps_the_names_of_its_chain():
    pipeline = default("shadow", somebodys("lower_half"), "post")
    assert pipeline.without_filter().chain == (somebodys("lower_half"), "post")
    assert pipeline.masks() == ("lower_half", "post")


# --- What a stage sees: the image and its channels, which stages share until a filter changes it --

MASK = Packed.of(np.zeros((6, 8), np.uint8))


def test_after_an_image_the_channels_are_its_own():
    image, filtered = noise(6, 8), 255 - noise(6, 8)
    view = View.of(image).after(Output(mask=MASK))
    before = view.planes
    later = view.after(Output(image=filtered))
    assert later.planes is not before
    np.testing.assert_array_equal(np.dstack(later.planes), filtered)
    np.testing.assert_array_equal(np.dstack(view.planes), image)
    assert later.original is image
    assert later.mask is MASK


CLASSES = tuple(LabelClass(i, str(i), (i, 0, 0, 255)) for i in range(3))
SPEC = mask_spec("mask", "Mask")
LABELS = LayerSpec("labels", LayerKind.LABELS, "Labels", CLASSES)
RGB = LayerSpec("rgb", LayerKind.RGB, "Colours")
BLACK = np.zeros((4, 6, 3), np.uint8)


def run(spec, array):
    def bind(_settings, _parameters):
        road = Packed.of(BLACK[..., 0])
        return lambda view: Output((Layer(spec, array),), mask=road)

    stage = Stage("own", "Own", int, bind, (spec,))
    return guard(stage).bind(0, None)(View.of(BLACK))


@pytest.mark.parametrize("hook", ["bind", "fit", "adapt", "oracle"])
def test_an_error_of_any_function_of_a_stage_names_the_stage(hook):
    def fail(*_):
        raise KeyError("no road")

    stage = replace(Stage("own", "Own", int, lambda *_: None, (SPEC,)), **{hook: fail})
    with pytest.raises(StageError, match=r"stage own .*: KeyError: 'no road' \(test_stages.py:"):
        getattr(guard(stage), hook)(None, None)


@pytest.mark.parametrize("held", [bool, np.int64])
def test_a_mask_may_hold_any_whole_numbers(held):
    run(SPEC, BLACK[..., 0].astype(held))


@pytest.mark.parametrize(
    ("spec", "held"),
    [(SPEC, np.float32), (LABELS, np.int64), (LABELS, bool), (RGB, np.float32), (RGB, np.uint16)],
)
def test_a_layer_that_cannot_be_recorded_is_named(spec, held):
    array = (BLACK if spec is RGB else BLACK[..., 0]).astype(held)
    with pytest.raises(StageError, match=f"its layer '{spec.name}' is {np.dtype(held)}"):
        run(spec, array)


def test_a_layer_of_another_size_is_named():
    message = r"its layer 'mask' is uint8 \(3, 6\): it must be bool or integer \(4, 6\)"
    with pytest.raises(StageError, match=message):
        run(SPEC, BLACK[:3, :, 0])

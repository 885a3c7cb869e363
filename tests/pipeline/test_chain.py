"""Stages in a row: what each sees, and what is made of an image where one is the truth."""

import dataclasses
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from roadeval.data import Packed
from roadeval.pipeline.chain import Pipeline
from roadeval.pipeline.paper import shadow
from roadeval.pipeline.reference_patch import ReferencePatch, patch_mask
from roadeval.pipeline.stage import Output, View
from roadeval.pipeline.stages import STAGES
from tests.pipeline.images import IMAGES, noise
from tests.pipeline.images import mask as drawn_mask
from tests.pipeline.making import NAMES, SETTINGS, chain_of, default


@pytest.fixture(scope="module", params=SETTINGS.values(), ids=SETTINGS)
def chains(request):
    """The chain with the filter and without, as each preset has it."""
    return [chain_of(names, request.param) for names in (NAMES, NAMES[1:])]


def arrays(chain, image):
    outputs = [result.output for result in chain.run(View.of(image))]
    layers = [(layer.spec.name, layer.array) for o in outputs for layer in o.layers]
    regions = [(name, mask.pixels()) for o in outputs for name, mask in o.regions.items()]
    return layers + regions


def assert_same(a, b):
    assert [name for name, _ in a] == [name for name, _ in b]
    for (name, x), (_, y) in zip(a, b, strict=True):
        np.testing.assert_array_equal(x, y, err_msg=name)


def test_stages_after_the_filter_see_what_it_made(chains):
    image = noise(30, 40)
    filtered, unfiltered = chains
    compensated = filtered.steps[0].run(View.of(image)).image
    assert (compensated != image).any()
    after = [entry for entry in arrays(filtered, image) if entry[0] in NAMES[1:]]
    alone = [entry for entry in arrays(unfiltered, compensated) if entry[0] in NAMES[1:]]
    assert_same(after, alone)


def test_layers_are_the_ones_announced_in_shape_and_type(chains):
    image = noise(30, 40)
    for names, chain in zip((NAMES, NAMES[1:]), chains, strict=True):
        settings = {step.stage.name: step.settings for step in chain.steps}
        layers = [layer for result in chain.run(View.of(image)) for layer in result.output.layers]
        assert tuple(layer.spec for layer in layers) == Pipeline(names, settings).layers()
        for layer in layers:
            assert layer.array.shape[:2] == image.shape[:2]
            dtype = np.float32 if layer.spec.name == "distance" else np.uint8
            assert layer.array.dtype == dtype, layer.spec.name
            if layer.spec.classes:
                assert set(np.unique(layer.array)) <= {c.value for c in layer.spec.classes}


def test_a_stages_mask_is_the_layer_of_its_name(chains):
    for result in chains[0].run(View.of(noise(30, 40))):
        if (mask := result.output.mask) is not None:
            layers = {layer.spec.name: layer.array for layer in result.output.layers}
            np.testing.assert_array_equal(layers[result.stage], mask.pixels())


@pytest.mark.parametrize("image", IMAGES.values(), ids=IMAGES)
def test_odd_images_pass_every_stage_and_stay_as_they_were(chains, image):
    before = image.copy()
    for chain in chains:
        for _, array in arrays(chain, image):
            assert np.isfinite(array).all()
    np.testing.assert_array_equal(image, before)


def test_read_only_and_strided_images_give_the_same(chains):
    image = noise(31, 47)
    frozen = np.frombuffer(image.tobytes(), np.uint8).reshape(image.shape)
    backwards = np.ascontiguousarray(image[..., ::-1])[..., ::-1]
    assert not backwards.flags.c_contiguous
    for chain in chains:
        expected = arrays(chain, image)
        assert_same(arrays(chain, frozen), expected)
        assert_same(arrays(chain, backwards), expected)


def test_four_threads_give_the_same(chains):
    image = noise(120, 160)
    for chain in chains:
        expected = arrays(chain, image)
        with ThreadPoolExecutor(4) as pool:
            for result in pool.map(lambda _, c=chain: arrays(c, image), range(8)):
                assert_same(result, expected)


def test_what_was_handed_out_is_not_changed_by_the_next_image(chains):
    first, second = noise(30, 40, seed=1), noise(30, 40, seed=2)
    for chain in chains:
        handed_out = arrays(chain, first)
        copies = [(name, array.copy()) for name, array in handed_out]
        arrays(chain, second)
        assert_same(handed_out, copies)


# --- Pipelines ------------------------------------------------------------------------------------


def test_without_its_filters_a_pipeline_keeps_the_other_settings():
    pipeline = default("exposure", *NAMES)
    bare = pipeline.without_filter()
    assert bare.chain == ("exposure", "similarity", "svm", "post")
    assert bare.settings == {name: pipeline.settings[name] for name in bare.chain}


def test_what_is_learnt_depends_on_filters_and_on_stages_that_learn():
    pipeline = default(*NAMES)
    assert pipeline.learning_stages() == ("similarity", "svm")
    assert list(pipeline.relevant_settings()) == ["shadow", "similarity", "svm"]


def test_what_is_learnt_does_not_depend_on_settings_of_inference_only(monkeypatch):
    another = dataclasses.replace(STAGES["svm"], name="another", inference_only=("gamma", "c"))
    monkeypatch.setitem(STAGES, "another", another)
    relevant = default("another", "post").relevant_settings()
    assert relevant.keys() == {"another"}
    assert relevant["another"].keys() == {"kernel", "threshold"}


@pytest.mark.parametrize("stage", STAGES.values(), ids=STAGES)
def test_settings_of_inference_only_are_those_of_a_stage_that_learns(stage):
    settings = {entry.name for entry in dataclasses.fields(stage.settings)}
    assert settings >= set(stage.inference_only)
    assert stage.fit is not None or not stage.inference_only


IMAGE = noise(40, 60)
SEEN = View.of(IMAGE)
ROAD = np.zeros((40, 60), np.uint8)
ROAD[20:, 10:50] = 1
ROAD[:, 40:45] = 255
TRULY_DARK = np.zeros((40, 60), np.uint8)
TRULY_DARK[25:35, 20:30] = 1
TRULY_DARK[:, 58:] = 255


@pytest.fixture(scope="module", params=SETTINGS.values(), ids=SETTINGS)
def chain(request):
    return chain_of(NAMES, request.param)


def assert_mask(found, expected, name=""):
    np.testing.assert_array_equal(found.pixels(), expected.pixels(), err_msg=name)


def oracles(chain, shadow_truth=TRULY_DARK):
    outputs = [result.output for result in chain.run(SEEN)]
    return dict(chain.oracles(SEEN, outputs, ROAD, shadow_truth))


def masks(steps_of, image):
    return {
        result.stage: result.output.mask
        for result in steps_of.run(View.of(image))
        if result.output.mask is not None
    }


def test_a_perfect_svm_is_the_truth_with_ignored_pixels_as_non_road_given_to_post(chain):
    truth = Packed.of(ROAD == 1)
    post = chain.steps[-1]
    expected = STAGES["post"].bind(post.settings, None)
    replaced = oracles(chain)["svm"]
    assert list(replaced) == ["post"]
    assert_mask(replaced["post"], expected(SEEN.after(Output(mask=truth))).mask)


def test_a_perfect_filter_compensates_true_shadow_and_all_stages_follow(chain):
    settings = chain.steps[0].settings
    image, _ = shadow.lift(View.of(IMAGE), Packed.of(TRULY_DARK == 1), settings)
    assert (image != IMAGE).any()
    settings = {step.stage.name: step.settings for step in chain.steps}
    after = chain_of(NAMES[1:], settings)
    replaced = oracles(chain)["shadow"]
    assert list(replaced) == ["similarity", "svm", "post"]
    for name, mask in masks(after, image).items():
        assert_mask(replaced[name], mask, name)


def test_the_replaced_stage_sees_the_image_that_those_before_it_made(chain):
    names = ("exposure", *NAMES)
    settings = {step.stage.name: step.settings for step in chain.steps}
    settings["exposure"] = STAGES["exposure"].settings()
    longer = chain_of(names, settings)
    outputs = [result.output for result in longer.run(SEEN)]
    assert outputs[0].image is not None
    assert (outputs[0].image != IMAGE).any()
    replaced = dict(longer.oracles(SEEN, outputs, ROAD, outputs[1].regions["shadow"].pixels()))
    for name, mask in masks(longer, IMAGE).items():
        assert_mask(replaced["shadow"][name], mask, name)


def test_a_perfect_filter_leaves_a_frame_without_shadow_as_it_is(chain):
    settings = {step.stage.name: step.settings for step in chain.steps}
    replaced = oracles(chain, np.zeros_like(TRULY_DARK))["shadow"]
    expected = masks(chain_of(NAMES[1:], settings), IMAGE)
    assert list(replaced) == list(expected)
    for name, mask in expected.items():
        assert_mask(replaced[name], mask, name)


shares = st.floats(0, 1)
rows = st.tuples(shares, shares).filter(lambda pair: pair[0] < pair[1])
patches = st.builds(lambda pair, *widths: ReferencePatch(*pair, *widths), rows, shares, shares)


def test_a_patch_by_hand():
    patch = ReferencePatch(top=0.5, bottom=1.0, top_width=0.25, bottom_width=0.75)
    drawn = patch_mask(5, 8, patch)
    assert (drawn == drawn_mask("........", "........", "...##...", "..####..", ".######.")).all()


@given(st.tuples(st.integers(1, 40), st.integers(1, 60)), patches)
def test_a_patch_is_symmetric_never_empty_and_as_wide_as_stated(shape, patch):
    height, width = shape
    drawn = patch_mask(height, width, patch)
    np.testing.assert_array_equal(drawn, drawn[:, ::-1])
    rows = np.flatnonzero(drawn.any(axis=1))
    assert rows[0] == round(patch.top * (height - 1))
    assert rows[-1] == round(patch.bottom * (height - 1))
    assert (np.diff(rows) == 1).all()
    assert abs(drawn[rows[0]].sum() - patch.top_width * width) <= 2
    if len(rows) > 1:
        assert abs(drawn[rows[-1]].sum() - patch.bottom_width * width) <= 2


def test_an_upside_down_patch_is_refused():
    with pytest.raises(ValueError, match="top must lie above bottom"):
        ReferencePatch(top=0.9, bottom=0.5)

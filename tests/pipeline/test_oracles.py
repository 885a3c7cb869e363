"""Masks of a chain with one of its stages replaced by the truth."""

import numpy as np
import pytest

from roadeval.data import Packed
from roadeval.pipeline.paper import shadow
from roadeval.pipeline.stage import Output, View
from roadeval.pipeline.stages import STAGES
from tests.pipeline.images import noise
from tests.pipeline.making import NAMES, SETTINGS, chain_of

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


def assert_same(mask, expected, name=""):
    np.testing.assert_array_equal(mask.pixels(), expected.pixels(), err_msg=name)


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
    assert_same(replaced["post"], expected(SEEN.after(Output(mask=truth))).mask)


def test_a_perfect_filter_compensates_true_shadow_and_all_stages_follow(chain):
    settings = chain.steps[0].settings
    image, _ = shadow.lift(View.of(IMAGE), Packed.of(TRULY_DARK == 1), settings)
    assert (image != IMAGE).any()
    settings = {step.stage.name: step.settings for step in chain.steps}
    after = chain_of(NAMES[1:], settings)
    replaced = oracles(chain)["shadow"]
    assert list(replaced) == ["similarity", "svm", "post"]
    for name, mask in masks(after, image).items():
        assert_same(replaced[name], mask, name)


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
        assert_same(replaced["shadow"][name], mask, name)


def test_a_perfect_filter_leaves_a_frame_without_shadow_as_it_is(chain):
    settings = {step.stage.name: step.settings for step in chain.steps}
    replaced = oracles(chain, np.zeros_like(TRULY_DARK))["shadow"]
    expected = masks(chain_of(NAMES[1:], settings), IMAGE)
    assert list(replaced) == list(expected)
    for name, mask in expected.items():
        assert_same(replaced[name], mask, name)

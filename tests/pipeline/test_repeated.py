"""A chain that takes over what another of the same stages has computed."""

import numpy as np
import pytest

from roadeval.pipeline.chain import Chain, Pipeline
from roadeval.pipeline.stage import View
from tests.pipeline.images import noise
from tests.pipeline.making import NAMES, SETTINGS, chain_of

SEEN = View.of(noise(40, 60))


def of(*names: str) -> Chain:
    return chain_of(names, {name: SETTINGS["paper"][name] for name in names})


def never(view):
    pytest.fail("it ran again")


def test_the_masks_are_those_of_the_chain_itself():
    chain = of(*NAMES)
    results = list(chain.run(SEEN))
    masks = dict(chain.repeated(SEEN, [output for _, output in results]))
    assert list(masks) == ["similarity", "svm", "post"]
    for name, output in results:
        if output.mask is not None:
            np.testing.assert_array_equal(masks[name].pixels(), output.mask.pixels())


def test_a_filter_that_learns_nothing_does_not_run_again():
    chain = of(*NAMES)
    outputs = [output for _, output in chain.run(SEEN)]
    filter_, *rest = chain.steps
    blocked = Chain((type(filter_)(filter_.stage, filter_.settings, never), *rest))
    assert list(dict(blocked.repeated(SEEN, outputs))) == ["similarity", "svm", "post"]


def test_other_parameters_give_their_own_masks():
    chain, other = of(*NAMES), chain_of(NAMES, SETTINGS["paper"] | {"svm": wide()})
    outputs = [output for _, output in chain.run(SEEN)]
    expected = {name: output.mask for name, output in other.run(SEEN)}
    masks = dict(other.repeated(SEEN, outputs))
    np.testing.assert_array_equal(masks["svm"].pixels(), expected["svm"].pixels())
    assert (masks["svm"].pixels() != outputs[2].mask.pixels()).any()


def wide():
    return type(SETTINGS["paper"]["svm"])(gamma=0.01, c=0.1)


def test_a_chain_that_learns_nothing_has_nothing_to_repeat():
    chain = Pipeline.default(["shadow"]).bind({})
    outputs = [output for _, output in chain.run(SEEN)]
    assert dict(chain.repeated(SEEN, outputs)) == {}

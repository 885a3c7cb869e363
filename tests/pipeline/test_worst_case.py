"""Noise that makes tens of thousands of components costs no more a pixel than a small image."""

from time import thread_time
from typing import Final

import numpy as np
import pytest

from roadeval.pipeline.paper import post
from roadeval.pipeline.paper.shadow import connected_components
from roadeval.pipeline.stage import Output, View
from roadeval.runtime.threads import one_thread_each
from tests.pipeline.making import default

SMALL, LARGE = (180, 320), (1440, 2560)
"""One is 64 times the other: what grew with the square would take 64 times as long a pixel."""
MOST: Final = 8
"""Times as long a pixel, the geometric mean of 1 and 64: without compiled loops caches alone make a
factor of 3."""


def specks(shape):
    """Grey, with a saturated pixel in the middle of many a square of 3 x 3: each a component."""
    rng = np.random.default_rng(0)
    image = np.full((*shape, 3), 128, np.uint8)
    centres = image[1::3, 1::3]
    coloured = rng.random(centres.shape[:2]) < 0.7
    centres[coloured] = rng.choice([0, 255], (coloured.sum(), 3))
    centres[coloured, 1] = 0
    return image


def components_and_seconds(shape, runs):
    """How many components the filter finds, and the least CPU time of filter and morphology."""
    image, seconds = specks(shape), []
    chain = default("shadow").bind({})
    # Without the opening, which would remove the specks before they are labelled.
    process = post.bind(post.PostSettings(operations=()), None)
    with one_thread_each():
        for _ in range(runs):
            start = thread_time()
            (result,) = chain.run(View.of(image))
            shadow = result.output.regions["shadow"]
            process(View.of(image).after(Output(mask=shadow)))
            seconds.append(thread_time() - start)
    components = connected_components(shadow, 8)
    return components.count, min(seconds)


@pytest.fixture(scope="module")
def measured():
    components_and_seconds(SMALL, 1)  # warms up
    return {shape: components_and_seconds(shape, 5) for shape in (SMALL, LARGE)}


def test_the_noise_makes_very_many_components(measured):
    assert measured[LARGE][0] > 50_000
    assert measured[LARGE][0] > 40 * measured[SMALL][0]


def test_the_time_a_pixel_does_not_grow_with_the_number_of_components(measured):
    small, large = (seconds / np.prod(shape) for shape, (_, seconds) in measured.items())
    assert large < MOST * small

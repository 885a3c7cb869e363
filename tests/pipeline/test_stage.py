"""What a stage sees: the image and its channels, which stages share until a filter changes it."""

import numpy as np

from roadeval.data import Packed
from roadeval.pipeline.stage import Output, View
from tests.pipeline.images import noise

MASK = Packed.of(np.zeros((6, 8), np.uint8))


def test_the_channels_are_those_of_the_image():
    image = noise(6, 8)
    for channel, plane in enumerate(View.of(image).planes):
        np.testing.assert_array_equal(plane, image[..., channel])


def test_after_a_mask_the_channels_are_the_same():
    image = noise(6, 8)
    view = View.of(image)
    before = view.planes
    later = view.after(Output(mask=MASK)).after(Output())
    assert later.planes is before
    assert later.mask is MASK
    assert later.image is image


def test_an_image_may_have_any_layout():
    image = noise(6, 8)[:, ::-1]
    view = View.of(image)
    assert view.image.flags.c_contiguous
    np.testing.assert_array_equal(view.image, image)


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


def test_a_filter_that_gives_the_image_back_leaves_the_channels_too():
    view = View.of(noise(6, 8))
    assert view.after(Output(image=view.image)).planes is view.planes

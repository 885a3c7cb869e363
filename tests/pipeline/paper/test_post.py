"""Eq. 17-23 against SciPy on a plane wide enough that the image's border plays no part."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from roadeval.data import Packed
from roadeval.pipeline.paper import post
from roadeval.pipeline.paper.post import PostSettings
from roadeval.pipeline.stage import Output, View
from tests.pipeline import reference
from tests.pipeline.images import masks


def seen(road):
    """Return the view of post-processing after a stage with this mask."""
    view = View.of(np.zeros((*road.shape, 3), np.uint8))
    return view.after(Output(mask=Packed.of(road)))


def on_masks(operation):
    """Let an operation on packed masks take and give plain ones."""
    return lambda road, *rest: operation(Packed.of(road), *rest).pixels()


dilate, erode = on_masks(post.dilate), on_masks(post.erode)
opening, closing = on_masks(post.opening), on_masks(post.closing)
boundary, fill_holes = on_masks(post.boundary), on_masks(post.fill_holes)
keep_region = on_masks(post.keep_region)

elements = st.sampled_from(
    [*map(post.structuring_element, (1, 3, 5)), np.array([3, 1]), np.array([2, 2, 0])]
)


def on_a_plane(operation, road, element, **options):
    """Apply a SciPy operation with non-road all around, and cut the image out again."""
    wide = np.pad(road, 12)
    return operation(wide > 0, as_mask(element), **options)[12:-12, 12:-12]


def as_mask(element):
    """The bool array of a structuring element, from how far each row reaches."""
    rows = np.concatenate([element[:0:-1], element])
    return np.abs(np.arange(-element.max(), element.max() + 1)) <= rows[:, None]


def post_process(road, **options):
    return on_masks(post.post_process)(road, PostSettings(**options))


# --- Eq. 17-22 ------------------------------------------------------------------------------------


def assert_as_scipy(road, element):
    for ours, theirs in (
        (dilate, ndimage.binary_dilation),
        (erode, ndimage.binary_erosion),
        (opening, ndimage.binary_opening),
        (closing, ndimage.binary_closing),
    ):
        result = ours(road, element)
        assert result.dtype == np.uint8
        np.testing.assert_array_equal(result, on_a_plane(theirs, road, element))
    edge = (road > 0) & ~on_a_plane(ndimage.binary_erosion, road, element)
    np.testing.assert_array_equal(boundary(road, element), edge)


@given(masks, elements)
def test_dilation_erosion_opening_closing_and_boundary_equal_scipys(road, element):
    assert_as_scipy(road, element)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
@pytest.mark.parametrize("width", [63, 64, 65, 127, 128, 129])
def test_they_equal_scipys_where_a_word_of_pixels_ends(width, share):
    road = (np.random.default_rng(width).random((20, width)) < share).astype(np.uint8)
    assert_as_scipy(road, post.structuring_element(5))


@pytest.mark.parametrize("reach", [1, 32, 63, 64, 65, 128, 129, 250])
def test_closing_fills_gaps_no_wider_than_the_element_and_keeps_the_border_as_it_is(reach):
    gaps = 2 * reach, 2 * reach + 1, reach
    road = np.concatenate([[1], *([*[0] * gap, 1] for gap in gaps[:2]), [0] * gaps[2]])
    filled = road.copy()
    filled[: gaps[0] + 2] = 1
    element = np.array([reach])
    for way in (1, -1):
        closed = closing(road[None, ::way].astype(np.uint8), element)
        assert closed.tolist() == [filled[::way].tolist()]


@given(st.integers(1, 5000))
def test_the_elements_side_is_the_odd_number_nearest_to_1_percent_of_the_width(width):
    side = post.element_side(width)
    odd = range(3, 101, 2)
    assert side in odd
    assert abs(side - width / 100) == min(abs(n - width / 100) for n in odd)


# --- The largest and connected area ---------------------------------------------------------------


@given(masks)
def test_the_largest_component_is_kept(road):
    labels, count = ndimage.label(road, np.ones((3, 3)))
    largest = keep_region(road)
    if count == 0:
        assert not largest.any()
    else:
        sizes = [(labels == k).sum() for k in range(1, count + 1)]
        # The first of the largest: SciPy numbers components in the order of their first pixels.
        np.testing.assert_array_equal(largest, labels == 1 + int(np.argmax(sizes)))


# --- Eq. 23 ---------------------------------------------------------------------------------------

CROSS = ndimage.generate_binary_structure(2, 1)


@given(masks)
@settings(max_examples=200)
def test_filling_equals_scipys(road):
    np.testing.assert_array_equal(fill_holes(road), ndimage.binary_fill_holes(road, CROSS))


# --- The whole phase ------------------------------------------------------------------------------


PRINTED = {"operations": ("close", "open")}


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("width", [90, 300, 460])
@pytest.mark.parametrize("options", [{}, PRINTED], ids=["paper", "printed"])
def test_the_phase_equals_the_plain_pipeline(seed, width, options):
    rng = np.random.default_rng(seed)
    blobs = ndimage.gaussian_filter(rng.random((120, width)), 1 + seed)
    road = (blobs > np.quantile(blobs, 0.45)).astype(np.uint8)
    expected = reference.post(road > 0, options is PRINTED)
    np.testing.assert_array_equal(post_process(road, **options), expected)


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1), (2, 3), (7, 9)])
@pytest.mark.parametrize("value", [0, 1])
@pytest.mark.parametrize("options", [{}, PRINTED], ids=["paper", "printed"])
def test_tiny_and_constant_masks(shape, value, options):
    road = np.full(shape, value, np.uint8)
    expected = reference.post(road > 0, options is PRINTED)
    np.testing.assert_array_equal(post_process(road, **options), expected)


def test_every_step_can_be_left_out():
    rng = np.random.default_rng(5)
    road = (rng.random((30, 40)) > 0.4).astype(np.uint8)
    nothing = {"operations": (), "region": "all", "fill": False}
    square = post.structuring_element(3)
    opened, closed = opening(road, square), closing(road, square)
    for step, expected in (
        ({}, road),
        ({"operations": ("close",)}, closed),
        ({"operations": ("open",)}, opened),
        ({"operations": ("open", "close")}, closing(opened, square)),
        ({"operations": ("close", "open")}, opening(closed, square)),
        ({"region": "largest"}, keep_region(road)),
        ({"fill": True}, fill_holes(road)),
        ({"operations": ("close",), "element": 5}, closing(road, post.structuring_element(5))),
    ):
        np.testing.assert_array_equal(post_process(road, **nothing | step), expected)


def test_an_even_side_is_refused():
    with pytest.raises(ValueError, match="must be odd"):
        PostSettings(element=4)


def test_the_boundary_layer_is_of_the_result():
    road = (np.random.default_rng(2).random((30, 40)) > 0.3).astype(np.uint8)
    output = post.bind(PostSettings(), None)(seen(road))
    layers = {layer.spec.name: layer.array for layer in output.layers}
    np.testing.assert_array_equal(layers["post"], output.mask.pixels())
    np.testing.assert_array_equal(layers["boundary"], reference.boundary(layers["post"] > 0))
    assert tuple(layer.spec for layer in output.layers) == post.STAGE.layers


def test_post_processing_needs_a_mask_before_it():
    with pytest.raises(ValueError, match="road mask before it"):
        post.bind(PostSettings(), None)(View.of(np.zeros((3, 4, 3), np.uint8)))

"""The compiled kernels equal their NumPy twins bit for bit."""

from inspect import isfunction, signature

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from roadeval.data import Packed, pack, unpack
from roadeval.kernels import plain
from roadeval.pipeline.paper import shadow, similarity
from tests.pipeline.images import IMAGES, images, noise

fast = pytest.importorskip(
    "roadeval.kernels.compiled", reason="the loops were not compiled", exc_type=ImportError
)
RNG = np.random.default_rng(0)
COLOUR_TABLE = RNG.integers(0, 1 << 64, (1 << 18,), np.uint64)
WHITENING = similarity.whitening(np.cov(RNG.normal(0, 30, (3, 50))))


def segments(image, width):
    codes, histogram = plain.look_up_sum_min(cv2.split(image), shadow.NDI_CODES)
    mask = shadow.shadow_mask(codes, shadow.otsu_threshold(histogram), inclusive=False)
    runs, count = plain.components(pack(mask), mask.shape[1], 8)
    return runs, shadow.buffer_ring(Packed.of(mask), width).bits, count + 1


def every_kernel(image, width):
    """Name, and arguments, of each kernel on an image."""
    runs, ring, count = segments(image, width)
    source, target = RNG.uniform(-20, 280, (2, count, 3))
    gain = RNG.uniform(0, 9, (count, 3))
    planes = cv2.split(image)
    return {
        "look_up_sum_min": (planes, shadow.NDI_CODES),
        "run_sums": (planes, runs, count),
        "ring_sums": (planes, runs, ring, count, width),
        "transfer": (image, runs, source, target, gain),
        "mahalanobis": (planes, np.array([90.5, 101.25, 99.0]), WHITENING, 7.8),
        "look_up_colours": (planes, COLOUR_TABLE),
    }


def assert_same(result, twin, name=""):
    if isinstance(twin, tuple):
        for mine, its in zip(result, twin, strict=True):
            assert_same(mine, its, name)
    elif isinstance(twin, int):
        assert result == twin, name
    else:
        assert (result.dtype, result.shape) == (twin.dtype, twin.shape), name
        np.testing.assert_array_equal(result, twin, err_msg=name)


def assert_twins(image, width=1):
    before = image.copy()
    for name, arguments in every_kernel(image, width).items():
        compiled = getattr(fast, name)(*arguments)
        twin = getattr(plain, name)(*arguments)
        assert_same(compiled, twin, name)
    np.testing.assert_array_equal(image, before)


@pytest.mark.parametrize("width", [1, 3])
@pytest.mark.parametrize("image", IMAGES.values(), ids=IMAGES)
def test_twins_agree_on_odd_images(image, width):
    assert_twins(image, width)


@given(images(), st.integers(1, 4))
@settings(max_examples=50)
def test_twins_agree_on_random_images(image, width):
    assert_twins(image, width)


@given(st.integers(1, 9), st.integers(0, 40), st.integers(1, 4), st.integers(1, 256))
@settings(max_examples=100)
def test_twins_filter_rows_alike(height, size, step, levels):
    rows = RNG.integers(0, levels, (height, size), np.uint8)
    assert_same(fast.filter_rows(rows, step), plain.filter_rows(rows, step))


@given(st.integers(1, 5), st.integers(1, 140), st.sampled_from(plain.LABEL_BITS))
@settings(max_examples=100)
def test_twins_pack_labels_alike(height, width, bits):
    labels = RNG.integers(0, 256, (height, width), np.uint8)
    assert_same(fast.label_rows(labels, bits), plain.label_rows(labels, bits))


def test_arrays_may_be_read_only():
    for name, writeable in every_kernel(noise(12, 20), 1).items():
        arguments = [a.copy() if isinstance(a, np.ndarray) else a for a in writeable]
        for array in arguments:
            if isinstance(array, np.ndarray):
                array.flags.writeable = False
        assert_same(getattr(fast, name)(*arguments), getattr(plain, name)(*arguments), name)


@pytest.mark.parametrize(
    "mask",
    [np.zeros((4, 4), np.int8), np.zeros(4, np.uint8), np.zeros((4, 4), np.uint8)[:, ::2]],
    ids=["type", "dimensions", "order"],
)
def test_an_array_of_another_kind_is_refused(mask):
    with pytest.raises(TypeError, match="argument 0 "):
        fast.mahalanobis((mask, mask, mask), np.zeros(3), np.eye(3), 1.0)


def test_arrays_that_do_not_fit_together_are_refused():
    plane, more = np.zeros((4, 70), np.uint8), np.zeros((5, 70), np.uint8)
    runs, bits = np.zeros((0, 4), np.int32), np.zeros((4, 1), np.uint64)
    words = np.zeros((4, 2), np.uint64)
    image, road = np.zeros((4, 70, 3), np.uint8), np.zeros(1 << 18, np.uint64)
    wide, identity = np.zeros((2, 4)), np.eye(3)
    refused = [
        lambda: fast.look_up_sum_min((plane, plane, plane), np.zeros((766, 255), np.uint8)),
        lambda: fast.mahalanobis((plane, plane, plane), np.zeros(2), identity, 1.0),
        lambda: fast.mahalanobis((plane, plane, plane), np.zeros(3), identity[:2], 1.0),
        lambda: fast.look_up_colours((plane, plane, plane), road[:-1]),
        lambda: fast.ring_sums((plane, plane, plane), runs, words[:3], 1, 1),
        lambda: fast.transfer(image, runs, wide, wide, wide),
        lambda: fast.run_sums((plane, plane, more), runs, 1),
        lambda: fast.ring_sums((plane, plane, more), runs, bits, 1, 1),
        lambda: fast.fill_holes(bits, 70),
        lambda: fast.dilate(bits, np.array([1]), 70),
        lambda: fast.erode(bits, np.array([1]), 70),
        lambda: fast.keep_region(bits, 70),
        lambda: fast.count_bits(bits, words, words),
        lambda: fast.transfer(
            np.zeros((4, 70, 3), np.uint8),
            runs,
            np.zeros((2, 3)),
            np.zeros((1, 3)),
            np.ones((2, 3)),
        ),
        lambda: fast.geodesics(np.zeros((4, 71), np.uint16), plane, 1),
    ]
    for call in refused:
        with pytest.raises(ValueError, match="shape"):
            call()


def test_rounding_goes_to_even_and_ends_at_0_and_255():
    image = np.zeros((1, 4, 3), np.uint8)
    labels = np.array([[1, 2, 3, 4]], np.int32)
    target = np.repeat([[0.0], [0.5], [1.5], [300.0], [-4.0]], 3, axis=1)
    still = np.zeros_like(target), target, np.ones_like(target)
    for module in (fast, plain):
        assert module.transfer(image, plain.label_runs(labels), *still)[0, :, 0].tolist() == [
            0,
            2,
            255,
            0,
        ]


def test_every_component_has_its_own_transfer_whether_it_is_tabulated_or_not():
    image = noise(20, 50)
    labels = np.repeat(np.repeat([[1, 2, 3]], [20, 10, 20], axis=1), 20, axis=0).astype(np.int32)
    assert (np.bincount(labels.ravel())[1:] > fast.TABLED).tolist() == [True, False, True]
    source, target = RNG.uniform(0, 255, (2, 4, 3))
    arguments = image, plain.label_runs(labels), source, target, RNG.uniform(0.5, 2, (4, 3))
    assert_same(fast.transfer(*arguments), plain.transfer(*arguments))


@pytest.mark.parametrize("module", [fast, plain])
def test_sums_do_not_wrap_at_8_bits(module):
    white = np.full((3, 4, 3), 255, np.uint8)
    runs = plain.label_runs(np.ones((3, 4), np.int32))
    sums = module.run_sums(cv2.split(white), runs, 2)
    assert sums[1].tolist() == [12, *[12 * 255] * 3, *[12 * 255**2] * 3]


def test_every_kernel_has_a_twin():
    defined = (f for f in vars(plain).values() if isfunction(f) and f.__module__ == plain.__name__)
    twins = {f.__name__: f for f in defined if not f.__name__.startswith("_")}
    assert set(twins) - set(fast.LOOPS) == {"label_runs", "paint", "ring_pairs"}
    for name in fast.LOOPS:
        loop, twin = (signature(kernel).parameters for kernel in (getattr(fast, name), twins[name]))
        assert [*loop] == [*twin]


# --- Masks ----------------------------------------------------------------------------------------


def masks(most=80):
    """Random masks: any size, from a few specks to nearly full."""
    return st.builds(
        lambda height, width, share, seed: (
            np.random.default_rng(seed).random((height, width)) < share
        ).astype(np.uint8),
        st.integers(1, most),
        st.integers(1, 2 * most),
        st.sampled_from([0.0, 0.02, 0.3, 0.5, 0.6, 0.97, 1.0]),
        st.integers(0, 10**6),
    )


@given(masks())
@settings(max_examples=200)
def test_regions_are_kept_and_holes_filled_alike(mask):
    road = pack(mask), mask.shape[1]
    assert_same(fast.keep_region(*road), plain.keep_region(*road))
    assert_same(fast.fill_holes(*road), plain.fill_holes(*road))
    for connectivity in (4, 8):
        assert_same(fast.components(*road, connectivity), plain.components(*road, connectivity))


@pytest.mark.parametrize("width", [63, 64, 65, 128])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.6, 0.97, 1.0])
def test_kernels_of_masks_agree_about_the_end_of_a_word(width, share):
    mask = (np.random.default_rng(width).random((9, width)) < share).astype(np.uint8)
    packed = pack(mask)
    for connectivity in (4, 8):
        arguments = packed, width, connectivity
        assert_same(fast.components(*arguments), plain.components(*arguments), "components")
    assert_same(fast.keep_region(packed, width), plain.keep_region(packed, width), "keep_region")
    assert_same(fast.fill_holes(packed, width), plain.fill_holes(packed, width), "fill_holes")
    for reach in map(np.array, ([0], [1], [3, 1], [64, 63], [65, 2, 0], [130])):
        for name in ("dilate", "erode"):
            changed = getattr(fast, name)(packed, reach, width)
            assert_same(changed, getattr(plain, name)(packed, reach, width), name)
            np.testing.assert_array_equal(changed, pack(unpack(changed, width)))


@pytest.mark.parametrize("width", [63, 64, 65, 128, 200])
@pytest.mark.parametrize("reach", [1, 5, 16])
def test_rings_are_summed_up_alike_across_words(width, reach):
    image = noise(40, width)
    mask = (cv2.blur(image[..., 1], (5, 5)) < 110).astype(np.uint8)
    runs, count = plain.components(pack(mask), width, 8)
    ring = shadow.buffer_ring(Packed.of(mask), reach).bits
    arguments = cv2.split(image), runs, ring, count + 1, reach
    sums = fast.ring_sums(*arguments)
    assert count > 3
    assert (sums[1:, 0] > 0).all()
    assert_same(sums, plain.ring_sums(*arguments), "ring_sums")


@pytest.mark.parametrize("view", [np.asfortranarray, lambda m: m[::-1], lambda m: m[:, ::2]])
def test_masks_may_have_any_layout(view):
    mask = view((noise(40, 90)[..., 0] > 120).astype(np.uint8))
    np.testing.assert_array_equal(pack(mask), pack(np.ascontiguousarray(mask)))
    np.testing.assert_array_equal(unpack(pack(mask), mask.shape[1]), mask)


def test_labels_of_three_bits_and_an_element_without_rows_are_refused():
    with pytest.raises(ValueError, match="3 bits"):
        fast.label_rows(np.zeros((4, 70), np.uint8), 3)
    for name in ("dilate", "erode"):
        with pytest.raises(ValueError, match="without rows"):
            getattr(fast, name)(np.zeros((4, 2), np.uint64), np.array([], np.int64), 70)


@given(masks(), st.integers(0, 70), st.integers(0, 6), st.sampled_from(["dilate", "erode"]))
@settings(max_examples=200)
def test_masks_change_by_an_element_alike_and_stay_in_the_image(mask, least, rows, name):
    reach = np.array([least + rows - row for row in range(rows + 1)])
    arguments = pack(mask), reach, mask.shape[1]
    changed = getattr(fast, name)(*arguments)
    np.testing.assert_array_equal(changed, getattr(plain, name)(*arguments))
    np.testing.assert_array_equal(changed, pack(unpack(changed, mask.shape[1])))


@given(masks(most=30), st.sampled_from([1, 40, 65_535]), st.integers(0, 4), st.integers(0, 10**6))
def test_paths_are_measured_alike(seeds, greatest, rounds, seed):
    cost = np.random.default_rng(seed).integers(0, greatest, seeds.shape, np.uint16, endpoint=True)
    arguments = cost, seeds, rounds
    assert_same(fast.geodesics(*arguments), plain.geodesics(*arguments))


@given(st.integers(0, 3), st.integers(1, 3), st.integers(1, 4), st.integers(1, 200))
def test_bits_are_counted_alike(count, classes, regions, words):
    rng = np.random.default_rng(words)
    arguments = [
        rng.integers(0, 1 << 64, (rows, words), dtype=np.uint64)
        for rows in (count, classes, regions)
    ]
    result, twin = fast.count_bits(*arguments), plain.count_bits(*arguments)
    assert result.dtype == twin.dtype == np.int64
    np.testing.assert_array_equal(result, twin)
    assert result.shape == (count, classes, regions)


def test_bits_of_full_words_are_counted():
    full = np.full((1, 1000), ~np.uint64(0))
    assert fast.count_bits(full, full, full).item() == 64_000


@pytest.mark.parametrize("value", [1, 2, 255])
def test_any_value_but_0_is_inside(value):
    mask = (noise(30, 70)[..., 0] > 128).astype(np.uint8)
    np.testing.assert_array_equal(pack(mask * np.uint8(value)), pack(mask))


# --- Sums of decision trees -----------------------------------------------------------------------

ALL = 0xFFFFFFFF
GREATEST = 1e15
"""Threshold of an unused node: no feature is above it."""


def forest(*trees):
    """Arrays of trees, each by its nodes' ``(feature, threshold, leaves)`` and its leaves' values.

    Nodes and leaves are filled up to 32.
    """
    shape = len(trees), plain.LEAVES
    feature, threshold = np.zeros(shape, np.int32), np.full(shape, GREATEST, np.float32)
    leaves, values = np.full(shape, ALL, np.uint32), np.zeros(shape, np.float32)
    for tree, (nodes, added) in enumerate(trees):
        for place, (which, least, left) in enumerate(nodes):
            feature[tree, place], threshold[tree, place], leaves[tree, place] = which, least, left
        values[tree, : len(added)] = added
    return feature, threshold, leaves, values


# Above 0.5 in feature 0: the third leaf. Else above 2 in feature 1: the second. Else the first.
TREE = [(0, 0.5, ALL & ~0b011), (1, 2.0, ALL & ~0b001)], [10.0, 20.0, 30.0]
STUMP = [(1, 3.0, ALL & ~1)], [1.0, 2.0]


@pytest.mark.parametrize(
    ("trees", "features", "expected"),
    [
        ([TREE], [[0.0, 0.0, 1.0, 1.0], [2.0, 2.5, 0.0, 9.0]], [10, 20, 30, 30]),
        ([TREE], [[0.5], [0.0]], [10]),  # a value at the threshold is not above it
        ([TREE, STUMP], [[0.0, 1.0], [4.0, 0.0]], [20 + 2, 30 + 1]),
    ],
)
def test_a_pixel_gets_the_sum_of_the_leaves_that_walks_end_at(trees, features, expected):
    for module in (fast, plain):
        sums = module.tree_sum(np.array(features, np.float32), *forest(*trees))
        assert sums.tolist() == expected


@pytest.mark.parametrize("pixels", [1, 255, 256, 257, 1000])
def test_trees_are_summed_up_alike_for_any_number_of_pixels(pixels):
    rng = np.random.default_rng(pixels)
    features = rng.normal(size=(7, pixels)).astype(np.float32)
    feature = rng.integers(0, 7, (9, 32)).astype(np.int32)
    threshold, values = rng.normal(size=(2, 9, 32)).astype(np.float32)
    leaves = (rng.integers(0, 1 << 31, (9, 32)) | 1 << 31).astype(np.uint32)
    arguments = features, feature, threshold, leaves, values
    np.testing.assert_array_equal(fast.tree_sum(*arguments), plain.tree_sum(*arguments))


def test_trees_that_do_not_fit_together_are_refused():
    features = np.zeros((2, 4), np.float32)
    feature, threshold, leaves, values = forest(TREE)
    for wrong in [(feature[:, :4], threshold), (feature, threshold[:0])]:
        with pytest.raises(ValueError, match="shape"):
            fast.tree_sum(features, *map(np.ascontiguousarray, wrong), leaves, values)

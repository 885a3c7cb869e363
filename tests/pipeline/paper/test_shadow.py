"""Eq. 6-11, each against a literal reading of it: `tests.pipeline.reference`."""

import tracemalloc

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skimage.filters import threshold_otsu
from skimage.measure import label

from roadeval.data import Packed
from roadeval.kernels import KERNELS, plain
from roadeval.pipeline.paper import shadow
from roadeval.pipeline.paper.shadow import ShadowSettings
from roadeval.pipeline.stage import View
from tests.pipeline import reference
from tests.pipeline.images import DARK, IMAGES, LIT, images, mask, masks, noise, picture

PRINTED = ShadowSettings(
    threshold="printed", inclusive=True, statistic="printed", colour_space="hsi"
)


def codes_of(image):
    return KERNELS.look_up_sum_min(cv2.split(image), shadow.NDI_CODES)


def run(image, options=None):
    output = shadow.bind(options or ShadowSettings(), None)(View.of(image))
    return output, {layer.spec.name: layer.array for layer in output.layers}


# --- Eq. 3-6 --------------------------------------------------------------------------------------


def test_the_conversion_from_hue_saturation_and_value_inverts_theirs():
    levels = np.append(np.arange(0, 256, 7), 255).astype(np.uint8)
    lattice = np.stack(np.meshgrid(levels, levels, levels), axis=-1)
    for rgb in (lattice, noise(300, 300)):
        back = shadow.hsv_to_rgb(shadow.hue(rgb), shadow.saturation(rgb), shadow.value(rgb))
        np.testing.assert_array_equal(back, rgb)


def test_ndi_of_every_sum_and_minimum():
    least, rest = np.mgrid[0:256, 0:511].astype(object)
    total = 3 * least + rest
    # (NDI + 1) * 127.5 = 255 S / (S + V) with S = (t - 3m) / t and V = t / 765, in whole numbers.
    above, below = 255 * 765 * (total - 3 * least), 765 * (total - 3 * least) + total**2
    twice = 2 * above // np.maximum(below, 1)
    nearest = (twice + 1) // 2
    halfway = (2 * above == twice * below) & (twice % 2 == 1)
    expected = np.where(halfway & (nearest % 2 == 1), nearest - 1, nearest)
    possible = total - least <= 510
    np.testing.assert_array_equal(
        shadow.NDI_CODES[total[possible].astype(int), least[possible].astype(int)],
        expected[possible].astype(int),
    )
    assert halfway[possible].sum() == 2


@pytest.mark.parametrize(
    ("rgb", "ndi"),
    [
        ((0, 0, 0), -1),
        ((1, 1, 1), -1),
        ((255, 255, 255), -1),
        ((255, 0, 0), 0.5),  # S = 1, V = 1/3
        ((255, 255, 0), 0.2),  # S = 1, V = 2/3
        ((0, 0, 1), 764 / 766),  # S = 1, V = 1/765
        ((128, 0, 127), 0.5),
    ],
)
def test_ndi_by_hand(rgb, ndi):
    codes, histogram = codes_of(np.array([[rgb]], np.uint8))
    assert codes[0, 0] == round((ndi + 1) * 127.5)
    assert histogram[codes[0, 0]] == histogram.sum() == 1


# --- Eq. 7 and 8 ----------------------------------------------------------------------------------

histograms = st.dictionaries(st.integers(0, 255), st.integers(1, 40), min_size=1, max_size=12)


def as_array(histogram):
    counts = np.zeros(256, np.int64)
    counts[list(histogram)] = list(histogram.values())
    return counts


@given(histograms, st.booleans())
def test_a_threshold_is_the_first_maximum_of_eq_7_in_fractions(histogram, printed):
    ours = shadow.printed_threshold if printed else shadow.otsu_threshold
    codes = np.repeat(list(histogram), list(histogram.values()))
    assert ours(as_array(histogram)) == reference.threshold(codes, printed)


@pytest.mark.parametrize("seed", range(20))
def test_otsu_equals_opencv_and_scikit_image(seed):
    rng = np.random.default_rng(seed)
    parts = rng.normal(rng.uniform(20, 100), 15, 4000), rng.normal(rng.uniform(110, 230), 20, 3000)
    codes = np.clip(np.concatenate(parts), 0, 255).astype(np.uint8).reshape(70, 100)
    ours = shadow.otsu_threshold(np.bincount(codes.ravel(), minlength=256))
    assert ours == threshold_otsu(codes)
    assert ours == cv2.threshold(codes, 0, 255, cv2.THRESH_OTSU)[0]


@pytest.mark.parametrize("tied", [{10: 5, 20: 5, 30: 5}, {10: 7, 200: 9}])
def test_otsu_takes_the_lowest_of_equal_maxima_also_of_codes_that_no_pixel_has(tied):
    assert shadow.otsu_threshold(as_array(tied)) == 10


@pytest.mark.parametrize("pixels", [10**4, 3 * 10**7])
def test_thresholds_do_not_depend_on_the_number_of_pixels(pixels):
    counts = as_array({40: 4, 50: 3, 90: 1, 180: 2}) * (pixels // 10)
    assert shadow.otsu_threshold(counts) == 90
    assert shadow.printed_threshold(counts) == 90


def test_the_printed_threshold_is_at_the_lower_edge_where_most_codes_are_near_0():
    # Mean 60/56. T = 0: w = 1/56, criterion 53.0; T = 1: w = 51/56, criterion 9.7.
    assert shadow.printed_threshold(as_array({0: 1, 1: 50, 2: 5})) == 0
    # Mean 1: (w - mu)^2 / (w mu) is the same for w = 1/102 and for w = 101/102.
    assert shadow.printed_threshold(as_array({0: 1, 1: 100, 2: 1})) == 0


def test_the_printed_threshold_lands_at_the_edge_of_the_histogram():
    counts = as_array({level: 400 - abs(level - 100) for level in range(5, 200)})
    assert shadow.printed_threshold(counts) == 198
    assert 80 < shadow.otsu_threshold(counts) < 120


@pytest.mark.parametrize("threshold", [shadow.otsu_threshold, shadow.printed_threshold])
def test_a_single_occupied_code_has_no_threshold_and_no_shadow(threshold):
    assert threshold(as_array({77: 12})) is None
    codes = np.full((3, 4), 77, np.uint8)
    assert not shadow.shadow_mask(codes, None, inclusive=False).any()
    assert not shadow.shadow_mask(codes, None, inclusive=True).any()


def test_the_threshold_itself_is_shadow_only_as_printed():
    codes = np.array([[4, 5, 6]], np.uint8)
    assert shadow.shadow_mask(codes, 5, inclusive=False).tolist() == [[0, 0, 1]]
    assert shadow.shadow_mask(codes, 5, inclusive=True).tolist() == [[0, 1, 1]]


# --- Eq. 9 and 10 ---------------------------------------------------------------------------------


@pytest.mark.parametrize("connectivity", [4, 8])
@given(shadowed=masks)
@settings(max_examples=60)
def test_components_are_those_of_scikit_image(connectivity, shadowed):
    components = shadow.connected_components(Packed.of(shadowed), connectivity)
    expected, count = label(shadowed, connectivity=connectivity // 4, return_num=True)
    np.testing.assert_array_equal(components.labels(), expected)
    assert components.count == count


def test_a_ring_by_hand():
    shadowed = mask("......", ".##...", "...#..", "......")
    assert (buffer_ring(shadowed, 1) == mask("####..", "#..##.", "###.#.", "..###.")).all()


def buffer_ring(shadowed, width):
    return shadow.buffer_ring(Packed.of(shadowed), width).pixels()


@pytest.mark.parametrize("connectivity", [4, 8])
@given(shadowed=masks, width=st.integers(1, 3))
@settings(max_examples=60)
def test_rings_equal_the_dilation_of_each_component_alone(connectivity, shadowed, width):
    labels = shadow.connected_components(Packed.of(shadowed), connectivity).labels()
    union = buffer_ring(shadowed, width)
    owner, pixel = shadow.ring_pairs(labels, union, width)
    np.testing.assert_array_equal(union, reference.rings(shadowed > 0, width))
    pairs = 0
    for box, inside, ring in reference.components(shadowed > 0, width, connectivity // 4):
        alone = np.zeros(shadowed.shape, bool)
        alone[box] = ring
        ours = owner == labels[box][inside][0]
        assert pixel[ours].tolist() == np.flatnonzero(alone).tolist()
        pairs += ring.sum()
    assert len(owner) == pairs


def test_a_wide_ring_does_not_take_the_memory_of_all_its_neighbours_at_once():
    labels = np.pad(np.ones((1, 1), np.int32), (0, 199))
    tracemalloc.start()
    shadow.ring_pairs(labels, labels == 0, 16)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 32 * 33 * labels.size


def test_a_pixel_between_two_components_counts_in_both_rings():
    image = noise(1, 7)
    labels = np.array([[0, 1, 0, 0, 2, 0, 0]], np.int32)
    ring = shadow.buffer_ring(Packed.of(labels > 0), 2).bits
    outside = KERNELS.ring_sums(cv2.split(image), plain.label_runs(labels), ring, 3, 2)
    assert outside[1, 1:4].tolist() == image[0, [0, 2, 3]].sum(axis=0).tolist()
    assert outside[2, 1:4].tolist() == image[0, [2, 3, 5, 6]].sum(axis=0).tolist()


def one(labels):
    """The component that a hand-made label image holds."""
    return shadow.Components(plain.label_runs(labels), 1, labels.shape)


# --- Eq. 11 ---------------------------------------------------------------------------------------


def test_compensation_by_hand():
    # The component has mean 12 and deviation 2, its ring 100 and 6.
    grey = np.array([[94, 10, 106], [94, 14, 106]], np.uint8)
    image = np.repeat(grey[..., None], 3, axis=2)
    labels = np.array([[0, 1, 0], [0, 1, 0]], np.int32)
    ring = Packed.of(labels == 0)
    result = shadow.compensate(View.of(image), one(labels), ring, ShadowSettings())
    assert result[..., 0].tolist() == [[94, 94, 106], [94, 106, 106]]

    printed = ShadowSettings(statistic="printed")
    result = shadow.compensate(View.of(image), one(labels), ring, printed)
    assert result[..., 0].tolist() == [[94, 100, 106], [94, 100, 106]]


def assert_rounded(image, exact):
    """Hold an image to float values, rounded and clipped; a half may fall to either side."""
    assert image.dtype == np.uint8
    clipped = np.clip(exact, 0, 255)
    assert np.abs(image - clipped).max() <= 0.5 + 1e-6


options = st.builds(
    ShadowSettings,
    connectivity=st.sampled_from([4, 8]),
    ring_width=st.integers(1, 3),
    max_gain=st.sampled_from([None, None, 1.5]),
    statistic=st.sampled_from(["deviation", "printed"]),
)


def check_rgb(image, chosen):
    shadowed = run(image, chosen)[1]["shadow"]
    components = shadow.connected_components(Packed.of(shadowed), chosen.connectivity)
    ring = shadow.buffer_ring(Packed.of(shadowed), chosen.ring_width)
    result = shadow.compensate(View.of(image), components, ring, chosen)
    printed, connectivity = chosen.statistic == "printed", chosen.connectivity // 4
    more = {"connectivity": connectivity, "most": chosen.max_gain}
    exact = reference.transfer(image, shadowed > 0, chosen.ring_width, printed, **more)
    assert_rounded(result, exact)


@given(images(), options)
def test_compensation_equals_the_loop_over_components(image, chosen):
    check_rgb(image, chosen)


@pytest.mark.parametrize("chosen", [ShadowSettings(), ShadowSettings(ring_width=3)])
@pytest.mark.parametrize("image", [*IMAGES.values(), noise(40, 60)], ids=[*IMAGES, "small noise"])
def test_compensation_equals_the_loop_on_odd_images(image, chosen):
    check_rgb(image[:60, :60], chosen)


@pytest.mark.parametrize("statistic", ["deviation", "printed"])
@given(image=images(), width=st.integers(1, 3))
@settings(max_examples=60)
def test_compensation_in_hsi_equals_the_loop_over_components(statistic, image, width):
    chosen = ShadowSettings(colour_space="hsi", statistic=statistic, ring_width=width)
    _, layers = run(image, chosen)
    shadowed = layers["shadow"]
    values = np.stack([reference.saturation(image), reference.value(image)], axis=-1)
    moved = reference.transfer(values, shadowed > 0, width, statistic == "printed")
    s, v = np.moveaxis(np.clip(moved, 0, 1), -1, 0)
    exact = reference.from_hsi(reference.hue(image), s, v)
    assert_rounded(layers["compensated"], np.where(shadowed[..., None] > 0, exact, image))


@pytest.mark.parametrize("colour_space", ["rgb", "hsi"])
def test_a_component_without_a_ring_is_left_as_it_is(colour_space):
    image = noise(3, 4)
    labels, ring = np.ones((3, 4), np.int32), Packed.of(np.zeros((3, 4), np.uint8))
    chosen = ShadowSettings(colour_space=colour_space)
    result = shadow.compensate(View.of(image), one(labels), ring, chosen)
    np.testing.assert_array_equal(result, image)


@given(images())
def test_moments_equal_numpy_on_the_pixels_themselves(image):
    labels = np.ones(image.shape[:2], np.int32)
    sums = KERNELS.run_sums(cv2.split(image), one(labels).runs, 2)
    moments = shadow.moments_of_sums(sums)
    pixels = image.reshape(-1, 3).astype(float)
    assert moments.pixels[1] == len(pixels)
    np.testing.assert_allclose(moments.mean[1], pixels.mean(axis=0), rtol=1e-14)
    np.testing.assert_allclose(moments.deviation[1], pixels.std(axis=0), rtol=1e-12)
    assert ((moments.deviation[1] == 0) == (np.ptp(pixels, axis=0) == 0)).all()


@pytest.mark.parametrize("pixels", [3, 7, 41])
def test_a_constant_component_has_no_deviation_in_hsi_either(pixels):
    values = np.repeat(noise(1, 99)[0] / 255, pixels, axis=0)
    labels = np.repeat(np.arange(99), pixels)
    moments = shadow.moments_of_values(labels, values, 99)
    assert (moments.deviation == 0).all()


@pytest.mark.parametrize("pixels", [10, 10**7, 10**9])
def test_moments_of_huge_components_neither_overflow_nor_cancel(pixels):
    # All pixels 254 but one in ten, which is 255; then all of them 255.
    tenth = pixels // 10
    mixed = 9 * tenth * np.array([254, 254**2]) + tenth * np.array([255, 255**2])
    even = pixels * np.array([255, 255**2])
    sums = np.array([[pixels, *[s] * 3, *[q] * 3] for s, q in (mixed, even)], np.int64)
    moments = shadow.moments_of_sums(sums)
    np.testing.assert_allclose(moments.mean[:, 0], [254.1, 255], rtol=1e-15)
    np.testing.assert_allclose(moments.deviation[:, 0], [0.3, 0], rtol=1e-14)


# --- The stage ------------------------------------------------------------------------------------


@pytest.mark.parametrize("chosen", [ShadowSettings(), PRINTED], ids=["paper", "printed"])
@pytest.mark.parametrize("image", IMAGES.values(), ids=IMAGES)
def test_the_filter_equals_the_plain_pipeline(image, chosen):
    image, printed = image[:50, :50], chosen is PRINTED
    output, layers = run(image, chosen)
    codes = reference.ndi_codes(image)
    shadowed = reference.shadow_mask(codes, printed)
    np.testing.assert_array_equal(layers["ndi"], codes)
    np.testing.assert_array_equal(layers["shadow"], shadowed)
    np.testing.assert_array_equal(layers["rings"], shadowed + 2 * reference.rings(shadowed))
    assert_rounded(layers["compensated"], reference.compensate(image, shadowed, printed))
    assert output.image is layers["compensated"]


@pytest.mark.parametrize("image", IMAGES.values(), ids=IMAGES)
def test_shadow_edge_and_lit_share_out_the_image(image):
    output, layers = run(image, ShadowSettings(ring_width=2))
    parts = [output.regions[name].pixels() for name in ("shadow", "shadow_edge", "lit")]
    assert (sum(parts) == 1).all()
    np.testing.assert_array_equal(layers["rings"], parts[0] + 2 * parts[1])


def test_an_image_without_shadow_is_handed_on_itself():
    image = np.full((6, 8, 3), 90, np.uint8)
    assert shadow.bind(ShadowSettings(), None)(View.of(image)).image is image


def test_the_threshold_is_stated_where_there_is_one():
    image = picture("#...#", "#....", ".....")
    _, histogram = codes_of(image)
    stated = run(image)[0].facts["threshold"]
    assert stated == pytest.approx(shadow.otsu_threshold(histogram) / 127.5 - 1)
    assert np.isnan(run(np.full((4, 4, 3), LIT, np.uint8))[0].facts["threshold"])


def test_black_borders_of_rectified_images_are_no_shadow():
    image = np.full((6, 8, 3), LIT, np.uint8)
    image[:, 4:6] = DARK
    image[:2] = 0
    assert (run(image)[1]["shadow"] == mask(*["........"] * 2, *["....##.."] * 4)).all()

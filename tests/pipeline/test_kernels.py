"""The compiled kernels equal their NumPy twins bit for bit, whatever the arrays look like."""

from inspect import isfunction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from roadeval.pipeline import fast, kernels, plain, shadow
from tests.pipeline.images import IMAGES, images, noise

RNG = np.random.default_rng(0)
COLOUR_TABLE = RNG.integers(0, 256, 1 << 24, dtype=np.uint8)
PRECISION = np.linalg.inv(np.cov(RNG.normal(0, 30, (3, 50))))


def segments(image, width):
    codes, histogram = plain.look_up_sum_min(image, shadow.NDI_CODES)
    mask = shadow.shadow_mask(codes, shadow.otsu_threshold(histogram), inclusive=False)
    labels, count = shadow.connected_components(mask, 8)
    return labels, shadow.buffer_ring(mask, width), count + 1


def every_kernel(image, width):
    """Name, and arguments, of each kernel on an image."""
    labels, ring, count = segments(image, width)
    source, target = RNG.uniform(-20, 280, (2, count, 3))
    gain = RNG.uniform(0, 9, (count, 3))
    return {
        "look_up_sum_min": (image, shadow.NDI_CODES),
        "region_sums": (image, labels, ring, count, width),
        "transfer": (image, labels, source, target, gain),
        "mahalanobis": (image, np.array([90.5, 101.25, 99.0]), PRECISION, 7.8),
        "areas": (labels, count),
        "look_up_colours": (image, COLOUR_TABLE),
    }


def assert_twins(image, width=1):
    before = image.copy()
    for name, arguments in every_kernel(image, width).items():
        compiled = getattr(kernels, name)(*arguments)
        twin = getattr(plain, name)(*arguments)
        parts = zip(compiled, twin, strict=True) if isinstance(twin, tuple) else [(compiled, twin)]
        for a, b in parts:
            assert (a.dtype, a.shape) == (b.dtype, b.shape), name
            np.testing.assert_array_equal(a, b, err_msg=name)
    np.testing.assert_array_equal(image, before)


@pytest.mark.parametrize("width", [1, 3])
@pytest.mark.parametrize("image", IMAGES.values(), ids=IMAGES)
def test_twins_agree_on_odd_images(image, width):
    assert_twins(image, width)


@given(images(), st.integers(1, 4))
@settings(max_examples=50)
def test_twins_agree_on_random_images(image, width):
    assert_twins(image, width)


def read_only(image):
    frozen = np.frombuffer(image.tobytes(), np.uint8).reshape(image.shape)
    assert not frozen.flags.writeable
    return frozen


@pytest.mark.parametrize(
    "view",
    [
        read_only,
        lambda image: image[..., ::-1],
        lambda image: image[::2, 1::3],
        lambda image: image.transpose(1, 0, 2),
        np.asfortranarray,
    ],
    ids=["read-only", "channels reversed", "strided", "transposed", "Fortran order"],
)
def test_twins_agree_on_any_layout(view):
    assert_twins(view(noise(12, 20)))


def test_rounding_goes_to_even_and_ends_at_0_and_255():
    image = np.zeros((1, 4, 3), np.uint8)
    labels = np.array([[1, 2, 3, 4]], np.int32)
    target = np.repeat([[0.0], [0.5], [1.5], [300.0], [-4.0]], 3, axis=1)
    still = np.zeros_like(target), target, np.ones_like(target)
    for module in (kernels, plain):
        assert module.transfer(image, labels, *still)[0, :, 0].tolist() == [0, 2, 255, 0]


@pytest.mark.parametrize("module", [kernels, plain])
def test_sums_do_not_wrap_at_8_bits(module):
    white = np.full((3, 4, 3), 255, np.uint8)
    labels, ring = np.ones((3, 4), np.int32), np.zeros((3, 4), np.uint8)
    inside, outside = module.region_sums(white, labels, ring, 2, 1)
    assert inside[1].tolist() == [12, *[12 * 255] * 3, *[12 * 255**2] * 3]
    assert not outside.any()


def test_every_kernel_has_a_twin():
    compiled = {name for name, f in vars(kernels).items() if hasattr(f, "py_func")}
    twins = {name for name, f in vars(plain).items() if isfunction(f)}
    assert {n for n in compiled if n[0] != "_"} == {n for n in twins if n[0] != "_"}


def test_the_twins_can_be_chosen(monkeypatch):
    monkeypatch.delenv("ROADEVAL_PLAIN", raising=False)
    assert fast._pick() is kernels
    monkeypatch.setenv("ROADEVAL_PLAIN", "1")
    assert fast._pick() is plain

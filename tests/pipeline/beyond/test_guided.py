"""The fast guided filter, against lines fitted window by window."""

import cv2
import numpy as np
import pytest

from roadeval.pipeline.beyond.scene import CONTRAST, SIDE, guided


def grey(levels):
    return np.repeat(np.asarray(levels, np.uint8)[..., None], 3, axis=2)


@pytest.fixture
def noise():
    rng = np.random.default_rng(0)
    return rng.integers(0, 256, (7, 9), np.uint8), rng.random((7, 9)).astype(np.float32)


def lines_by_least_squares(levels, values):
    """Fit ``a I + b`` in each window; ``a`` is kept small by one more equation a pixel."""
    around = SIDE // 2
    brightness, wanted = (
        np.pad(plane.astype(np.float64), around, mode="reflect") for plane in (levels, values)
    )
    found = np.empty((2, *levels.shape))
    for row, column in np.ndindex(levels.shape):
        window = np.s_[row : row + SIDE, column : column + SIDE]
        inside, target = brightness[window].ravel(), wanted[window].ravel()
        ones, zeros = np.ones_like(inside), np.zeros_like(inside)
        system = np.vstack([np.column_stack([inside, ones]), [[CONTRAST * SIDE, 0]]])
        found[:, row, column] = np.linalg.lstsq(system, np.append(target, zeros[:1]))[0]
    return found


def test_a_line_is_fitted_in_each_window(noise):
    levels, values = noise
    slope, offset = (cv2.blur(each, (SIDE, SIDE)) for each in lines_by_least_squares(*noise))
    found = guided(values, grey(levels), grey(levels))
    np.testing.assert_allclose(found, slope * levels + offset, atol=1e-4)


def test_an_edge_of_the_image_becomes_the_edge_of_the_values():
    """The edge lies inside a pixel of the working image, whose value is between those beside it."""
    image = np.full((40, 40), 60)
    image[:, 21:] = 200
    share = (image == 200).astype(np.float32)
    working, values = (
        cv2.resize(plane, (10, 10), interpolation=cv2.INTER_AREA)
        for plane in (image.astype(np.uint8), share)
    )
    assert 0 < values[0, 5] < 1
    found = guided(values, grey(working), grey(image))
    np.testing.assert_array_equal(found > 0.5, share > 0.5)


def test_without_contrast_the_values_are_averaged(noise):
    _, values = noise
    flat = grey(np.full(values.shape, 90))
    twice = cv2.blur(cv2.blur(values, (SIDE, SIDE)), (SIDE, SIDE))
    np.testing.assert_allclose(guided(values, flat, flat), twice, atol=1e-5)


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (4, 4), (25, 60)])
def test_an_image_of_any_size_is_reached(noise, shape):
    levels, values = noise
    found = guided(values, grey(levels), grey(np.full(shape, 128)))
    assert found.shape == shape
    assert found.dtype == np.float32
    assert np.isfinite(found).all()

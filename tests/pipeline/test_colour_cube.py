"""Values on the colour cube against sums that leave nothing out."""

import numpy as np
import pytest

from roadeval.pipeline import colour_cube as cube

RNG = np.random.default_rng(0)
CENTRES = RNG.uniform(0, 255, (7, 3))
WEIGHTS = RNG.normal(0, 3, 7)


def bells(width):
    """Gaussian factors of a width in grey levels."""

    def factor(channel, levels):
        return np.exp(-(((levels[:, None] - CENTRES[:, channel]) / width) ** 2))

    return factor


def literal(factor, red):
    r, g, b = (factor(channel, cube.LEVELS) for channel in range(3))
    return np.einsum("i,i,gi,bi->gb", WEIGHTS, r[red], g, b) + 0.25


@pytest.mark.parametrize("width", [3000.0, 80.0, 20.0, 5.0, 0.3])
def test_sums_of_products_stay_within_their_bound(width):
    slabs = cube.sums_of_products(WEIGHTS, bells(width), 0.25, rounding=1e-15)
    assert slabs.error < 1e-5
    for red in (0, 17, 255):
        off = np.abs(slabs.of_red(red) - literal(bells(width), red)).max()
        assert off <= slabs.error


def test_wide_factors_need_few_nodes_and_steep_ones_every_level():
    def nodes(width):
        return len(cube._interpolation(bells(width), 1e-7, 1e-15).green)

    assert nodes(80.0) <= 24 < nodes(20.0) < 256 == nodes(0.3)


@pytest.mark.parametrize("count", [16, 24, 128])
def test_interpolation_is_exact_for_polynomials(count):
    nodes, matrix = cube._chebyshev(count)
    assert ((nodes > 0) & (nodes < 255)).all()
    for power in (0, 1, 5):
        np.testing.assert_allclose(
            matrix @ (nodes / 255) ** power, (cube.LEVELS / 255) ** power, atol=1e-12
        )


def test_the_gap_is_the_largest_difference_that_interpolation_makes():
    near = cube._interpolation(bells(20.0), 1.0, 0.0)  # so tolerant that 16 nodes do
    for channel, few in ((1, near.green), (2, near.blue)):
        off = np.abs(near.matrix @ few - bells(20.0)(channel, cube.LEVELS)).max()
        assert 0 < off <= near.gap


def test_sums_of_terms_are_sums():
    terms = RNG.normal(0, 100, (3, 256))
    slabs = cube.sums_of_terms(terms, -3.0)
    for red, values in enumerate(slabs):
        exact = terms[0, red] + terms[1][:, None] + terms[2][None, :] - 3.0
        assert np.abs(values - exact).max() <= slabs.error < 1e-10

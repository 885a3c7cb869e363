"""The road as geometry: edges, lay-by, paint."""

import numpy as np
import pytest

from roadeval.synth.road import (
    BAY_DEPTH,
    CENTRE_LINE_WIDTH,
    DASH_LENGTH,
    DASH_PERIOD,
    EDGE_LINE_INSET,
    HALF_WIDTH,
    Bend,
    Road,
    covered,
    dashed,
    paint,
)

STRAIGHT = Road(bends=(), bay=(100.0, 140.0))


def test_the_asphalt_ends_at_its_half_width() -> None:
    offset = HALF_WIDTH * np.array([-1.01, -0.99, 0.0, 0.99, 1.01])
    assert STRAIGHT.is_road(offset, np.zeros(5)).tolist() == [False, True, True, True, False]


def test_a_lay_by_widens_the_road_on_the_right_only() -> None:
    offset = np.array([-HALF_WIDTH - 1.0, HALF_WIDTH + 1.0, HALF_WIDTH + BAY_DEPTH + 0.1])
    assert STRAIGHT.is_road(offset, np.full(3, 120.0)).tolist() == [False, True, False]


def test_a_bend_keeps_the_width_across_the_road() -> None:
    road = Road(bends=(Bend(10.0, 100.0, 0.0),), bay=(1e3, 1e3))
    z = np.array([0.0])
    left, right = road.edges(z)
    across = (right - left)[0] * np.cos(np.arctan(road.slope(z)[0]))
    assert across == pytest.approx(2 * HALF_WIDTH)


def test_the_slope_is_the_derivative_of_the_centre_line() -> None:
    road = Road(bends=(Bend(5.0, 90.0, 0.4), Bend(1.0, 40.0, 1.0)), bay=(0.0, 0.0))
    z = np.array([7.0])
    step = (road.centre(z + 1e-4) - road.centre(z - 1e-4)) / 2e-4
    assert road.slope(z)[0] == pytest.approx(step[0], abs=1e-6)


def test_covered_is_the_share_of_an_interval_inside_another() -> None:
    x = np.array([0.0, 1.0, 1.5, 3.0])
    assert covered(x, np.array(1.0), -1.0, 1.0).tolist() == [1.0, 0.5, 0.0, 0.0]


def test_dashes_repeat_with_their_period() -> None:
    z = np.array([DASH_LENGTH / 2, DASH_LENGTH + 1.0, DASH_PERIOD + DASH_LENGTH / 2, -1.0])
    assert dashed(z, np.full(4, 0.1)).tolist() == pytest.approx([1.0, 0.0, 1.0, 0.0])


def test_a_patch_as_long_as_a_period_holds_one_dash() -> None:
    z = np.array([0.3, 5.0, -17.0])
    share = DASH_LENGTH / DASH_PERIOD
    assert dashed(z, np.full(3, DASH_PERIOD)).tolist() == pytest.approx([share] * 3, abs=1e-6)


def test_paint_lies_on_the_centre_and_on_both_edges() -> None:
    edge = HALF_WIDTH - EDGE_LINE_INSET
    offset = np.array([0.0, CENTRE_LINE_WIDTH, edge, -edge, 1.7])
    painted = paint(offset, np.full(5, 1.0), np.full(5, 0.01), np.full(5, 0.01))
    assert painted.tolist() == pytest.approx([1.0, 0.0, 1.0, 1.0, 0.0])

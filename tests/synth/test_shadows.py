"""Cast shadows: where they lie, how soft they are, and what they do not darken."""

import numpy as np
import pytest

from roadeval.synth.light import SUN_RADIUS, Sun
from roadeval.synth.noise import Field
from roadeval.synth.road import Road
from roadeval.synth.shadows import CELL, Silhouettes, SunMap, disc_of_the_sun

ROAD = Road(bends=(), bay=(1e3, 1e3))
SUN = Sun(elevation=np.radians(45), azimuth=np.radians(90))
"""From the right, so that a shadow is as long as its thing is high, and points to the left."""


def empty() -> Silhouettes:
    return Silhouettes(ROAD, SUN, start=0.0, end=20.0)


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> SunMap:
    silhouettes = empty()
    silhouettes.add_box(np.array(low), np.array(high))
    return silhouettes.cast()


def seen_from(shade: SunMap, *points: tuple[float, float, float]) -> Field:
    return shade.visible_from(np.array([points]))[0]


def seen_on_ground(shade: SunMap, x: Field) -> Field:
    z = np.full((1, len(x)), 10.0, np.float32)
    ground = shade.ground()
    return ground.sample(x[None].astype(np.float32), z, np.full(1, CELL, np.float32))[0]


def width_of_penumbra(height: float) -> float:
    """Metres over which the edge of a thin roof's shadow passes from dark to bright."""
    shade = box((4.0, height, 5.0), (8.0, height + 0.1, 15.0))
    x = np.arange(4.0 - height - 1.0, 4.0 - height + 1.0, 0.005)
    visible = seen_on_ground(shade, x)
    return float(np.count_nonzero((visible > 0.02) & (visible < 0.98)) * 0.005)


def test_without_occluders_the_whole_sun_is_seen() -> None:
    assert (empty().cast().ground().levels[0] == 1.0).all()


def test_a_pole_casts_a_shadow_as_long_as_the_sun_is_low() -> None:
    silhouettes = empty()
    silhouettes.add_rods(*np.array([[[3.0, 0.0, 10.0]], [[3.0, 5.0, 10.0]]]), np.array([0.1]))
    visible = seen_on_ground(silhouettes.cast(), np.array([-2.3, -1.8, 0.0, 2.8, 3.3]))
    assert (visible > 0.5).tolist() == [True, False, False, False, True]


def test_a_wall_shades_what_lies_behind_it_up_to_its_height() -> None:
    shade = box((2.0, 0.0, 5.0), (3.0, 4.0, 15.0))
    visible = seen_on_ground(shade, np.array([-2.5, -1.5, 1.5, 3.5]))
    assert visible.round(2).tolist() == [1.0, 0.0, 0.0, 1.0]


def test_the_penumbra_grows_with_the_distance_to_the_occluder() -> None:
    low, high = width_of_penumbra(0.3), width_of_penumbra(9.2)
    assert high > 2.0 * low


def test_the_suns_image_is_as_large_as_its_angle_says() -> None:
    disc = disc_of_the_sun(SUN, height=11.5)
    way = 11.5 / np.sin(SUN.elevation)
    along = 2 * way * np.tan(SUN_RADIUS) / np.sin(SUN.elevation)
    assert disc.sum() == pytest.approx(1.0, abs=1e-5)
    assert np.count_nonzero(disc.sum(0)) * CELL == pytest.approx(along, abs=2 * CELL)


def test_gaps_between_leaves_let_the_sun_through() -> None:
    silhouettes = empty()
    rng = np.random.default_rng(1)
    silhouettes.add_leaves(rng.uniform((0, 4, 8), (4, 6, 12), (900, 3)))
    visible = seen_on_ground(silhouettes.cast(), np.arange(-3.0, -2.0, 0.02))
    assert visible.min() < 0.3
    assert visible.max() > 0.7


def test_what_stands_higher_than_the_shadows_top_is_in_the_sun() -> None:
    shade = box((2.0, 0.0, 5.0), (3.0, 2.5, 15.0))
    visible = seen_from(shade, (1.0, 0.5, 10.0), (1.0, 3.0, 10.0))
    assert visible.tolist() == [0.0, 1.0]


def test_no_wall_stands_in_its_own_way() -> None:
    shade = box((-4.0, 0.0, 5.0), (-2.0, 9.0, 15.0))
    assert (seen_from(shade, (-2.0, 1.1, 10.0), (-2.0, 5.0, 10.0)) > 0.9).all()


def test_dense_shade_hides_a_part_of_the_sky() -> None:
    shade = box((0.0, 5.0, 0.0), (14.0, 5.2, 20.0))
    hidden = shade.hidden_sky(shade.ground()).levels[0]
    assert 0.3 < hidden.max() < 0.6
    assert hidden.min() == pytest.approx(0.0, abs=1e-6)

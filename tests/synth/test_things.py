"""What stands and drives on the scene: leaves, cars, houses."""

import numpy as np
import pytest

from roadeval.synth.cars import LENGTH, WIDTH, Car, paint
from roadeval.synth.grass import grass_strip
from roadeval.synth.houses import House
from roadeval.synth.light import Sun
from roadeval.synth.plants import BUSH, grow, light_left
from roadeval.synth.road import Road
from roadeval.synth.shadows import Silhouettes

SUN = Sun(elevation=np.radians(45), azimuth=np.radians(90))
STRAIGHT = Road(bends=(), bay=(1e3, 1e3))
UP = np.array([0.0, 1.0, 0.0])


def test_each_leaf_takes_its_share_from_those_below_it() -> None:
    leaves = np.array([[0.1, 1.0, 0.1], [0.1, 3.0, 0.1], [0.1, 2.0, 0.1], [5.0, 0.5, 5.0]])
    assert light_left(leaves, UP, 0.5).tolist() == [0.25, 1.0, 0.5, 1.0]


def test_blades_of_grass_are_thin_and_opaque() -> None:
    opacity = grass_strip(SUN, np.random.default_rng(2)).picture.sun[0][..., 3]
    assert set(np.unique(opacity)) == {0, 1}
    assert opacity.mean() == pytest.approx(0.425, rel=0.02)


def test_a_plant_is_brighter_on_the_side_of_the_sun() -> None:
    bush = grow(BUSH, SUN, np.random.default_rng(2))
    by_sun = bush.picture.sun[0]
    middle = by_sun.shape[1] // 2
    left, right = by_sun[:, :middle], by_sun[:, middle:]
    assert right[..., :3].sum() > 1.2 * left[..., :3].sum()


def test_a_plant_stands_within_its_picture() -> None:
    bush = grow(BUSH, SUN, np.random.default_rng(2))
    corners = bush.panel(np.array([3.0, 0.0, 8.0]), scale=2.0).corners()
    leaves = np.array([3.0, 0.0, 8.0]) + 2.0 * bush.leaves
    assert corners[:, 0].min() < leaves[:, 0].min() < leaves[:, 0].max() < corners[:, 0].max()
    assert corners[:, 1].min() == pytest.approx(0.0)
    assert leaves[:, 1].max() < corners[:, 1].max()


def car(oncoming: bool) -> Car:
    look = paint((0.2, 0.2, 0.2), oncoming, SUN)
    return Car(look, np.array([0.0, 0.0, 20.0]), heading=0.0, sunlit=1.0)


def test_a_cars_shadow_lies_away_from_the_sun() -> None:
    body, cabin = car(oncoming=False).shadow(SUN)
    assert body[:, 0].max() < WIDTH / 2
    assert cabin[:, 0].min() < body[:, 0].min() < -WIDTH / 2


def test_a_car_stands_on_a_rectangle_ahead_of_its_foot() -> None:
    corners = car(oncoming=False).footprint()
    half, near, far = WIDTH / 2, 20.0, 20.0 + LENGTH
    expected = [(-half, 0, near), (half, 0, near), (half, 0, far), (-half, 0, far)]
    np.testing.assert_allclose(corners, expected, atol=1e-9)


def test_the_cabins_shadow_is_turned_with_the_car() -> None:
    ahead, oncoming = (car(turned).shadow(SUN)[1][:, 2] for turned in (False, True))
    middle = 20.0 + LENGTH / 2
    assert oncoming.min() - 20.0 == pytest.approx(LENGTH - (ahead.max() - 20.0), abs=1e-5)
    assert ahead.mean() < middle < oncoming.mean()


def test_the_camera_sees_the_side_of_a_car_that_faces_it() -> None:
    from_left, from_right = (
        car(oncoming=False).panels(x)[1].corners()[:, 0].mean() for x in (-3.0, 3.0)
    )
    assert from_left < 0.0 < from_right


def test_a_house_in_the_sun_has_a_lit_and_a_dark_side() -> None:
    def wall(side: float) -> float:
        low, high = (
            np.array([side * 12.0 - 4.0, 0.0, 5.0]),
            np.array([side * 12.0 + 4.0, 5.0, 15.0]),
        )
        house = House(low, high, 7.0, side, (0.3, 0.3, 0.3), (0.2, 0.1, 0.1))
        silhouettes = Silhouettes(STRAIGHT, SUN, 0.0, 30.0)
        house.occlude(silhouettes)
        _, wall, _ = house.panels(silhouettes.cast(), np.random.default_rng(1))
        return float(wall.picture.sun[0][..., :3].mean())

    assert wall(side=-1.0) > 0.1
    assert wall(side=1.0) == 0.0

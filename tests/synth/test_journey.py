"""The drive's plan: three stretches, a cloud, a steady speed."""

import numpy as np
import pytest

from roadeval.synth.journey import SPEED, Journey, Stretch
from roadeval.synth.light import CASTING_BEAM
from roadeval.synth.road import Bend, Road


def drawn(seed: int) -> Journey:
    return Journey.drawn(9.0, np.random.default_rng(seed))


@pytest.mark.parametrize("seed", range(8))
def test_the_first_third_is_moderate_and_every_kind_comes_once(seed: int) -> None:
    stretches = [drawn(seed).stretch(time) for time in (0.0, 2.9, 3.1, 5.9, 6.1, 8.9)]
    assert stretches[:2] == [Stretch.MODERATE] * 2
    assert stretches[2] == stretches[3]
    assert {stretches[2], stretches[4]} == {Stretch.NONE, Stretch.HEAVY}


def test_the_order_of_the_others_depends_on_the_seed() -> None:
    assert {drawn(seed).stretches[1] for seed in range(20)} == {Stretch.NONE, Stretch.HEAVY}


@pytest.mark.parametrize("seed", range(8))
def test_the_sun_casts_shadows_except_on_the_stretch_without(seed: int) -> None:
    journey = drawn(seed)
    for time in np.arange(0.05, 9.0, 0.1):
        cast = journey.beam(time) >= CASTING_BEAM
        assert cast == (journey.stretch(time) != Stretch.NONE), time


def test_the_vehicle_keeps_its_speed_and_the_right_lane() -> None:
    road = Road(bends=(Bend(6.0, 200.0, 0.0),), bay=(1e3, 1e3))
    journey = drawn(1)
    poses = [journey.pose(time, road) for time in np.arange(0.0, 9.0, 0.5)]
    assert np.diff([pose.z for pose in poses]) == pytest.approx(SPEED * 0.5)
    offsets = [pose.x - road.centre(np.array([pose.z]))[0] for pose in poses]
    assert 0.9 < min(offsets) < max(offsets) < 2.5


def test_the_camera_sways() -> None:
    road = Road(bends=(), bay=(0.0, 0.0))
    poses = [drawn(1).pose(time, road) for time in np.arange(0.0, 9.0, 0.5)]
    for angle in ("yaw", "pitch", "roll"):
        assert np.ptp([getattr(pose, angle) for pose in poses]) > np.radians(0.4)

"""The light model: how dark and how blue a shadow is, and what counts as one."""

import numpy as np
import pytest

from roadeval.synth.light import CASTING_BEAM, SHADOW_VISIBILITY, Sun, daylight, is_shadow

SUN = Sun(elevation=np.radians(40), azimuth=np.radians(90))


def test_a_shadow_is_several_times_darker_than_the_sun_and_bluer() -> None:
    light = daylight(1.0)
    red, green, blue = light.sky / (light.sky + light.direct * SUN.towards[1])
    assert 0.12 < red < green < blue < 0.4


def test_a_cloud_takes_the_sun_and_brightens_the_sky() -> None:
    clear, cloudy = daylight(1.0), daylight(0.02)
    assert cloudy.direct.max() < 0.05 * clear.direct.max()
    assert (cloudy.sky > clear.sky).all()
    assert np.ptp(cloudy.sky / cloudy.sky.mean()) < np.ptp(clear.sky / clear.sky.mean())


def test_a_shadow_falls_away_from_the_sun_by_height_over_tangent() -> None:
    shadow = SUN.shadow_of(np.array([[0.0, 2.0, 5.0]]))
    assert shadow[0] == pytest.approx([-2.0 / np.tan(np.radians(40)), 5.0])


def test_a_surface_turned_away_is_not_lit() -> None:
    assert SUN.facing(np.array([1.0, 0.0, 0.0])) == pytest.approx(np.cos(np.radians(40)))
    assert SUN.facing(np.array([-1.0, 0.0, 0.0])) == 0.0


def test_shadow_is_where_less_than_half_of_the_sun_is_seen() -> None:
    visible = np.array([[0.0, SHADOW_VISIBILITY - 0.01, SHADOW_VISIBILITY, 1.0]])
    assert is_shadow(visible, daylight(1.0)).tolist() == [[1, 1, 0, 0]]


def test_a_sun_behind_clouds_casts_no_shadow() -> None:
    assert is_shadow(np.zeros((1, 2)), daylight(CASTING_BEAM - 0.01)).tolist() == [[0, 0]]
    assert is_shadow(np.zeros((1, 2)), daylight(CASTING_BEAM)).tolist() == [[1, 1]]

"""Panels hide what lies behind them, where geometry says they are."""

import numpy as np
import pytest

from roadeval.synth.camera import Camera, Pose
from roadeval.synth.light import daylight
from roadeval.synth.panel import Film, Panel, Picture, draw

CAMERA = Camera(160, 120, Pose(0.0, 0.0, 0.0))
NO_HAZE = np.zeros(3, np.float32)


def blank() -> Film:
    return Film(
        np.zeros((120, 160, 3), np.float32),
        np.ones((120, 160), np.float32),
        np.ones((120, 160), np.float32),
    )


def square(depth: float, opacity: float = 1.0, visible: float = 1.0) -> Panel:
    """Two metres wide, in the middle of the view."""
    image = np.full((64, 64, 4), 0.5, np.float32)
    image[..., 3] = opacity
    picture = Picture.painted(image, direct=visible, sky=1.0, visible=visible)
    corner, right = np.array([-1.0, 1.0, depth]), np.array([2.0, 0.0, 0.0])
    return Panel(picture, corner, right, np.array([0.0, -2.0, 0.0]))


def test_a_panel_is_as_large_as_its_distance_makes_it() -> None:
    film = blank()
    draw(film, CAMERA, square(10.0), daylight(1.0), NO_HAZE)
    side = np.sqrt(np.count_nonzero(film.road < 0.5))
    assert side == pytest.approx(2.0 * CAMERA.focal / 10.0, abs=1.0)
    assert film.road[60, 80] == pytest.approx(0.0)


def test_its_radiance_is_reflectance_times_light() -> None:
    film, light = blank(), daylight(1.0)
    draw(film, CAMERA, square(10.0, visible=0.25), light, NO_HAZE)
    expected = 0.5 * (0.25 * light.direct + light.sky) * np.exp(-10.0 / 2600.0)
    assert film.radiance[60, 80] == pytest.approx(expected, rel=1e-3)
    assert film.visible[60, 80] == pytest.approx(0.25)


def test_the_shade_it_stands_in_takes_the_sun_from_it() -> None:
    film, light = blank(), daylight(1.0)
    shaded = Panel(*(getattr(square(10.0), n) for n in ("picture", "corner", "right", "down")), 0.0)
    draw(film, CAMERA, shaded, light, NO_HAZE)
    assert film.visible[60, 80] == 0.0
    assert film.radiance[60, 80] == pytest.approx(0.5 * light.sky, rel=0.01)


def test_what_is_half_transparent_hides_half_of_the_road() -> None:
    film = blank()
    draw(film, CAMERA, square(10.0, opacity=0.5), daylight(1.0), NO_HAZE)
    assert film.road[60, 80] == pytest.approx(0.5)


@pytest.mark.parametrize("depth", [-10.0, 0.1])
def test_nothing_behind_the_camera_is_drawn(depth: float) -> None:
    film = blank()
    draw(film, CAMERA, square(depth), daylight(1.0), NO_HAZE)
    assert (film.road == 1.0).all()


def test_a_surface_that_passes_the_camera_is_drawn_only_ahead() -> None:
    """It slopes down to the right, to the left of and below the camera, from behind to ahead."""
    picture = Picture.painted(np.ones((64, 64, 4), np.float32), 1.0, 1.0, 1.0)
    corner, along = np.array([-3.5, 2.0, -20.0]), np.array([0.0, 0.0, 40.0])
    film = blank()
    slope = Panel(picture, corner, along, np.array([4.0, -4.0, 0.0]))
    draw(film, CAMERA, slope, daylight(1.0), NO_HAZE)
    assert film.road[110, 10] == pytest.approx(0.0)
    assert film.road[10, 150] == 1.0

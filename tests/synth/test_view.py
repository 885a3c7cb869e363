"""What the camera sees agrees with the world: paint, road, shadows."""

from dataclasses import replace

import numpy as np
import pytest

from roadeval.synth.camera import Camera, Pose
from roadeval.synth.journey import SPEED, Journey, Stretch
from roadeval.synth.light import Light, daylight, is_shadow
from roadeval.synth.noise import Field
from roadeval.synth.panel import Film
from roadeval.synth.road import HALF_WIDTH, dashed
from roadeval.synth.scene import Scene
from roadeval.synth.texture import GroundTexture
from roadeval.synth.view import Moment, see


def bare(scene: Scene) -> Scene:
    """The scene without anything that stands: shadows stay."""
    return replace(scene, panels=(), corners=np.empty((0, 4, 3)))


def look(scene: Scene, journey: Journey, time: float, light: Light, width: int = 320) -> Film:
    camera = Camera(width, width * 3 // 4, journey.pose(time, scene.road))
    return see(scene, Moment(time, camera, light, cars=()))


def plain(value: float) -> GroundTexture:
    """The same value everywhere."""
    return GroundTexture.averaged(np.full((64, 64), value, np.float32), 1.0, -32.0, 0.0)


def along_centre_line(scene: Scene, journey: Journey, time: float, ahead: Field) -> Field:
    """Brightness of the centre line at distances ahead of the vehicle."""
    camera = Camera(640, 480, journey.pose(time, scene.road))
    film = see(bare(scene), Moment(time, camera, daylight(0.0), cars=()))
    z = camera.pose.z + ahead
    points = np.stack([scene.road.centre(z), np.zeros_like(z), z], axis=1)
    column, row = np.rint(camera.project(points)).astype(int).T
    return film.radiance[row, column, 1]


def test_the_markings_come_nearer_by_the_way_driven(scene: Scene, journey: Journey) -> None:
    ahead = np.arange(7.0, 19.0, 0.05)
    now = along_centre_line(scene, journey, 4.0, ahead)
    then = along_centre_line(scene, journey, 4.1, ahead)
    steps = np.arange(0, 60)
    likeness = [np.corrcoef(now[k:], then[: len(then) - k])[0, 1] for k in steps]
    assert steps[np.argmax(likeness)] * 0.05 == pytest.approx(SPEED * 0.1, abs=0.15)


def test_the_dashes_lie_where_the_road_has_them(scene: Scene, journey: Journey) -> None:
    ahead = np.arange(7.0, 19.0, 0.05)
    seen = along_centre_line(scene, journey, 4.0, ahead)
    painted = dashed(journey.distance(4.0) + ahead, np.full_like(ahead, 0.05))
    assert np.corrcoef(seen, painted)[0, 1] > 0.8


def test_road_truth_is_where_the_asphalt_is(scene: Scene, journey: Journey) -> None:
    film = look(bare(scene), journey, 1.0, daylight(1.0))
    camera = Camera(320, 240, journey.pose(1.0, scene.road))
    for offset, expected in ((-HALF_WIDTH - 0.4, 0), (-HALF_WIDTH + 0.4, 1), (0.0, 1), (3.0, 1)):
        z = camera.pose.z + np.arange(8.0, 15.0)
        points = np.stack([scene.road.centre(z) + offset, 0 * z, z], axis=1)
        column, row = np.rint(camera.project(points)).astype(int).T
        inside = (column >= 0) & (column < 320) & (row < 240)
        assert inside.any()
        assert (film.road[row[inside], column[inside]] == expected).all()


def edges_seen(scene: Scene, z: float) -> list[float]:
    """Metres across the road from the centre line to its left and right edge, as they are seen."""
    at = np.array([z])
    centre = float(scene.road.centre(at)[0])
    camera = Camera(640, 480, Pose(centre + 1.2, 3.0, z - 10.0, pitch=-0.25))
    film = see(bare(scene), Moment(0.0, camera, daylight(0.0), cars=()))
    offset = np.arange(-4.5, 6.9, 0.005)
    points = np.stack([centre + offset, 0 * offset, np.full_like(offset, z)], axis=1)
    column, row = np.rint(camera.project(points)).astype(int).T
    across = offset[film.road[row, column] == 1] * np.cos(np.arctan(scene.road.slope(at)[0]))
    return [float(across.min()), float(across.max())]


def test_the_road_is_as_wide_as_two_lanes_and_wider_at_the_lay_by(scene: Scene) -> None:
    begin, end = scene.road.bay
    widths = {begin - 5.0: 3.4, begin + 4.5: 3.4 + 1.15, begin + 9.5: 5.7, end - 4.5: 3.4 + 1.15}
    for z, right in widths.items():
        assert edges_seen(scene, z) == pytest.approx([-3.4, right], abs=0.05), z


def test_nothing_above_the_horizon_is_road_or_shadow(scene: Scene, journey: Journey) -> None:
    film = look(bare(scene), journey, 1.0, daylight(1.0))
    camera = Camera(320, 240, journey.pose(1.0, scene.road))
    sky = camera.rays()[..., 1] > 0
    assert not film.road[sky].any()
    assert (film.visible[sky] == 1.0).all()


def test_what_stands_on_the_verge_hides_no_road_but_is_none(scene: Scene, journey: Journey) -> None:
    with_things = look(scene, journey, 1.0, daylight(1.0)).road
    without = look(bare(scene), journey, 1.0, daylight(1.0)).road
    assert (with_things <= without + 1e-6).all()


def test_shadow_truth_is_where_the_direct_light_is_blocked(scene: Scene, journey: Journey) -> None:
    begin, _ = journey.extent(Stretch.HEAVY)
    time = begin / SPEED + 1.0
    direct_only = replace(daylight(1.0), sky=np.zeros(3, np.float32))
    shaded = look(bare(scene), journey, time, direct_only)
    unshaded = look(replace(bare(scene), sunlight=plain(1.0)), journey, time, direct_only)
    near = np.s_[160:]
    reaching = (shaded.radiance / unshaded.radiance)[near][..., 1]
    truth = is_shadow(shaded.visible, daylight(1.0))[near].astype(bool)
    assert 0.2 < truth.mean() < 0.99
    assert reaching[truth].max() < 0.55
    assert reaching[~truth].min() > 0.45


def test_shadows_on_the_road_are_as_dark_and_as_blue_as_the_sky_says(
    scene: Scene, journey: Journey
) -> None:
    begin, _ = journey.extent(Stretch.HEAVY)
    light = daylight(1.0)
    under_open_sky = replace(bare(scene), hidden_sky=plain(0.0))
    film = look(under_open_sky, journey, begin / SPEED + 1.0, light)
    near, road = np.s_[160:], film.road[160:] > 0
    dark = film.radiance[near][road & (film.visible[near] < 0.02)].mean(0)
    lit = film.radiance[near][road & (film.visible[near] > 0.98)].mean(0)
    sky_alone = light.sky / (light.sky + light.direct * scene.sun.towards[1])
    assert dark / lit == pytest.approx(sky_alone, rel=0.1)


def test_dense_shade_is_darker_than_the_open_sky_alone(scene: Scene, journey: Journey) -> None:
    begin, _ = journey.extent(Stretch.HEAVY)
    time = begin / SPEED + 1.0
    here = look(bare(scene), journey, time, daylight(1.0))
    open_sky = look(replace(bare(scene), hidden_sky=plain(0.0)), journey, time, daylight(1.0))
    dark = here.visible[160:] < 0.02
    assert here.radiance[160:][dark].mean() < 0.9 * open_sky.radiance[160:][dark].mean()

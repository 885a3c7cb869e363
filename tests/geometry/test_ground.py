"""Pixels to metres and back, against the synthetic world's camera and against OpenCV."""

import math
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.world.camera import Camera, Pose
from roadeval import RoadevalError, configure
from roadeval.config.tables import ConfigError
from roadeval.data import Calibration, Mounting
from roadeval.geometry.ground import OUTSIDE, Ground, Plan, ground_of
from roadeval.geometry.settings import GroundSettings

SIZE = 640, 480
PLACES = np.random.default_rng(0).uniform([4, -6], [60, 6], (500, 2))
FISHEYE = (-0.02, 0.003, -0.001, 0.0002)
LENSES = {
    "plumb_bob": (-0.3, 0.1, 0.001, -0.002, 0.01),
    "rational_polynomial": (0.2, -0.1, 0.001, 0.0005, 0.02, 0.3, -0.05, 0.01),
    "equidistant": FISHEYE,
    "fisheye": (0.0, 0.0, 0.0, 0.0),
}
OPTICAL = Rotation.from_matrix([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
PRISM = (-0.2, 0.05, 0.001, 0.002, 0.01, 0.1, 0.0, 0.0, 0.01, -0.02, 0.01, 0.003)


def made(**settings: object) -> Ground:
    all_settings = {"height": 1.3, "pitch": 4.0, "roll": 2.0, "focal": (560.0,), **settings}
    ground, why = ground_of(None, GroundSettings(**all_settings), SIZE)  # type: ignore[arg-type]
    assert ground is not None, why
    return ground


def pose(ground: Ground) -> tuple[float, ...]:
    """The height in metres; pitch and roll in degrees."""
    turn, origin = ground.axes()
    body = Rotation.from_matrix(turn.T) * OPTICAL.inv()
    _, pitch, roll = body.as_euler("ZYX", degrees=True)
    return -(turn.T @ origin)[2], pitch, roll


def test_places_are_seen_where_the_synthetic_world_draws_them():
    pose = Pose(0, 1.3, 0, pitch=-math.radians(4), roll=math.radians(2))
    world = np.column_stack([-PLACES[:, 1], np.zeros(len(PLACES)), PLACES[:, 0]])
    seen = made().pixels(PLACES)
    assert np.abs(seen - Camera(*SIZE, pose).project(world)).max() < 1e-6
    assert np.abs(made().places(seen) - PLACES).max() < 1e-6


@pytest.mark.parametrize(("model", "numbers"), [*LENSES.items(), ("plumb_bob", PRISM)])
def test_a_lens_bends_as_opencv_says_and_back(model: str, numbers: tuple[float, ...]):
    ground = made(model=model, distortion=numbers)
    seen = ground.pixels(PLACES)
    inside = ((seen >= 0) & (seen < SIZE)).all(axis=1)
    assert inside.sum() > 400
    assert np.abs(ground.places(seen) - PLACES)[inside].max() < 1e-6
    turn, origin = ground.axes()
    is_fisheye = model in ("equidistant", "fisheye")
    project = cv2.fisheye.projectPoints if is_fisheye else cv2.projectPoints
    points = np.column_stack([PLACES, np.zeros(len(PLACES))])[:, None]
    matrix, distortion = np.reshape(ground.matrix, (3, 3)), np.array(numbers)
    expected = project(points, Rotation.from_matrix(turn).as_rotvec(), origin, matrix, distortion)
    assert np.abs(expected[0].reshape(-1, 2) - seen)[inside].max() < 1e-6


def test_a_polynomial_does_not_bend_far_rays_back_into_the_picture():
    ground = made(model="plumb_bob", distortion=(-0.4, 0.0, 0.0, 0.0))
    beside = np.column_stack([np.full(200, 3.0), np.linspace(-30, 30, 200)])
    seen = ground.pixels(beside)
    visible = np.isfinite(seen).all(axis=1)
    assert 0 < visible.sum() < 200
    assert np.abs(ground.places(seen[visible]) - beside[visible]).max() < 1e-3


@pytest.mark.parametrize(
    ("model", "numbers"),
    [
        ("plumb_bob", (-0.45, 0.25, 0.0, 0.0, -0.08)),
        ("plumb_bob", (-0.4, 0.0, 0.0, 0.0)),
        ("rational_polynomial", (0.0, 0.0, 0.0, 0.0, 0.0, 0.6, 0.0, 0.0)),
        ("equidistant", (-0.35, 0.02, 0.0, 0.0)),
        ("equidistant", (0.0, 0.0, 0.0, 0.0)),
    ],
)
def test_a_pixel_that_no_ray_reaches_lies_nowhere(model: str, numbers: tuple[float, ...]):
    ground = made(model=model, distortion=numbers, focal=(180.0,), pitch=30.0)
    pixels = np.stack(np.meshgrid(np.arange(640.0), np.arange(480.0)), axis=-1).reshape(-1, 2)
    away = np.hypot(*(pixels - np.array([319.5, 239.5])).T) / 180
    slopes = np.linspace(0, 60, 600_001)
    k = (*numbers, *(0.0,) * 4)
    angle = np.arctan(slopes)
    seen = angle * (1 + k[0] * angle**2 + k[1] * angle**4)
    if model != "equidistant":
        over = 1 + k[0] * slopes**2 + k[1] * slopes**4 + k[4] * slopes**6
        seen = slopes * over / (1 + k[5] * slopes**2)
    farthest = seen[: np.argmax(np.append(np.diff(seen), -1) <= 0) + 1].max()
    rays = ground.rays(pixels)
    is_seen = np.isfinite(rays).all(axis=1)
    assert not is_seen[away > farthest + 0.02].any()
    assert is_seen[away < farthest - 0.02].all()
    assert 0 < is_seen.sum() < len(pixels)


@pytest.mark.parametrize(
    ("model", "numbers", "same"),
    [
        ("equidistant", (*FISHEYE, 0.0), ("equidistant", FISHEYE)),
        ("equidistant", (*FISHEYE, *(0.0,) * 8), ("equidistant", FISHEYE)),
        ("equidistant", (-0.02,), ("equidistant", (-0.02, 0.0, 0.0, 0.0))),
        ("equidistant", (), ("equidistant", (0.0,) * 4)),
        ("Plumb_Bob ", (-0.3, 0.1), ("plumb_bob", (-0.3, 0.1, 0.0, 0.0))),
        ("radtan", (-0.3, 0.1, 0.0, 0.01), ("plumb_bob", (-0.3, 0.1, 0.0, 0.01))),
        ("plumb_bob", (-0.3, 0.1, 0.0, 0.0, 0.0, 0.0), ("plumb_bob", (-0.3, 0.1, 0.0, 0.0))),
        ("none", (0.0,) * 5, ("", ())),
        ("inverse_brown_conrady", (0.0,) * 5, ("", ())),
    ],
)
def test_zeros_may_follow_the_numbers_of_a_model_or_be_missing(model, numbers, same):
    seen = made(model=model, distortion=numbers, focal=(400.0,)).pixels(PLACES)
    expected = made(model=same[0], distortion=same[1], focal=(400.0,)).pixels(PLACES)
    assert seen == pytest.approx(expected, nan_ok=True)


def test_nothing_is_on_the_ground_from_the_horizon_upwards():
    ground = made(roll=0.0)
    horizon = (SIZE[1] - 1) / 2 - 560 * math.tan(math.radians(4))
    rows = np.array([[320, horizon - 1], [320, horizon + 1]])
    above, below = ground.places(rows)
    assert np.isnan(above).all()
    assert below[0] > 300
    assert np.isnan(ground.pixels(np.array([[-5.0, 0.0]]))).all()


def test_a_pixel_covers_more_the_farther_it_lies():
    along, across = made(roll=0.0).pixel_at(20)
    slope = math.atan(1.3 / 20)
    assert across == pytest.approx(math.hypot(20, 1.3) * math.cos(slope - math.radians(4)) / 560)
    assert along == pytest.approx(across * math.hypot(20, 1.3) / 1.3, rel=0.02)


def test_a_camera_that_moves_is_where_it_moved_to():
    assert pose(made().moved(pitch=1, height=0.05)) == pytest.approx((1.35, 5, 2))


def test_reduced_images_show_the_same_places_at_reduced_pixels():
    less = made().scaled(320, 160).pixels(PLACES)
    assert less + 0.5 == pytest.approx((made().pixels(PLACES) + 0.5) / [2, 3])


def test_a_homography_is_what_four_corners_say():
    places = np.array([[6.0, 3], [6, -3], [30, 3], [30, -3]])
    seen = made().pixels(places)
    homography, _ = cv2.findHomography(seen, places)
    alone, _ = ground_of(None, GroundSettings(homography=tuple(homography.ravel())), SIZE)
    assert alone.pixels(PLACES) == pytest.approx(made().pixels(PLACES), abs=1e-3)
    with pytest.raises(RoadevalError, match="homography alone"):
        alone.moved(pitch=1)
    settings = GroundSettings(homography=tuple(-7 * homography.ravel()), focal=(560.0,))
    posed, _ = ground_of(None, settings, SIZE)
    assert pose(posed.moved()) == pytest.approx((1.3, 4, 2), abs=1e-4)


def mounted(parent: str, at: tuple[float, ...], pitch: float, yaw: float = 0.0) -> Calibration:
    turn = Rotation.from_euler("ZYX", [yaw, pitch, 2.0], degrees=True) * OPTICAL
    mounting = Mounting(parent, at, tuple(turn.as_quat()))
    matrix = (560.0, 0, 319.5, 0, 560.0, 239.5, 0, 0, 1.0)
    return Calibration("/info", *SIZE, matrix, "plumb_bob", (0.0,) * 5, "cam", mounting)


def test_transforms_give_angles_and_on_a_footprint_the_height():
    calibration = mounted("base_footprint", (1.5, 0.2, 1.3), pitch=4, yaw=30)
    ground, why = ground_of(calibration, GroundSettings(), SIZE)
    assert ground.pixels(PLACES) == pytest.approx(made().pixels(PLACES))
    expected = "camera 1.30 m above it, pitch 4.0\N{DEGREE SIGN} down, roll 2.0\N{DEGREE SIGN}"
    covers = "a pixel covers 0.14 m of the way 10 m ahead, 2.2 m at 40"
    assert why == f"metres: flat ground, {expected}; {covers}"


def test_what_a_file_says_replaces_what_the_log_says():
    calibration = mounted("base_footprint", (1.5, 0.2, 1.3), pitch=4)
    lens = {"model": "plumb_bob", "distortion": LENSES["plumb_bob"]}
    settings = GroundSettings(height=1.5, pitch=3.0, roll=-1.0, **lens)
    ground, _ = ground_of(calibration, settings, SIZE)
    assert pose(ground) == pytest.approx((1.5, 3, -1))
    assert ground.distortion == LENSES["plumb_bob"]


def test_a_centre_far_from_the_middle_is_told():
    settings = GroundSettings(height=1.3, pitch=4, focal=(560.0,), centre=(639.5, 479.5))
    _, why = ground_of(None, settings, SIZE)
    assert "its centre, 639.5, 479.5, is far from the middle of 640x480 pixels" in why


def test_intrinsics_may_be_for_images_of_another_size():
    larger = made(size=(1280, 960), focal=(1120.0,), centre=(639.5, 479.5))
    assert larger.pixels(PLACES) == pytest.approx(made().pixels(PLACES))
    assert made(focal=(), fov=60.0).matrix[0] == pytest.approx(320 / math.tan(math.radians(30)))


PLACED = {"height": 1.0, "pitch": 1.0, "fov": 60.0}


@pytest.mark.parametrize(
    ("calibration", "fields", "reason"),
    [
        (mounted("base_link", (1.5, 0, 1.3), 4), {}, "height above the ground: the log has it"),
        (mounted("base_footprint", (1.5, 0, -1.3), 4), {}, "above the ground: the log says -1.3 m"),
        (mounted("base_footprint", (1.5, 0, 1e8), 4), {}, "above the ground: the log says 1e+08 m"),
        (None, {"height": 1.4, "pitch": 1.0}, "the focal length is missing"),
        (None, {"height": 1.4, "fov": 60.0}, "missing: its pitch"),
        (None, {"fov": 60.0}, "the camera's height above the ground, and its pitch"),
        (None, {"height": 1.4, "pitch": -40.0, "fov": 60.0}, "it looks up"),
        (
            None,
            {"model": "mei", "distortion": (1.0,)} | PLACED,
            "unknown distortion model mei of 1 numbers",
        ),
        (None, {"model": "radtan", "distortion": (0.1,) * 14} | PLACED, "radtan of 14 numbers"),
        (None, {"model": "double_sphere"} | PLACED, "double_sphere of 0 numbers"),
        (None, {"model": "fisheye", "distortion": (0.1,) * 5} | PLACED, "fisheye of 5 numbers"),
    ],
)
def test_what_is_missing_is_said(
    calibration: Calibration | None, fields: dict[str, float], reason: str
):
    ground, why = ground_of(calibration, GroundSettings(**fields), SIZE)  # type: ignore[arg-type]
    assert ground is None
    assert reason in why


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"fov": 60.0, "focal": (500.0,)}, "give one"),
        ({"homography": (1.0, 2.0)}, "nine numbers"),
        ({"homography": (1.0,) * 9, "height": 1.0}, "leave them out"),
        ({"centre": (1.0,)}, "two numbers"),
        ({"distortion": (1.0,)}, "needs its model"),
    ],
)
def test_settings_that_do_not_go_together_are_refused(fields: dict[str, float], reason: str):
    with pytest.raises(ValueError, match=reason):
        GroundSettings(**fields)  # type: ignore[arg-type]


def test_a_homography_of_zeros_is_refused():
    with pytest.raises(RoadevalError, match="cannot be inverted"):
        ground_of(None, GroundSettings(homography=(0.0,) * 9), SIZE)


@pytest.mark.parametrize(
    "fields",
    [
        {"size": (0, 0), "focal": (150.0,)},
        {"size": (-640, -480), "focal": (150.0,)},
        {"size": (640, 360), "focal": (150.0,)},
        {"focal": (1e-300,)},
        {"focal": (-500.0,)},
        {"focal": (500.0, 50_000.0)},
        {"centre": (math.nan, 2.0), "focal": (150.0,)},
        {"centre": (1e18, 0.0), "focal": (150.0,)},
        {"distortion": (math.nan, 0.0, 0.0, 0.0), "model": "plumb_bob", "focal": (500.0,)},
        {"distortion": (1e300, 0.0, 0.0, 0.0), "model": "plumb_bob", "focal": (500.0,)},
        {"homography": (1e300, 0.0, 0.0, 0.0, 1e300, 0.0, 0.0, 0.0, 1.0)},
        {"homography": (math.nan, *(1.0,) * 8)},
    ],
)
def test_a_camera_that_cannot_be_is_refused_by_the_name_of_its_setting(fields: dict[str, Any]):
    with pytest.raises(RoadevalError, match=rf"^`ground\.{next(iter(fields))}`"):
        ground_of(None, GroundSettings(**fields), SIZE)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("size", [0, 0]),
        ("size", [-640, -480]),
        ("centre", [math.nan, 2.0]),
        ("centre", [0.0, -math.inf]),
        ("distortion", [1e300]),
        ("homography", [math.nan] * 9),
        ("height", math.nan),
        ("pitch", math.nan),
        ("fov", 1e-300),
    ],
)
def test_a_file_with_a_number_that_no_camera_has_is_refused(name: str, content: object):
    with pytest.raises(ConfigError, match=rf"ground\.{name}"):
        configure({"ground": {name: content}})


@pytest.mark.parametrize(
    ("name", "last", "beyond"),
    [
        ("height", 0.01, 0.009),
        ("height", 1000, 1001),
        ("pitch", 89.9, 90),
        ("pitch", -89.9, -90),
        ("roll", -180, -181),
        ("roll", 180, 181),
        ("fov", 0.5, 0.4),
        ("fov", 175, 176),
        ("focal", [1e6, 1e6], [1.0, 1.0, 1.0]),
        ("centre", [-1e6, 0.0], [-1_000_001.0, 0.0]),
        ("centre", [0.0, 1e6], [0.0, 1_000_001.0]),
        ("size", [65_536, 1], [65_537, 1]),
    ],
)
def test_a_number_is_taken_up_to_its_limit(name: str, last: object, beyond: object):
    configure({"ground": {name: last}})
    with pytest.raises(ConfigError, match=rf"ground\.{name}"):
        configure({"ground": {name: beyond}})


def test_a_plan_shows_the_pixel_in_which_each_cell_lies():
    ground = made()
    plan = Plan(ground, 6, 46, 20, 0.5)
    image = np.arange(SIZE[0] * SIZE[1]).reshape(SIZE[::-1])
    picture = plan.picture(image, nothing=-5)
    for row, column in np.ndindex(picture.shape):
        place = 46 - 0.25 - 0.5 * row, 10 - 0.25 - 0.5 * column
        x, y = np.rint(ground.pixels(np.array([place]))[0])
        inside = 0 <= x < SIZE[0] and 0 <= y < SIZE[1]
        assert picture[row, column] == (image[int(y), int(x)] if inside else -5)
    assert (plan.cells == OUTSIDE).any()


def test_distances_are_those_of_places_and_roofs_are_before_the_horizon():
    ground = made(model="plumb_bob", distortion=(-0.1, 0.02, 0, 0))
    metres = ground.distances()
    rows, columns = np.mgrid[: ground.height, : ground.width].reshape(2, -1)
    places = ground.places(np.column_stack([columns, rows]).astype(float))
    along = np.hypot(*places.T).reshape(metres.shape)
    assert np.array_equal(np.isnan(along), ~(metres > 0))
    assert np.allclose(metres[metres > 0], along[metres > 0])
    assert (metres[0] < 0).all()

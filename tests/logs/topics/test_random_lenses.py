"""Random CameraInfo in logs, against a plain projection."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from roadeval.geometry.settings import GroundSettings
from roadeval.logs.log import open_log
from roadeval.logs.settings import LogConfig
from tests.logs.topics.test_calibration import SIZE, info, ros2

HEIGHT, PITCH = 1.4, 9.0
PLACES = np.random.default_rng(1).uniform([2, -8], [30, 8], (60, 2))


def bent(x: float, y: float, model: str, d: list[float]) -> tuple[float, float]:
    """Where a lens shows a ray, by the formulas of ROS's REP 142 and of OpenCV's fisheye."""
    r = math.hypot(x, y)
    if model == "equidistant":
        angle = math.atan(r)
        seen = angle + sum(k * angle ** (3 + 2 * n) for n, k in enumerate(d[:4]))
        return x * seen / r, y * seen / r
    k1, k2, p1, p2, k3, k4, k5, k6 = (*d, *[0.0] * 8)[:8]
    radial = (1 + k1 * r**2 + k2 * r**4 + k3 * r**6) / (1 + k4 * r**2 + k5 * r**4 + k6 * r**6)
    return (
        x * radial + 2 * p1 * x * y + p2 * (r**2 + 2 * x**2),
        y * radial + p1 * (r**2 + 2 * y**2) + 2 * p2 * x * y,
    )


def drawn(random: np.random.Generator) -> tuple[dict[str, Any], str, np.ndarray]:
    """A CameraInfo, the topic of its images, and the pixels of `PLACES`."""
    width, height = SIZE
    pitch = math.radians(PITCH)
    model, d = [
        ("plumb_bob", [*random.uniform(-0.1, 0.1, 2), *random.uniform(-0.005, 0.005, 2), 0.0]),
        ("plumb_bob", [*random.uniform(-0.1, 0.1, 2), 0.001, -0.002, *[0.0] * 9]),
        ("rational_polynomial", [*random.uniform(0, 0.1, 8) / [1, 1, 50, 50, 1, 1, 1, 1]]),
        ("equidistant", [*random.uniform(-0.02, 0.02, 4), *[0.0] * int(random.integers(3))]),
        ("equidistant", [0.0] * 4),
        ("plumb_bob", [0.0] * 5),
    ][random.integers(6)]
    way = random.choice(["as it is", "binned", "region", "both", "scaled"])
    binning = (1, 1)
    if way in ("binned", "both"):
        binning = int(random.integers(1, 4)), int(random.integers(1, 4))
    part = width * binning[0], height * binning[1]
    corner = (int(random.integers(1, 90)), int(random.integers(1, 90)))
    corner = corner if way in ("region", "both") else (0, 0)
    whole = (part[0] + 2 * corner[0], part[1] + 2 * corner[1])
    scale = float(random.choice([0.5, 0.8, 2.0, 4.0])) if way == "scaled" else 1.0
    whole = round(whole[0] / scale), round(whole[1] / scale)
    focal = random.uniform(0.6, 1.2, 2) * whole[0]
    focal[1] = focal[0] * random.uniform(0.9, 1.1) * binning[1] / binning[0]
    centre = np.array(whole) * random.uniform(0.45, 0.55, 2)
    topic = str(random.choice(["/front/image_raw", "/front/rect/image", "/front/image_rect_color"]))
    flat = (focal * random.uniform(0.8, 0.95), centre + random.uniform(1, 2, 2))
    is_flat = "rect" in topic
    pixels = []
    for ahead, left in PLACES:
        forward = ahead * math.cos(pitch) + HEIGHT * math.sin(pitch)
        x, y = -left / forward, (HEIGHT * math.cos(pitch) - ahead * math.sin(pitch)) / forward
        f, c = flat if is_flat else (focal, centre)
        x, y = (x, y) if is_flat else bent(x, y, model, d)
        u = np.array([x, y]) * f + c
        pixels.append((u - corner) / binning if scale == 1 else (u + 0.5) * scale - 0.5)
    f, c = flat
    told = {
        "model": model,
        "d": d,
        "size": whole,
        "k": [focal[0], 0.0, centre[0], 0.0, focal[1], centre[1], 0.0, 0.0, 1.0],
        "p": [f[0], 0.0, c[0], 0.0, 0.0, f[1], c[1], 0.0, 0.0, 0.0, 1.0, 0.0],
        "binning": binning,
        "roi": (*corner, *part) if corner != (0, 0) else (0, 0, 0, 0),
    }
    return told, topic, np.array(pixels)


@pytest.mark.parametrize("tens", range(20))
def test_places_are_seen_where_a_plain_projection_sees_them(tmp_path: Path, tens: int):
    config = LogConfig(ground=GroundSettings(height=HEIGHT, pitch=PITCH, roll=0.0))
    for seed in range(10 * tens, 10 * tens + 10):
        told, topic, expected = drawn(np.random.default_rng(seed))
        path = ros2(tmp_path / f"{seed}.mcap", {"/front/info": info(**told)}, [], topic)
        with open_log(path, config) as log:
            selection = log.select()
        ground = selection.ground
        inside = ((expected >= 0) & (expected <= np.array(SIZE) - 1)).all(axis=1)
        assert inside.any()
        assert ground.pixels(PLACES)[inside] == pytest.approx(expected[inside], abs=1e-6), seed
        assert ground.places(expected[inside]) == pytest.approx(PLACES[inside], abs=1e-4), seed

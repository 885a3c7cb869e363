"""Rays, projection and clipping agree with one another."""

import numpy as np
import pytest

from roadeval.synth.camera import NEAR, Camera, Pose

TURNED = Camera(160, 120, Pose(1.0, 1.4, 5.0, yaw=0.1, pitch=-0.05, roll=0.02))


def test_a_point_on_a_pixels_ray_projects_to_that_pixel() -> None:
    point = TURNED.position + 7.0 * TURNED.rays()[90, 33]
    assert TURNED.project(point[None])[0] == pytest.approx([33.0, 90.0], abs=1e-3)
    assert TURNED.depth(point[None])[0] == pytest.approx(7.0, abs=1e-5)


def test_axes_are_perpendicular_and_of_unit_length() -> None:
    axes = TURNED.pose.axes()
    assert axes @ axes.T == pytest.approx(np.eye(3))


def test_looking_down_raises_the_horizon() -> None:
    far = np.array([[0.0, 0.0, 1e6]])
    level = Camera(160, 120, Pose(0.0, 0.0, 0.0))
    down = Camera(160, 120, Pose(0.0, 0.0, 0.0, pitch=-0.1))
    assert level.project(far)[0] == pytest.approx([79.5, 59.5])
    assert down.project(far)[0, 1] < 59.5


def test_a_positive_yaw_looks_right() -> None:
    right = Camera(160, 120, Pose(0.0, 0.0, 0.0, yaw=0.1))
    assert right.project(np.array([[0.0, 0.0, 10.0]]))[0, 0] < 79.5


def test_an_outline_is_cut_where_it_passes_behind_the_camera() -> None:
    camera = Camera(160, 120, Pose(0.0, 0.0, 0.0))
    floor = np.array([[-1.0, -1.0, -5.0], [1.0, -1.0, -5.0], [1.0, -1.0, 5.0], [-1.0, -1.0, 5.0]])
    assert len(camera.outline(floor)) == 4
    assert camera.outline(floor)[:, 1].max() == pytest.approx(59.5 + camera.focal / NEAR)
    assert len(camera.outline(floor - (0.0, 0.0, 10.0))) == 0


def test_what_lies_behind_or_beside_or_is_tiny_is_not_caught() -> None:
    camera = Camera(160, 120, Pose(0.0, 0.0, 0.0))
    ahead = np.array([[-1.0, 1.0, 9.0], [1.0, 1.0, 9.0], [1.0, -1.0, 9.0], [-1.0, -1.0, 9.0]])
    corners = np.stack([ahead, ahead - (0, 0, 20), ahead - (50, 0, 0), ahead * (1, 0.001, 1)])
    assert camera.catches(corners).tolist() == [True, False, False, False]

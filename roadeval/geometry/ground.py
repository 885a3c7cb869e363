"""Flat ground under a camera: where on it a pixel lies, in metres, and where a place is seen.

Places are ``(n, 2)``: metres ahead of the point of the ground below the camera, in the direction in
which the camera looks, and metres to the left of that line (REP 103). Pixels are ``(n, 2)``: column
and row, the centre of the first pixel at (0, 0), as in OpenCV and ROS. The lens is OpenCV's model
of the same name. Slopes and bumps bend the ground: what is said here then errs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from roadeval.data import Calibration, Mounting
from roadeval.data.arrays import Floats, Matrix
from roadeval.data.calibration import FISHEYE
from roadeval.errors import RoadevalError
from roadeval.geometry.settings import GroundSettings
from roadeval.runtime.sentence import Sentence

GROUND_FRAMES: Final = ("base_footprint",)
"""Frames of a vehicle that lie on the ground (REP 120)."""
COEFFICIENTS: Final = {
    **dict.fromkeys(("plumb_bob", "rational_polynomial", "radtan"), (0, 4, 5, 8, 12)),
    **dict.fromkeys(FISHEYE, (4,)),
    **dict.fromkeys(("", "none", "pinhole", "perspective", "undistorted"), (0,)),
    **dict.fromkeys(("brown_conrady", "inverse_brown_conrady", "modified_brown_conrady"), (0,)),
}
"""How many numbers the models have, by their names; zeros may follow, or be missing."""
STATED: Final = (10, 40)
"""Metres ahead at which it is said how much of the way a pixel covers."""
LOWEST, HIGHEST = 0.01, 1000.0
"""Metres of a camera above the ground, at least and at most."""
TOLERANCE: Final = 1e-6
"""A ray must lead back to its pixel within this, in units of the focal length."""
STEPS: Final = 30
"""How often a ray is corrected, at most."""
AXES: Final = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""The rotation from ahead, left and up to a camera's right, down and forward."""


class GroundError(RoadevalError):
    """A camera of which no ground can be made."""


@dataclass(frozen=True)
class Ground:
    """Flat ground, and a camera over it."""

    width: int
    height: int
    """Size of its images in pixels."""
    matrix: tuple[float, ...]
    """Nine numbers, row by row: from a ray's direction to its pixel."""
    plane: tuple[float, ...]
    """Nine numbers: from metres ahead, metres to the left, and 1 to the direction of the ray."""
    model: str = ""
    distortion: tuple[float, ...] = ()
    """As many numbers as the model has; a fisheye without any has four zeros."""
    is_posed: bool = True
    """Whether `plane` is a place and angles, and not only a homography."""

    def scaled(self, width: int, height: int) -> Ground:
        """Return the ground for the same images in another size."""
        factors = np.array([width / self.width, height / self.height, 1.0])
        matrix = np.reshape(self.matrix, (3, 3)) * factors[:, None]
        matrix += (factors / 2 - 0.5)[:, None] * matrix[2]
        return replace(self, width=width, height=height, matrix=_flat(matrix))

    def pixels(self, places: Matrix) -> Matrix:
        """Return where places are seen, ``(n, 2)``; NaN where no ray from them meets the lens.

        Pixels may lie outside the image.
        """
        rays = _mapped(self.plane, places)
        if self.distortion:
            # A polynomial that folds bends rays from far outside the picture back into it.
            rays[~(np.hypot(*rays.T) <= self._curve[0][-1])] = np.nan
            rays = _bent(rays, self.model, self.distortion)
        return _mapped(self.matrix, rays)

    def places(self, pixels: Matrix) -> Matrix:
        """Return where on the ground pixels lie, ``(n, 2)``; NaN from the horizon upwards."""
        return self.places_of(self.rays(pixels))

    def places_of(self, rays: Matrix) -> Matrix:
        """Return where on the ground some `rays` end, ``(n, 2)``; NaN from the horizon upwards."""
        return _mapped(_inverse(self.plane), rays)

    def pixel_at(self, ahead: float) -> tuple[float, float]:
        """Return how many metres a pixel covers straight ahead: along, and across; NaN unseen."""
        (at,) = self.pixels(np.array([[ahead, 0.0]]))
        steps = np.array([[0, -0.5], [0, 0.5], [-0.5, 0], [0.5, 0]])
        up, down, left, right = self.places(at + steps)
        return float(np.linalg.norm(up - down)), float(np.linalg.norm(right - left))

    def moved(self, pitch: float = 0.0, height: float = 0.0) -> Ground:
        """Return the ground if the camera looked down by more degrees, and were higher by metres.

        A `GroundError` where its place and angles are not known.
        """
        if not (pitch or height):
            return self
        if not self.is_posed:
            raise GroundError("a homography alone does not tell the camera's height and angles")
        turn, origin = self.axes()
        at = -turn.T @ origin
        at[2] += height
        return replace(self, plane=_plane(turn @ _rotation(LEFT, pitch).T, at))

    def axes(self) -> tuple[Matrix, Floats]:
        """Return the rotation from ahead, left, up to the camera's axes, and the origin there."""
        first, second, third = np.reshape(self.plane, (3, 3)).T
        return np.stack([first, second, np.cross(first, second)], axis=1), third

    @cached_property
    def _curve(self) -> tuple[Floats, Floats]:
        """Slopes of rays, and the distances from the centre at which they are seen.

        It ends where the polynomial folds: from there on two rays would have the same pixel.
        """
        slopes = np.tan(np.linspace(0, math.radians(89.9), 10_000))
        seen = slopes * _growth(slopes, self.model, self.distortion)
        falls = ~(np.diff(seen) > 0)
        end = int(np.argmax(falls)) + 1 if falls.any() else len(seen)
        return slopes[:end], seen[:end]

    def rays(self, pixels: Matrix) -> Matrix:
        """Return the rays of pixels in units of the focal length, ``(n, 2)``: right, and down.

        NaN where there is none, or one at more than a right angle to the camera's own.
        """
        wanted = _mapped(_inverse(self.matrix), pixels)
        if not self.distortion:
            return wanted
        slopes, seen = self._curve
        aim, rays, missed = wanted.copy(), wanted.copy(), np.full(len(wanted), np.inf)
        unsure = np.arange(len(wanted))
        for _ in range(STEPS):
            length = np.hypot(*aim[unsure].T)
            slope = np.interp(length, seen, slopes, right=np.nan)
            rays[unsure] = aim[unsure] * (slope / np.where(length > 0, length, 1))[:, None]
            off = wanted[unsure] - _bent(rays[unsure], self.model, self.distortion)
            missed[unsure] = np.hypot(*off.T)
            aim[unsure] += off
            unsure = unsure[missed[unsure] > TOLERANCE / 1e6]
        rays[~(missed < TOLERANCE)] = np.nan
        return rays


def _growth(slope: Floats, model: str, distortion: Sequence[float]) -> Floats:
    """Return by how much a lens moves what is seen along rays from the centre, by their slopes."""
    if model in FISHEYE:
        angle = np.arctan(slope)
        k1, k2, k3, k4 = (*distortion, *(0.0,) * 4)[:4]
        square = angle**2
        seen = angle * (1 + square * (k1 + square * (k2 + square * (k3 + square * k4))))
        return np.divide(seen, slope, out=np.ones_like(slope), where=slope > 0)
    k1, k2, _, _, k3, k4, k5, k6, *_ = (*distortion, *(0.0,) * 8)
    square = slope**2
    over = 1 + square * (k1 + square * (k2 + square * k3))
    under = 1 + square * (k4 + square * (k5 + square * k6))
    return np.divide(over, under, out=np.full_like(over, np.nan), where=under > 0)


def _bent(rays: Matrix, model: str, distortion: Sequence[float]) -> Matrix:
    """Return where a lens of OpenCV's models shows rays, in units of the focal length, ``(n, 2)``.

    ``distortion`` are as many numbers as the model has.
    """
    slope = np.hypot(*rays.T)
    bent = rays * _growth(slope, model, distortion)[:, None]
    if model in FISHEYE:
        return bent
    _, _, p1, p2, *rest = distortion
    s1, s2, s3, s4 = (*rest[4:], *(0.0,) * 4)[:4]
    x, y = rays.T
    square = slope**2
    bent[:, 0] += 2 * p1 * x * y + p2 * (square + 2 * x * x) + square * (s1 + square * s2)
    bent[:, 1] += 2 * p2 * x * y + p1 * (square + 2 * y * y) + square * (s3 + square * s4)
    return bent


def ground_of(
    logged: Calibration | None, settings: GroundSettings, size: tuple[int, int] | None
) -> tuple[Ground | None, str]:
    """Return the ground of a camera and how it is known, or None and what is missing.

    ``logged`` is what the log says of the camera, for images of ``size``; ``settings`` replace
    parts of it. Nothing is assumed but a roll of 0, which is said. Without either the text is
    empty. A `GroundError` for settings that make no camera.
    """
    if size is None or (logged is None and not settings.given):
        return None, ""
    lens, why = _lens(logged, settings, size)
    if settings.homography:
        plane, is_posed, text = _of_homography(settings, lens)
        width, height = settings.size or size
        lens = lens or Calibration("", width, height, _flat(np.eye(3)))
    elif lens is None:
        return None, Sentence("no metres: {}", why)
    else:
        (above, pitch, roll), text = _pose(logged.mounting if logged else None, settings)
        if above is None or pitch is None:
            return None, Sentence("no metres: {}", text)
        turn = AXES @ (_rotation(LEFT, pitch) @ _rotation(AHEAD, roll)).T
        plane, is_posed = _plane(turn, np.array([0.0, 0.0, above])), True
    parts = lens.width, lens.height, lens.matrix, plane, lens.model, lens.distortion
    ground = Ground(*parts, is_posed=is_posed).scaled(*size)
    # Places all over the image, its edges included.
    columns, rows = np.meshgrid(*(np.linspace(0, length - 1, 9) for length in size))
    if not np.isfinite(ground.places(np.column_stack([columns.ravel(), rows.ravel()]))).any():
        return None, "no metres: the camera sees no ground: it looks up"
    (near, _), (far, _) = (ground.pixel_at(ahead) for ahead in STATED)
    covers = (
        f"a pixel covers {near:.2g} m of the way {STATED[0]} m ahead, {far:.2g} m at {STATED[1]}"
    )
    doubt = lens.doubt if settings.focal else ""
    told = f"metres: flat ground, {text}", covers if math.isfinite(near + far) else "", doubt
    return ground, Sentence("; ").join(filter(None, told))


def _lens(
    lens: Calibration | None, settings: GroundSettings, size: tuple[int, int]
) -> tuple[Calibration | None, str]:
    """Return the lens, or None and what is missing of it."""
    width, height = settings.size or size
    focal = settings.focal
    if settings.fov is not None:
        focal = (width / 2 / math.tan(math.radians(settings.fov) / 2),)
    if focal:
        x, y = settings.centre or ((width - 1) / 2, (height - 1) / 2)
        matrix = (focal[0], 0.0, x, 0.0, focal[-1], y, 0.0, 0.0, 1.0)
        lens = Calibration("", width, height, matrix, settings.model, settings.distortion)
    elif lens is not None and settings.model:
        lens = replace(lens, model=settings.model, distortion=settings.distortion)
    if lens is None:
        return None, Sentence("the focal length is missing: give fov, or focal, with {ground}")
    if problem := lens.problem:
        setting = f"ground.{problem.split()[0]}"
        raise GroundError(f"its {problem}, which no camera has", setting=setting)
    if not lens.has_shape(*size):
        shape = f"{lens.width}x{lens.height}, have another shape than the images"
        raise GroundError(f"its images, {shape}, {size[0]}x{size[1]}", setting="ground.size")
    last = max((n for n, number in enumerate(lens.distortion, 1) if number), default=0)
    model = lens.model.strip().lower()
    length = next((count for count in COEFFICIENTS.get(model, ()) if count >= last), None)
    if length is None:
        model = f"{lens.model or 'without a name'} of {len(lens.distortion)} numbers"
        names = ", ".join(name for name, counts in COEFFICIENTS.items() if any(counts))
        return None, f"the distortion is not known: {model}; known are {names}"
    numbers = (*lens.distortion[:last], *(0.0,) * (length - last))
    return replace(lens, model=model, distortion=numbers), ""


def _pose(
    mounting: Mounting | None, settings: GroundSettings
) -> tuple[tuple[float | None, float | None, float], str]:
    """Return height, pitch and roll, and where they come from; or None, and what is missing."""
    height, pitch, roll = settings.height, settings.pitch, settings.roll
    if mounting is not None:
        angles = _angles_of(_matrix_of(mounting.rotation) @ AXES)
        pitch = angles[0] if pitch is None else pitch
        roll = angles[1] if roll is None else roll
        if height is None and mounting.parent in GROUND_FRAMES:
            height = mounting.translation[2]
    has_no_height = height is None or not LOWEST <= height <= HIGHEST
    if height is None or pitch is None or has_no_height:
        above = f": the log has it above {mounting.parent} alone" if mounting else ""
        above = above if height is None else f": the log says {height:.6g} m"
        missing = [f"the camera's height above the ground{above}"] * has_no_height
        missing += ["its pitch"] * (pitch is None)
        text = "missing: {}; give it with {ground}"
        return (None, None, 0.0), Sentence(text, ", and ".join(missing))
    # Adding 0 makes 0.0 of what would be read as -0.0.
    shown = [f"{round(angle or 0.0, 1) + 0.0}\N{DEGREE SIGN}" for angle in (abs(pitch), roll)]
    way = "up" if pitch < 0 else "down"
    text = f"camera {height:.2f} m above it, pitch {shown[0]} {way}, roll {shown[1]}"
    return (height, pitch, roll or 0.0), text + " (not given)" * (roll is None)


def _of_homography(
    settings: GroundSettings, lens: Calibration | None
) -> tuple[tuple[float, ...], bool, str]:
    to_ground = np.reshape(settings.homography, (3, 3))
    if not np.isfinite(to_ground).all() or not np.linalg.cond(to_ground) < 1e13:
        raise GroundError("cannot be inverted", setting="ground.homography")
    matrix = np.eye(3) if lens is None else np.reshape(lens.matrix, (3, 3))
    plane = np.linalg.inv(to_ground @ matrix)
    # What is far ahead must lie before the camera, not behind it.
    plane = plane / np.linalg.norm(plane[:, 0]) * (1 if plane[2, 0] > 0 else -1)
    ahead, across, _ = plane.T
    is_square = abs(np.linalg.norm(across) - 1) < 0.05 > abs(ahead @ across)
    return _flat(plane), lens is not None and bool(is_square), "by a homography"


def _plane(turn: Matrix, at: Floats) -> tuple[float, ...]:
    """Return `Ground.plane` of a rotation into the camera's axes, and of its place."""
    return _flat(np.column_stack([turn[:, 0], turn[:, 1], -turn @ at]))


AHEAD, LEFT = 0, 1
"""Axes of ahead, left and up."""


def _rotation(axis: int, degrees: float) -> Matrix:
    """Return the rotation of ahead, left and up about one: about left, ahead goes down."""
    first, second = (axis + 1) % 3, (axis + 2) % 3
    turn = np.eye(3)
    turn[first, first] = turn[second, second] = math.cos(math.radians(degrees))
    turn[second, first] = math.sin(math.radians(degrees))
    turn[first, second] = -turn[second, first]
    return turn


def _angles_of(body: Matrix) -> tuple[float, float]:
    """Return pitch and roll in degrees of a rotation whose first axis is ahead; yaw is left out."""
    pitch = math.atan2(-body[2, 0], math.hypot(body[0, 0], body[1, 0]))
    return math.degrees(pitch), math.degrees(math.atan2(body[2, 1], body[2, 2]))


def _matrix_of(quaternion: Sequence[float]) -> Matrix:
    """Return the rotation matrix of a unit quaternion x, y, z, w."""
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _mapped(matrix: Sequence[float] | Matrix, points: Matrix) -> Matrix:
    """Map ``(n, 2)`` points of a plane by nine numbers to another; NaN of what lies behind it."""
    x, y = points.T
    first, second, third = (a * x + b * y + c for a, b, c in np.reshape(matrix, (3, 3)))
    w = np.where(third > 0, third, np.nan)
    return np.stack([first / w, second / w], axis=1)


def _inverse(matrix: Sequence[float]) -> Matrix:
    return np.linalg.inv(np.reshape(matrix, (3, 3)))


def _flat(matrix: Matrix) -> tuple[float, ...]:
    return tuple(np.ravel(matrix).tolist())

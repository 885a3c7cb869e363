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
from typing import Final

import numpy as np

from roadeval.data import Calibration, Mounting
from roadeval.data.arrays import Floats, Matrix
from roadeval.errors import RoadevalError
from roadeval.geometry.settings import GroundSettings

GROUND_FRAMES: Final = ("base_footprint",)
"""Frames of a vehicle that lie on the ground (REP 120)."""
FISHEYE: Final = ("equidistant", "fisheye", "kannala_brandt")
_COEFFICIENTS: Final = {
    **dict.fromkeys(("plumb_bob", "rational_polynomial"), (4, 5, 8, 12, 14)),
    **dict.fromkeys(FISHEYE, (4,)),
}
"""How many numbers the models have, by their names."""
STATED: Final = (10, 40)
"""Metres ahead at which it is said how much of the way a pixel covers."""
TOLERANCE: Final = 1e-4
"""A distorted ray must lead back to itself within this, in units of the focal length: a polynomial
bends rays from far outside the picture back into it."""
AXES: Final = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""From ahead, left and up to a camera's right, down and forward."""


class GroundError(RoadevalError):
    """A camera of which no ground can be made."""


@dataclass(frozen=True)
class Ground:
    """Flat ground, and a camera over it."""

    width: int
    height: int
    """Of its images, in pixels."""
    matrix: tuple[float, ...]
    """Nine numbers, row by row: from a ray's direction to its pixel."""
    plane: tuple[float, ...]
    """Nine numbers: from metres ahead, metres to the left, and 1 to the direction of the ray."""
    model: str = ""
    distortion: tuple[float, ...] = ()
    is_posed: bool = True
    """Whether `plane` is a place and angles, and not only a homography."""

    def scaled(self, width: int, height: int) -> Ground:
        """Return the ground for the same images in another size."""
        factors = np.array([width / self.width, height / self.height, 1.0])
        shift = np.array([factors[0] / 2 - 0.5, factors[1] / 2 - 0.5])
        matrix = np.reshape(self.matrix, (3, 3)) * factors[:, None]
        matrix[:2] += shift[:, None] * matrix[2]
        return replace(self, width=width, height=height, matrix=_flat(matrix))

    def pixels(self, places: Matrix) -> Matrix:
        """Return where places are seen, ``(n, 2)``; NaN where no ray from them meets the lens.

        Pixels may lie outside the image.
        """
        rays = _divided(_applied(self.plane, places))
        if not any(self.distortion):
            return _divided(_applied(self.matrix, rays))
        found = np.full(rays.shape, np.nan)
        known = np.flatnonzero(np.isfinite(rays).all(axis=1))
        if len(known):
            seen = self._distorted(rays[known])
            back = np.abs(self.rays(seen) - rays[known]).max(axis=1)
            sure = back < TOLERANCE * (1 + np.abs(rays[known]).max(axis=1))
            found[known[sure]] = seen[sure]
        return found

    def places(self, pixels: Matrix) -> Matrix:
        """Return where on the ground pixels lie, ``(n, 2)``; NaN from the horizon upwards."""
        return self.places_of(self.rays(pixels))

    def places_of(self, rays: Matrix) -> Matrix:
        """Return where on the ground some `rays` end, ``(n, 2)``; NaN from the horizon upwards."""
        return _divided(_applied(_inverse(self.plane), rays))

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
        turned = turn @ _pitched(math.radians(pitch)).T
        return replace(self, plane=_plane(turned, at))

    def axes(self) -> tuple[Matrix, Floats]:
        """Return the rotation from ahead, left, up to the camera's axes, and the origin there."""
        first, second, third = np.reshape(self.plane, (3, 3)).T
        return np.stack([first, second, np.cross(first, second)], axis=1), third

    @property
    def pose(self) -> tuple[float, float, float]:
        """Height in metres; pitch and roll in degrees, as of `GroundSettings`."""
        turn, third = self.axes()
        return float(-(turn.T @ third)[2]), *_angles_of(turn.T @ AXES)

    def _distorted(self, rays: Matrix) -> Matrix:
        import cv2

        matrix, distortion = np.reshape(self.matrix, (3, 3)), np.array(self.distortion)
        if self.model in FISHEYE:
            found = cv2.fisheye.distortPoints(rays[:, None], matrix, distortion)
            return np.asarray(found[:, 0])
        points = np.column_stack([rays, np.ones(len(rays))])
        zero = np.zeros(3)
        return np.asarray(cv2.projectPoints(points, zero, zero, matrix, distortion)[0][:, 0])

    def rays(self, pixels: Matrix) -> Matrix:
        """Return the rays of pixels in units of the focal length, ``(n, 2)``: right, and down."""
        matrix = np.reshape(self.matrix, (3, 3))
        if any(self.distortion):
            import cv2

            # Of OpenCV's functions for it, one that both 4.10 and 5.0 let iterate to the end.
            ends = cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-12
            points = np.ascontiguousarray(pixels, np.float64)[:, None]
            distortion = np.array(self.distortion)
            if self.model in FISHEYE:
                rays = cv2.fisheye.undistortPoints(points, matrix, distortion, criteria=ends)
                return np.asarray(rays[:, 0])
            pixels = cv2.undistortImagePoints(points, matrix, distortion, None, ends)[:, 0]
        return _divided(_applied(_inverse(self.matrix), pixels))


def ground_of(
    known: Calibration | None, given: GroundSettings, size: tuple[int, int] | None
) -> tuple[Ground | None, str]:
    """Return the ground of a camera and how it is known, or None and what is missing.

    ``known`` is what the log says of the camera, for images of ``size``; ``given`` replaces parts
    of it. Nothing is assumed but a roll of 0, which is said. Without either the text is empty. A
    `GroundError` for settings that make no camera.
    """
    if size is None or (known is None and not given.given):
        return None, ""
    lens, why = _lens(known, given, size)
    if given.homography:
        plane, is_posed, text = _of_homography(given, lens)
        columns, rows = given.size or size
        lens = lens or Calibration("", columns, rows, _flat(np.eye(3)))
    elif lens is None:
        return None, f"no metres: {why}"
    else:
        pose = _pose(known.mounting if known else None, given)
        if isinstance(pose, str):
            return None, f"no metres: {pose}"
        (height, pitch, roll), text = pose
        turn = AXES @ (_pitched(math.radians(pitch)) @ _rolled(math.radians(roll))).T
        plane, is_posed = _plane(turn, np.array([0.0, 0.0, height])), True
    made = Ground(
        *(lens.width, lens.height, lens.matrix, plane, lens.model, lens.distortion),
        is_posed=is_posed,
    ).scaled(*size)
    if not np.isfinite(made.places(_frame(*size))).any():
        return None, "no metres: the camera sees no ground: it looks up"
    (near, _), (far, _) = (made.pixel_at(ahead) for ahead in STATED)
    covers = f"{near:.2g} m of the way {STATED[0]} m ahead, {far:.2g} m at {STATED[1]}"
    return made, f"metres: flat ground, {text}; a pixel covers {covers}"


def _lens(
    known: Calibration | None, given: GroundSettings, size: tuple[int, int]
) -> tuple[Calibration | None, str]:
    """Return the lens, or None and what is missing of it."""
    width, height = given.size or size
    focal = given.focal
    if given.fov is not None:
        focal = (width / 2 / math.tan(math.radians(given.fov) / 2),)
    if focal:
        across, down = focal[0], focal[-1]
        x, y = given.centre or ((width - 1) / 2, (height - 1) / 2)
        matrix = (across, 0.0, x, 0.0, down, y, 0.0, 0.0, 1.0)
        known = Calibration("", width, height, matrix, given.model, given.distortion)
    elif known is not None and given.model:
        known = replace(known, model=given.model, distortion=given.distortion)
    if known is None:
        return None, "the focal length is missing: give fov, or focal, with `ground`"
    wanted = _COEFFICIENTS.get(known.model)
    if any(known.distortion) and (wanted is None or len(known.distortion) not in wanted):
        model = f"{known.model or 'without a name'} of {len(known.distortion)} numbers"
        return None, f"the distortion is not known: {model}; known are {', '.join(_COEFFICIENTS)}"
    return known, ""


def _pose(
    mounting: Mounting | None, given: GroundSettings
) -> tuple[tuple[float, float, float], str] | str:
    """Return height, pitch and roll, and where they come from, or what is missing."""
    angles, height = (given.pitch, given.roll), given.height
    if mounting is not None:
        pitch, roll = _angles_of(_matrix_of(mounting.rotation) @ AXES)
        angles = (
            pitch if given.pitch is None else given.pitch,
            roll if given.roll is None else given.roll,
        )
        if height is None and mounting.parent in GROUND_FRAMES:
            height = mounting.translation[2]
    missing = []
    if height is None or height <= 0:
        above = f": the log has it above {mounting.parent} alone" if mounting else ""
        missing.append(f"the camera's height above the ground{above}")
    if angles[0] is None:
        missing.append("its pitch")
    if height is None or missing or angles[0] is None:
        return f"missing: {', and '.join(missing)}; give it with `ground`"
    # Adding 0 makes 0.0 of what would be read as -0.0.
    pitch, roll = (round(angle or 0.0, 1) + 0.0 for angle in angles)
    text = [f"camera {height:.2f} m above it", f"pitch {pitch}\N{DEGREE SIGN} down"]
    text.append(f"roll {roll}\N{DEGREE SIGN}" + " (not given)" * (angles[1] is None))
    return (height, angles[0], angles[1] or 0.0), ", ".join(text)


def _of_homography(
    given: GroundSettings, lens: Calibration | None
) -> tuple[tuple[float, ...], bool, str]:
    to_ground = np.reshape(given.homography, (3, 3))
    if not np.isfinite(to_ground).all() or abs(np.linalg.det(to_ground)) < 1e-30:
        raise GroundError("`ground.homography` cannot be inverted")
    matrix = np.eye(3) if lens is None else np.reshape(lens.matrix, (3, 3))
    plane = np.linalg.inv(to_ground @ matrix)
    # What is far ahead must lie before the camera, not behind it.
    plane = plane / np.linalg.norm(plane[:, 0]) * (1 if plane[2, 0] > 0 else -1)
    across = plane[:, 1]
    is_posed = lens is not None and bool(
        abs(np.linalg.norm(across) - 1) < 0.05 > abs(plane[:, 0] @ across)
    )
    return _flat(plane), is_posed, "by a homography"


def _plane(turn: Matrix, at: Floats) -> tuple[float, ...]:
    """Return `Ground.plane` of a rotation into the camera's axes, and of its place."""
    return _flat(np.column_stack([turn[:, 0], turn[:, 1], -turn @ at]))


def _pitched(angle: float) -> Matrix:
    """Return the rotation of ahead, left and up about left: ahead goes down."""
    s, c = math.sin(angle), math.cos(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def _rolled(angle: float) -> Matrix:
    """Return the rotation of ahead, left and up about ahead: left goes up."""
    s, c = math.sin(angle), math.cos(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


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


def _applied(matrix: Sequence[float], points: Matrix) -> tuple[Floats, Floats, Floats]:
    """Apply nine numbers to ``(n, 2)`` points and a 1: three arrays, ``(n,)``."""
    x, y = points.T
    first, second, third = (a * x + b * y + c for a, b, c in np.reshape(matrix, (3, 3)))
    return first, second, third


def _divided(applied: tuple[Floats, Floats, Floats]) -> Matrix:
    """Return ``(n, 2)`` points of the plane; NaN of what lies behind it."""
    x, y, w = applied
    w = np.where(w > 0, w, np.nan)
    return np.stack([x / w, y / w], axis=1)


def _inverse(matrix: Sequence[float]) -> tuple[float, ...]:
    return _flat(np.linalg.inv(np.reshape(matrix, (3, 3))))


def _frame(width: int, height: int) -> Matrix:
    """Return places all over an image, its edges included."""
    columns, rows = np.meshgrid(np.linspace(0, width - 1, 9), np.linspace(0, height - 1, 9))
    return np.column_stack([columns.ravel(), rows.ravel()])


def _flat(matrix: Matrix) -> tuple[float, ...]:
    return tuple(np.ravel(matrix).tolist())

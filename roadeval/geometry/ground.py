"""Flat ground under a camera: from pixels to places on the ground in metres, and back.

Places are ``(n, 2)``: metres ahead of the point of the ground below the camera, in the direction in
which the camera looks, and metres to the left of that line (REP 103). Pixels are ``(n, 2)``: column
and row, the centre of the first pixel at (0, 0), as in OpenCV and ROS. The lens is OpenCV's model
of the same name. Slopes and bumps of the ground cause errors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import Calibration, Mounting
from roadeval.data.arrays import Floats, Places
from roadeval.data.calibration import FISHEYE
from roadeval.errors import RoadevalError
from roadeval.geometry.settings import GroundSettings
from roadeval.runtime.sentence import Sentence

COEFFICIENTS: Final = {
    **dict.fromkeys(("plumb_bob", "rational_polynomial", "radtan"), (0, 4, 5, 8, 12)),
    **dict.fromkeys(FISHEYE, (4,)),
    **dict.fromkeys(("", "none", "pinhole", "perspective", "undistorted"), (0,)),
    **dict.fromkeys(("brown_conrady", "inverse_brown_conrady", "modified_brown_conrady"), (0,)),
}
"""Possible numbers of coefficients, by the names of models; zeros may follow, or be missing."""
TOLERANCE: Final = 1e-6
"""A ray must lead back to its pixel within this, in units of the focal length."""
AXES: Final = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""The rotation from ahead, left and up to a camera's right, down and forward."""


@dataclass(frozen=True)
class Ground:
    """Flat ground, and a camera over it."""

    width: int
    height: int
    """Size of its images in pixels."""
    matrix: tuple[float, ...]
    """The 3x3 matrix, row by row, from a ray's direction to its pixel."""
    plane: tuple[float, ...]
    """The 3x3 matrix from metres ahead, metres to the left, and 1 to the direction of the ray."""
    model: str = ""
    distortion: tuple[float, ...] = ()
    """The coefficients of the model; four zeros for a fisheye without any."""
    is_posed: bool = True
    """Whether the camera's place and angles are known, and not only a homography."""

    def scaled(self, width: int, height: int) -> Ground:
        """Return the ground for the same images in another size."""
        factors = np.array([width / self.width, height / self.height, 1.0])
        matrix = np.reshape(self.matrix, (3, 3)) * factors[:, None]
        matrix += (factors / 2 - 0.5)[:, None] * matrix[2]
        return replace(self, width=width, height=height, matrix=_flat(matrix))

    def pixels(self, places: Floats) -> Floats:
        """Return the pixels of places, ``(n, 2)``, also outside the image; NaN if not seen."""
        rays = _apply(self.plane, places)
        if self.distortion:
            # A folding polynomial bends rays from far outside the picture back into it.
            rays[~(np.hypot(*rays.T) <= self._curve[0][-1])] = np.nan
            rays = _distort(rays, self.model, self.distortion)
        return _apply(self.matrix, rays)

    def places(self, pixels: Floats) -> Floats:
        """Return the places of pixels on the ground, ``(n, 2)``; NaN at and above the horizon."""
        return self.places_of(self.rays(pixels))

    def places_of(self, rays: Floats) -> Floats:
        """Return the places of `rays` on the ground, ``(n, 2)``; NaN at and above the horizon."""
        return _apply(_inverse(self.plane), rays)

    def distances(self) -> Floats:
        """Return the metres to the ground at each pixel, ``(H, W)``; NaN for pixels without a ray.

        Above the horizon they are negative: the metres to a plane as high above the camera.
        """
        rows, columns = np.mgrid[: self.height, : self.width].reshape(2, -1)
        rays = self.rays(np.column_stack([columns, rows]).astype(float))
        ahead, left, below = _inverse(self.plane) @ np.column_stack([rays, np.ones(len(rays))]).T
        with np.errstate(divide="ignore"):
            return (np.hypot(ahead, left) / below).reshape(self.height, self.width)

    def pixel_at(self, ahead: float) -> tuple[float, float]:
        """Return the metres, along and across, of a pixel ``ahead`` metres in front, or NaN."""
        (at,) = self.pixels(np.array([[ahead, 0.0]]))
        steps = np.array([[0, -0.5], [0, 0.5], [-0.5, 0], [0.5, 0]])
        up, down, left, right = self.places(at + steps)
        return float(np.linalg.norm(up - down)), float(np.linalg.norm(right - left))

    def moved(self, pitch: float = 0.0, height: float = 0.0) -> Ground:
        """Return the ground for a camera turned down by degrees and raised by metres.

        A `RoadevalError` if the camera's place and angles are unknown.
        """
        if not (pitch or height):
            return self
        if not self.is_posed:
            raise RoadevalError("a homography alone does not tell the camera's height and angles")
        turn, origin = self.axes()
        at = -turn.T @ origin
        at[2] += height
        return replace(self, plane=_plane(turn @ _rotation(LEFT, pitch).T, at))

    def axes(self) -> tuple[Floats, Floats]:
        """Return the rotation from ahead, left, up to the camera's axes, and the place of 0, 0."""
        first, second, third = np.reshape(self.plane, (3, 3)).T
        return np.stack([first, second, np.cross(first, second)], axis=1), third

    @cached_property
    def _curve(self) -> tuple[Floats, Floats]:
        """Slopes of rays, and distances of their pixels from the centre in focal lengths.

        The curve ends where the polynomial folds: beyond, two rays would have the same pixel.
        """
        slopes = np.tan(np.linspace(0, math.radians(89.9), 10_000))
        seen = slopes * _growth(slopes, self.model, self.distortion)
        falls = ~(np.diff(seen) > 0)
        end = int(np.argmax(falls)) + 1 if falls.any() else len(seen)
        return slopes[:end], seen[:end]

    def rays(self, pixels: Floats) -> Floats:
        """Return the rays of pixels in units of the focal length, ``(n, 2)``: right, and down.

        NaN for a pixel without a ray, or with one at more than a right angle to the camera's axis.
        """
        distorted = _apply(_inverse(self.matrix), pixels)
        if not self.distortion:
            return distorted
        slopes, distances = self._curve
        aim, rays = distorted.copy(), distorted.copy()
        errors, open_rays = np.full(len(distorted), np.inf), np.arange(len(distorted))
        for _ in range(30):
            length = np.hypot(*aim[open_rays].T)
            slope = np.interp(length, distances, slopes, right=np.nan)
            rays[open_rays] = aim[open_rays] * (slope / np.where(length > 0, length, 1))[:, None]
            step = distorted[open_rays] - _distort(rays[open_rays], self.model, self.distortion)
            errors[open_rays] = np.hypot(*step.T)
            aim[open_rays] += step
            open_rays = open_rays[errors[open_rays] > TOLERANCE / 1e6]
        rays[~(errors < TOLERANCE)] = np.nan
        return rays


def _growth(slope: Floats, model: str, distortion: Sequence[float]) -> Floats:
    """Return the factors by which a lens moves rays away from the centre, by their slopes."""
    if model in FISHEYE:
        angle = np.arctan(slope)
        k1, k2, k3, k4 = (*distortion, *(0.0,) * 4)[:4]
        square = angle**2
        distance = angle * (1 + square * (k1 + square * (k2 + square * (k3 + square * k4))))
        return np.divide(distance, slope, out=np.ones_like(slope), where=slope > 0)
    k1, k2, _, _, k3, k4, k5, k6, *_ = (*distortion, *(0.0,) * 8)
    square = slope**2
    over = 1 + square * (k1 + square * (k2 + square * k3))
    under = 1 + square * (k4 + square * (k5 + square * k6))
    return np.divide(over, under, out=np.full_like(over, np.nan), where=under > 0)


def _distort(rays: Floats, model: str, distortion: Sequence[float]) -> Floats:
    """Apply a model with all its coefficients to rays, ``(n, 2)`` in focal lengths."""
    slope = np.hypot(*rays.T)
    distorted = rays * _growth(slope, model, distortion)[:, None]
    if model in FISHEYE:
        return distorted
    _, _, p1, p2, *rest = distortion
    s1, s2, s3, s4 = (*rest[4:], *(0.0,) * 4)[:4]
    x, y = rays.T
    square = slope**2
    distorted[:, 0] += 2 * p1 * x * y + p2 * (square + 2 * x * x) + square * (s1 + square * s2)
    distorted[:, 1] += 2 * p2 * x * y + p1 * (square + 2 * y * y) + square * (s3 + square * s4)
    return distorted


def ground_of(
    logged: Calibration | None, settings: GroundSettings, size: tuple[int, int] | None
) -> tuple[Ground | None, str]:
    """Return the ground of a camera and its source, or None and what is missing.

    ``logged`` is the calibration in the log, for images of ``size``; ``settings`` replace parts of
    it. The text is empty if there is neither. Only a roll of 0 is assumed, which the text says. A
    `RoadevalError` if the settings are not a possible camera.
    """
    if size is None or (logged is None and not settings.given):
        return None, ""
    lens, text = _find_lens(logged, settings, size)
    plane: tuple[float, ...] | None = None
    if lens is not None or settings.homography:
        plane, is_posed, text = _find_plane(logged.mounting if logged else None, settings, lens)
    if plane is None:
        return None, Sentence("no metres: {}", text)
    width, height = settings.size or size
    lens = lens or Calibration("", width, height, _flat(np.eye(3)))
    parts = lens.width, lens.height, lens.matrix, plane, lens.model, lens.distortion
    ground = Ground(*parts, is_posed=is_posed).scaled(*size)
    # Pixels all over the image, up to its edges.
    columns, rows = np.meshgrid(*(np.linspace(0, length - 1, 9) for length in size))
    if not np.isfinite(ground.places(np.column_stack([columns.ravel(), rows.ravel()]))).any():
        return None, "no metres: the camera sees no ground: it looks up"
    (near, _), (far, _) = (ground.pixel_at(ahead) for ahead in (10, 40))
    remarks = [f"metres: flat ground, {text}"]
    if math.isfinite(near + far):
        remarks.append(f"a pixel covers {near:.2g} m of the way 10 m ahead, {far:.2g} m at 40")
    if settings.focal and lens.doubt:
        remarks.append(lens.doubt)
    return ground, Sentence("; ").join(remarks)


def ground_under(lens: Calibration, mounting: Mounting) -> Ground:
    """Return the ground with places along the axes of the root frame, which lies on it."""
    turn, at = _rotation_of(mounting.rotation).T, np.array(mounting.translation)
    return Ground(lens.width, lens.height, lens.matrix, _plane(turn, at))


def _find_lens(
    lens: Calibration | None, settings: GroundSettings, size: tuple[int, int]
) -> tuple[Calibration | None, str]:
    """Return the lens, or None and what is missing for it."""
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
        raise RoadevalError(f"impossible for a camera: its {problem}", setting=setting)
    if not lens.has_shape(*size):
        shapes = f"{lens.width}x{lens.height}, but the log's images are {size[0]}x{size[1]}"
        raise RoadevalError(f"the calibration is for images of {shapes}", setting="ground.size")
    last = max((n for n, number in enumerate(lens.distortion, 1) if number), default=0)
    model = lens.model.strip().lower()
    length = next((count for count in COEFFICIENTS.get(model, ()) if count >= last), None)
    if length is None:
        model = f"{lens.model or 'without a name'} of {len(lens.distortion)} numbers"
        names = ", ".join(name for name, counts in COEFFICIENTS.items() if any(counts))
        return None, f"unknown distortion model {model}; supported models are {names}"
    numbers = (*lens.distortion[:last], *(0.0,) * (length - last))
    return replace(lens, model=model, distortion=numbers), ""


def _find_plane(
    mounting: Mounting | None, settings: GroundSettings, lens: Calibration | None
) -> tuple[tuple[float, ...] | None, bool, str]:
    """Return `Ground.plane`, whether it is posed, and its source; or None, and what is missing."""
    if settings.homography:
        to_ground = np.reshape(settings.homography, (3, 3))
        if not np.isfinite(to_ground).all() or not np.linalg.cond(to_ground) < 1e13:
            raise RoadevalError("cannot be inverted", setting="ground.homography")
        matrix = np.eye(3) if lens is None else np.reshape(lens.matrix, (3, 3))
        from_ground = np.linalg.inv(to_ground @ matrix)
        # Distant places ahead must lie before the camera, not behind it.
        sign = 1 if from_ground[2, 0] > 0 else -1
        from_ground = from_ground / np.linalg.norm(from_ground[:, 0]) * sign
        ahead, across, _ = from_ground.T
        is_square = abs(np.linalg.norm(across) - 1) < 0.05 > abs(ahead @ across)
        return _flat(from_ground), lens is not None and bool(is_square), "by a homography"
    height, pitch, roll = settings.height, settings.pitch, settings.roll
    if mounting is not None:
        turn = _rotation_of(mounting.rotation) @ AXES  # its first axis is ahead
        if pitch is None:
            pitch = math.degrees(math.atan2(-turn[2, 0], math.hypot(turn[0, 0], turn[1, 0])))
        if roll is None:
            roll = math.degrees(math.atan2(turn[2, 1], turn[2, 2]))
        if height is None and mounting.parent == "base_footprint":  # on the ground (REP 120)
            height = mounting.translation[2]
    has_no_height = height is None or not 0.01 <= height <= 1000
    if height is None or pitch is None or has_no_height:
        above = f": the log has it above {mounting.parent} alone" if mounting else ""
        above = above if height is None else f": the log says {height:.6g} m"
        missing = [f"the camera's height above the ground{above}"] * has_no_height
        missing += ["its pitch"] * (pitch is None)
        text = "missing: {}; give it with {ground}"
        return None, False, Sentence(text, ", and ".join(missing))
    # Adding 0 turns -0.0 into 0.0.
    shown = [f"{round(angle or 0.0, 1) + 0.0}\N{DEGREE SIGN}" for angle in (abs(pitch), roll)]
    way = "up" if pitch < 0 else "down"
    text = f"camera {height:.2f} m above it, pitch {shown[0]} {way}, roll {shown[1]}"
    turn = AXES @ (_rotation(LEFT, pitch) @ _rotation(AHEAD, roll or 0.0)).T
    plane = _plane(turn, np.array([0.0, 0.0, height]))
    return plane, True, text + " (not given)" * (roll is None)


def _plane(turn: Floats, at: Floats) -> tuple[float, ...]:
    """Return `Ground.plane` for a rotation into the camera's axes, and the camera's place."""
    return _flat(np.column_stack([turn[:, 0], turn[:, 1], -turn @ at]))


AHEAD, LEFT = 0, 1
"""Indices of the axes ahead, left and up."""


def _rotation(axis: int, degrees: float) -> Floats:
    """Return the rotation about an axis, ``(3, 3)``; a positive one about left turns ahead down."""
    first, second = (axis + 1) % 3, (axis + 2) % 3
    turn = np.eye(3)
    turn[first, first] = turn[second, second] = math.cos(math.radians(degrees))
    turn[second, first] = math.sin(math.radians(degrees))
    turn[first, second] = -turn[second, first]
    return turn


def _rotation_of(quaternion: Sequence[float]) -> Floats:
    """Return the rotation matrix of a unit quaternion x, y, z, w."""
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _apply(matrix: Sequence[float] | Floats, points: Floats) -> Floats:
    """Map ``(n, 2)`` points by a 3x3 homography; NaN for points behind the plane."""
    x, y = points.T
    first, second, third = (a * x + b * y + c for a, b, c in np.reshape(matrix, (3, 3)))
    w = np.where(third > 0, third, np.nan)
    return np.stack([first / w, second / w], axis=1)


def _inverse(matrix: Sequence[float]) -> Floats:
    return np.linalg.inv(np.reshape(matrix, (3, 3)))


def _flat(matrix: Floats) -> tuple[float, ...]:
    return tuple(np.ravel(matrix).tolist())


OUTSIDE: Final = -1
"""Stands for the pixel of a place outside the picture."""


@dataclass(frozen=True)
class Plan:
    """A rectangle of ground before the camera, seen from above in square cells.

    Far ahead is at the top, left is left.
    """

    ground: Ground
    near: float
    far: float
    """Metres ahead of the camera at which it begins and ends."""
    width: float
    """Metres across, half of them to either side."""
    cell: float
    """Metres of a cell's side."""

    @cached_property
    def cells(self) -> Places:
        """``(rows, columns)`` pixels of the cells' centres in a flat image, or `OUTSIDE`."""
        half = self.width / 2
        ahead = np.arange(self.far - self.cell / 2, self.near, -self.cell)
        left = np.arange(half - self.cell / 2, -half, -self.cell)
        places = np.stack(np.meshgrid(ahead, left, indexing="ij"), axis=-1)
        return pixels_of(self.ground, places.reshape(-1, 2)).reshape(places.shape[:2])

    def picture(self, image: npt.NDArray[Any], nothing: int = 0) -> npt.NDArray[Any]:
        """Return an image as seen from above, by the nearest pixels; ``nothing`` outside it."""
        picture = image.reshape(-1, *image.shape[2:]).take(self.cells, axis=0)
        picture[self.cells == OUTSIDE] = nothing
        return picture


def pixels_of(ground: Ground, places: Floats) -> Places:
    """Return the pixel of each place, ``(n,)`` indices of a flat image, or `OUTSIDE`."""
    pixels = np.rint(ground.pixels(places))
    size = ground.width, ground.height
    inside = np.all((pixels >= 0) & (pixels < size), axis=1, keepdims=True)
    columns, rows = np.where(inside, pixels, 0).astype(np.intp).T
    return np.where(inside[:, 0], rows * ground.width + columns, OUTSIDE)

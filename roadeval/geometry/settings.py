"""Settings of a camera over the ground, for facts that the log lacks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Interval, Len

Degrees = Annotated[float, Interval(gt=-90, lt=90)]
Length = Annotated[float, Interval(gt=0, le=1_000_000)]
Number = Annotated[float, Interval(ge=-1_000_000, le=1_000_000)]
Entry = Annotated[float, Interval(ge=-1e12, le=1e12)]
Pixels = Annotated[int, Interval(ge=1, le=65_536)]


@dataclass(frozen=True)
class GroundSettings:
    """The camera over flat ground, to complete or correct the facts in the log.

    Each setting replaces a fact of the log: intrinsics of a CameraInfo or CameraCalibration, height
    and angles of its static transforms. If intrinsics, height and pitch are known, errors are
    counted in metres, too.

    height: Metres from the ground to the camera.
    pitch: Degrees by which it looks down; negative if it looks up.
    roll: Degrees by which it leans to the right. Default: that of the log's transforms, else 0.
    fov: Degrees from the left edge of the image to the right one, for a lens without distortion.
    focal: Focal length in pixels, or two: across and down.
    centre: Column and row of the principal point. Default: the middle of the image.
    size: Width and height of the images for focal length, centre and homography. Default: the log's
        images.
    model: Distortion model: ``plumb_bob``, ``rational_polynomial`` or ``equidistant`` (a fisheye).
    distortion: Coefficients of the distortion, in the order of ROS and OpenCV.
    homography: Nine numbers, row by row: from column, row and 1 (in an image without distortion) to
        metres ahead, metres to the left, and 1, times any factor. It replaces height, pitch and
        roll.
    """

    height: Annotated[float | None, Interval(ge=0.01, le=1000)] = None
    pitch: Degrees | None = None
    roll: Annotated[float, Interval(ge=-180, le=180)] | None = None
    fov: Annotated[float | None, Interval(ge=0.5, le=175)] = None
    focal: Annotated[tuple[Length, ...], Len(max_length=2)] = ()
    centre: Annotated[tuple[Number, ...], Len(max_length=2)] = ()
    size: Annotated[tuple[Pixels, ...], Len(max_length=2)] = ()
    model: str = ""
    distortion: Annotated[tuple[Number, ...], Len(max_length=14)] = ()
    homography: Annotated[tuple[Entry, ...], Len(max_length=9)] = ()

    def __post_init__(self) -> None:
        if self.fov is not None and self.focal:
            raise ValueError("fov and focal both give the focal length: give one")
        if self.homography and len(self.homography) != 9:
            raise ValueError("homography must be nine numbers, row by row")
        for name in ("centre", "size"):
            if len(getattr(self, name)) == 1:
                raise ValueError(f"{name} must be two numbers")
        if self.homography and (self.height, self.pitch, self.roll) != (None,) * 3:
            raise ValueError("homography replaces height, pitch and roll: leave them out")
        if self.distortion and not self.model:
            raise ValueError("distortion needs its model: plumb_bob, rational_polynomial, ...")

    @property
    def given(self) -> bool:
        """Whether any setting is given."""
        return self != GroundSettings()

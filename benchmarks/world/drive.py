"""The synthetic drive: frames with their truth, and the log that holds them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from benchmarks.world.camera import Camera
from benchmarks.world.journey import Journey
from benchmarks.world.light import daylight, is_shadow
from benchmarks.world.scene import build
from benchmarks.world.sensor import Sensor
from benchmarks.world.traffic import draw_traffic
from benchmarks.world.view import Moment, see
from roadeval.data import Mask, Rgb
from roadeval.logs.writing.writer import LogWriter

IMAGE_TOPIC: Final = "/camera/image"
ROAD_TOPIC: Final = "/truth/road"
SHADOW_TOPIC: Final = "/truth/shadow"
START_NS: Final = 1_718_445_600_000_000_000
"""Stamp of the first frame: 15 June 2024, 10:00 UTC."""
JPEG_QUALITY: Final = 84
LONGEST: Final = 60.0
"""The maps of a longer drive's road would not fit into memory with ease, seconds."""
FASTEST: Final = 1000.0
"""Frames a second."""
SMALLEST: Final = 32
"""Least width and height of an image, pixels."""


class DriveError(ValueError):
    """A drive that cannot be rendered."""


@dataclass(frozen=True, slots=True)
class RenderSettings:
    """Settings of a rendered drive.

    Parameters
    ----------
    frames
        How many. The three stretches (moderate shadow first, then none and heavy in the order
        that the seed draws) get a third each.
    width, height
        Pixels.
    rate_hz
        Frames a second.
    seed
        Everything random follows from it: the same settings give the same bytes.

    Raises
    ------
    DriveError
        If such a drive cannot be rendered.
    """

    frames: int = 100
    width: int = 640
    height: int = 480
    rate_hz: float = 10.0
    seed: int = 0

    def __post_init__(self) -> None:
        if self.frames < 1 or not 0 < self.rate_hz <= FASTEST or self.seed < 0:
            raise DriveError(
                f"{self.frames} frames at {self.rate_hz} Hz, seed {self.seed}: there must be a "
                f"frame, rate_hz must lie between 0 and {FASTEST:g}, the seed must not be negative"
            )
        if min(self.width, self.height) < SMALLEST:
            raise DriveError(
                f"{self.width}x{self.height}: images are at least {SMALLEST}x{SMALLEST} pixels"
            )
        if self.duration > LONGEST:
            raise DriveError(
                f"{self.frames} frames at {self.rate_hz} Hz last {self.duration:g} s: "
                f"at most {LONGEST:g} s; ask for fewer frames or a higher rate_hz"
            )

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the end of the last one."""
        return self.frames / self.rate_hz


DEMO: Final = RenderSettings(rate_hz=2.0, seed=6)
"""The drive that ships: 50 seconds, so that its frames differ. Of eight seeds looked at, this one
shows most at once: the shadow filter mends most of it, harms at its begin, and fails in a full
shade. No setting was chosen on it."""


@dataclass(frozen=True, slots=True, eq=False)
class SynthFrame:
    """A rendered frame with its truth.

    Parameters
    ----------
    index
        Position in the drive, from 0.
    image
        ``(H, W, 3)`` uint8 RGB, before JPEG.
    road
        ``(H, W)`` uint8, 1 where most of the pixel is asphalt or its markings.
    shadow
        ``(H, W)`` uint8, 1 where the direct sun is blocked (`light.is_shadow`), on any surface.
    """

    index: int
    image: Rgb
    road: Mask
    shadow: Mask


def render_drive(settings: RenderSettings) -> Iterator[SynthFrame]:
    """Render the frames of a drive, in order."""

    def random(*purpose: int) -> np.random.Generator:
        return np.random.default_rng([settings.seed, *purpose])

    journey = Journey.draw(settings.duration, random(1))
    scene = build(journey, random(2))
    movers = draw_traffic(journey, scene.road, scene.sun, random(3))
    sensor = Sensor(settings.width, settings.height, 1 / settings.rate_hz)
    for index in range(settings.frames):
        time = index / settings.rate_hz
        camera = Camera(settings.width, settings.height, journey.pose(time, scene.road))
        light = daylight(journey.beam(time))
        cars = tuple(mover.at(time, scene.road, scene.shade) for mover in movers)
        film = see(scene, Moment(time, camera, light, cars))
        image = sensor.expose(film.radiance, random(4, index))
        road = np.asarray(film.road >= 0.5, np.uint8)
        yield SynthFrame(index, image, road, is_shadow(film.visible, light))


def write_drive(
    path: str | Path, settings: RenderSettings, progress: Callable[[int, int], None] | None = None
) -> None:
    """Render a drive into an MCAP log: a JPEG, the road's and the shadow's mask a frame.

    Masks are PNG, 255 for road or shadow. The three messages of a frame share their stamp.

    Parameters
    ----------
    path
        The log to write; it appears when it is complete.
    settings
        What to render.
    progress
        Called with the frames done and all frames, after each.

    Raises
    ------
    LogError
        If the log cannot be written.
    """
    with LogWriter(path) as log:
        for frame in render_drive(settings):
            stamp = START_NS + round(frame.index * 1e9 / settings.rate_hz)
            log.image(IMAGE_TOPIC, stamp, to_jpeg(frame.image), "jpeg")
            log.mask(ROAD_TOPIC, stamp, frame.road * np.uint8(255))
            log.mask(SHADOW_TOPIC, stamp, frame.shadow * np.uint8(255))
            if progress is not None:
                progress(frame.index + 1, settings.frames)


def to_jpeg(image: Rgb) -> bytes:
    """Compress as the camera does."""
    bgr = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    _, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return bytes(data.tobytes())

"""A tiny drive: 56 frames of 64x48 at 10 Hz, every pixel of which follows from integers.

No random generator and no lossy codec takes part, so that the same frames come out everywhere.
What a report has to tell something about is in it: true shadow, ignored pixels, frames without
truth, one without road, one that is not an image, and masks of a network.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from roadeval.logs.writing.writer import LogWriter

FRAMES = 56
WIDTH, HEIGHT = 64, 48
HORIZON = 18
START_NS = 1_777_888_999_000_000_000
PERIOD_NS = 100_000_000
BROKEN = 21
"""The frame that is not an image."""
UNLABELLED = (12, 17, 30)
"""The frames without truth."""
NO_ROAD = 33
"""The frame whose truth has no road."""

TIE = 14
"""The frame on which the network misses one pixel, as the baseline does: neither is better."""

Plane = npt.NDArray[np.int64]

_y: Plane = np.arange(HEIGHT)[:, None] + np.zeros((1, WIDTH), int)
_x: Plane = np.arange(WIDTH)[None] + np.zeros((HEIGHT, 1), int)


def write(path: Path, *, frames: int = FRAMES, truths: bool = True) -> Path:
    """Write the drive's first frames as a log, or the camera's images alone."""
    with LogWriter(path) as log:
        for number in range(frames):
            stamp = START_NS + number * PERIOD_NS
            _, png = cv2.imencode(".png", image(number)[..., ::-1])
            data = b"no image" if number == BROKEN else png.tobytes()
            log.image("/camera/image", stamp, data, "png", log_time_ns=stamp + 5_000_000)
            if not truths:
                continue
            if number not in UNLABELLED:
                log.mask("/truth/road", stamp, truth(number), log_time_ns=stamp + 6_000_000)
                log.mask("/truth/shadow", stamp, 255 * shadow(number).astype(np.uint8))
            log.mask("/net/road_mask", stamp, 255 * guess(number).astype(np.uint8))
    return path


def road(number: int) -> npt.NDArray[np.bool_]:
    """A trapezoid that sways to and fro."""
    middle = 32 + (number % 9 - 4) * (HEIGHT - _y) // 12
    half = 3 + 4 * (_y - HORIZON) // 5
    return (_y >= HORIZON) & (abs(_x - middle) <= half)


def shadow(number: int) -> npt.NDArray[np.bool_]:
    """The shadow of something beside the road, which comes nearer; on every third frame none."""
    top = 22 + number % 7
    inside = (_y >= top) & (_y < top + 12) & (_x >= 22 + 3 * (number % 8))
    return inside & (number % 3 != 2)


def truth(number: int) -> npt.NDArray[np.uint8]:
    """255 where there is road, 128 on the bonnet and on a car, which count nowhere, else 0."""
    labels = np.where(road(number) & (number != NO_ROAD), 255, 0)
    labels[-3:] = 128
    labels[27 : 28 + number % 8, 28:56] = 128
    return labels.astype(np.uint8)


def guess(number: int) -> npt.NDArray[np.bool_]:
    """What a network would say: the road of two frames ago, with a hole."""
    if number == TIE:
        return road(number) & ~((_y == 24) & (_x == 34))
    hole = (_y % 16 < 3) & (_x > 40)
    return road(number - 2) & ~hole


def image(number: int) -> npt.NDArray[np.uint8]:
    """Sky, verge and road; tar on the road, a grey path beside it, and the shadow over all."""
    scene = np.empty((HEIGHT, WIDTH, 3), int)
    scene[:] = (66, 104, 52)
    scene[:HORIZON] = (150, 180, 215)
    scene[road(number)] = (158, 156, 160)
    tar = road(number) & (abs(_y - 30 - number % 11) <= 1)
    scene[tar] = (70, 72, 68)
    path = ~road(number) & (_y > 22) & (abs(_x - 58 + number % 4) <= 2)
    scene[path] = (150, 150, 152)
    scene[shadow(number)] = scene[shadow(number)] * (44, 48, 56) // 100
    return (scene + _grain(number)).clip(0, 255).astype(np.uint8)


def _grain(number: int) -> Plane:
    """Noise of -14 to 14 in each channel, by an integer hash of place, channel and frame."""
    places = (_y * WIDTH + _x)[..., None] * 3 + np.arange(3) + 9241 * (number + 1)
    mixed = places * 2654435761 % 2**32
    mixed = (mixed ^ (mixed >> 15)) * 2246822519 % 2**32
    return (mixed ^ (mixed >> 13)) % 29 - 14

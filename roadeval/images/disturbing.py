"""Disturbed images: a frame in the dark, in fog, out of focus, through a dirty lens, in rain.

Each disturbance is a pure function of an image, drawn from the frame's number, so that any number
of threads gives the same bytes. Strength 0 returns the image itself. Light is linear light, from 0
(none) to 1 (white): IEC 61966-2-1's inverse of sRGB. To add a kind, add a line to `KINDS`.

References
----------
.. [1] H. Koschmieder, Beiträge zur Physik der freien Atmosphäre 12, 1924, 33-53; with the
   meteorological optical range of the WMO-No. 8 (Guide to Instruments), 2018, chapter 9.
.. [2] EMVA Standard 1288, release 4.0, 2021, section 2: the noise of a linear camera.
.. [3] J. Gu, R. Ramamoorthi, P. Belhumeur, S. Nayar, ACM Transactions on Graphics 28(5), 2009, 144.
.. [4] K. Garg, S. K. Nayar, International Journal of Computer Vision 75(1), 2007, 3-27.
.. [5] S. S. Halder, J.-F. Lalonde, R. de Charette, ICCV 2019, 10203-10212, equation 3.
"""

from __future__ import annotations

import math
import re
import zlib
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from roadeval.data import Rgb
from roadeval.errors import SettingError
from roadeval.runtime.text import likely

Light = npt.NDArray[np.float32]
"""Linear light, ``(H, W, 3)``, or a map of one number a pixel, ``(H, W)``."""

FAR: Final = 80.0
"""Metres beyond which all that stands on the ground hides it: 1/d^2 = 1/ground^2 + 1/FAR^2."""
SKY: Final = 300.0
"""Metres to the sky."""
ROOFS: Final = 6.0
"""How far houses and trees reach above the camera, by its height above the ground."""
HAZE: Final = 0.6
"""Light of the air in fog or rain, by that of the image's brightest hundredth, as a sky has it."""
VISIBILITY: Final = 200.0
"""Metres of visibility (contrast 5 %) in fog of strength 1; strength s has this over s."""
RAIN: Final = 25.0
"""Millimetres an hour of rain of strength 1, a heavy shower."""
WELL: Final = 4096.0
"""Electrons of a white pixel, of noise of strength 1; strength s has this over 4^(s - 1)."""
READ_NOISE: Final = 3.0
"""Standard deviation of the dark, in electrons."""

_CODES: Final = np.arange(256) / 255
_LIGHT: Final = np.where(_CODES <= 0.04045, _CODES / 12.92, ((_CODES + 0.055) / 1.055) ** 2.4)
_LIGHT_OF: Final = _LIGHT.astype(np.float32)
_STEPS: Final = np.arange(1 << 16) / 65535
_CODE_OF: Final = np.rint(
    255 * np.where(_STEPS <= 0.0031308, 12.92 * _STEPS, 1.055 * _STEPS ** (1 / 2.4) - 0.055)
).astype(np.uint8)


def to_light(image: Rgb) -> Light:
    """Return the linear light of sRGB codes."""
    return np.take(_LIGHT_OF, image)


def to_codes(light: Light) -> Rgb:
    """Return the sRGB codes of linear light, which clips at 0 and 1."""
    return np.take(_CODE_OF, (np.clip(light, 0, 1) * 65535 + 0.5).astype(np.uint16))


class Shot(NamedTuple):
    """What a disturbance knows of a frame."""

    depth: Light
    """Metres to the ground, ``(H, W)``, negative above the horizon, NaN where not known."""
    random: np.random.Generator
    """Drawn from the frame's number and the kind."""


def _exposure(image: Rgb, stops: float, _: Shot) -> Rgb:
    """Multiply the light by 2^stops; what exceeds white is clipped."""
    return np.take(to_codes(_LIGHT_OF * np.float32(2**stops)), image)


def _noisy(light: Light, well: float, random: np.random.Generator) -> Rgb:
    """Add the noise of a sensor whose white is ``well`` electrons: variance e + read^2 [2]_.

    Poisson's distribution is taken as normal.
    """
    electrons = light * np.float32(well)
    deviation = np.sqrt(electrons + np.float32(READ_NOISE**2))
    electrons += deviation * random.standard_normal(light.shape, np.float32)
    return to_codes(electrons / np.float32(well))


def _noise(image: Rgb, strength: float, shot: Shot) -> Rgb:
    """Add shot noise and read noise, as at a gain of 4^strength [2]_."""
    return _noisy(to_light(image), WELL * 4 ** (1 - strength), shot.random)


def _dark(image: Rgb, stops: float, shot: Shot) -> Rgb:
    """Divide the light by 2^stops before it falls on a sensor, whose noise stays [2]_."""
    return _noisy(to_light(image) * np.float32(2**-stops), WELL, shot.random)


def _veil(light: Light, per_metre: float, depth: Light) -> tuple[Light, np.float32]:
    """Fade light into that of the air, L t + A (1 - t) with t = exp(-b d) (Koschmieder [1]_).

    What is above the horizon is sky the more the brighter it is. Returned is also A.
    """
    grey = light.mean(axis=2)
    brightest = np.float32(np.percentile(grey[::4, ::4], 99))
    metres = np.where(depth < 0, np.float32(-ROOFS), np.float32(1)) * depth
    metres = np.nan_to_num(1 / np.hypot(1 / metres, np.float32(1 / FAR)), nan=FAR)
    sky = np.clip(grey / max(brightest, np.float32(1e-6)) * 2 - np.float32(0.6), 0, 1)
    metres = np.where(depth > 0, metres, metres + (np.float32(SKY) - metres) * sky)
    through = np.exp(metres * np.float32(-per_metre))[..., None]
    air = np.float32(HAZE) * brightest
    return light * through + air * (1 - through), air


def _fog(image: Rgb, strength: float, shot: Shot) -> Rgb:
    """Fade by distance in fog of a visibility of 200 m / strength, b = -ln 0.05 / V [1]_."""
    per_metre = -math.log(0.05) * strength / VISIBILITY
    return to_codes(_veil(to_light(image), per_metre, shot.depth)[0])


def _blur(image: Rgb, strength: float, _: Shot) -> Rgb:
    """Put the lens out of focus: a point is a disk of light, of radius width / 320 x strength."""
    import cv2

    radius = strength * image.shape[1] / 320
    reach = math.ceil(radius)
    rows, columns = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    disk = np.clip(radius + 0.5 - np.hypot(rows, columns), 0, 1)
    light, kernel = to_light(image), (disk / disk.sum()).astype(np.float32)
    return to_codes(cv2.filter2D(light, -1, kernel, borderType=cv2.BORDER_REPLICATE))


@lru_cache(4)
def _spots(height: int, width: int, strength: float) -> Light:
    """Return how much of each pixel dirt covers, from 0 to 1; the same spots for every frame."""
    random, clear = np.random.default_rng(zlib.crc32(b"dirt")), np.ones((height, width), np.float32)
    rows, columns = np.mgrid[:height, :width].astype(np.float32)
    for number in range(math.ceil(12 * strength)):
        x, y, size, thick, turn, flat = random.random(6)
        radius = width * 0.015 * 6**size
        right, down = columns - x * width, rows - y * height
        along = right * math.cos(3 * turn) + down * math.sin(3 * turn)
        across = (down * math.cos(3 * turn) - right * math.sin(3 * turn)) * (1 + flat)
        edge = np.exp(-(((along**2 + across**2) / radius**2) ** 2))
        part = min(1.0, 12 * strength - number)  # the last one grows
        clear *= 1 - edge * np.float32(part * (0.6 + 0.4 * thick))
    return 1 - clear


def _dirt(image: Rgb, strength: float, _: Shot) -> Rgb:
    """Look through soft spots on the lens, 12 a strength: they dim light, and scatter it [3]_.

    A covered pixel keeps a fifth of its light and gets a quarter of the image's mean.
    """
    light, covered = to_light(image), _spots(*image.shape[:2], strength)[..., None]
    mean = light[::4, ::4].mean(axis=(0, 1))
    return to_codes(light * (1 - np.float32(0.8) * covered) + np.float32(0.25) * mean * covered)


def _rain(image: Rgb, strength: float, shot: Shot) -> Rgb:
    """Fade by distance, b = 0.312 R^0.67 a kilometre [5]_, and add bright streaks.

    R is 25 mm/h x strength. A streak covers a part a of a pixel, L (1 - a) + A a, with the light A
    of the air, which drops refract [4]_; there are 300 a strength, near ones longer.
    """
    import cv2

    height, width = image.shape[:2]
    veiled, air = _veil(to_light(image), 0.312e-3 * (RAIN * strength) ** 0.67, shot.depth)
    streaks = np.zeros((height, width), np.uint8)
    slant = shot.random.normal(0.1, 0.05)
    for x, y, near, thick in shot.random.random((round(300 * strength), 4)):
        length = height * (0.02 + 0.1 * near**2)
        start = round(x * width * 1.2 - 0.1 * width), round(y * height * 1.1 - 0.1 * height)
        end = round(start[0] + slant * length), round(start[1] + length)
        wide = max(1, round(width / 640 * (1 + near)))
        cv2.line(streaks, start, end, round(50 + 70 * thick), wide, cv2.LINE_AA)
    part = cv2.blur(streaks, (2, 3)).astype(np.float32)[..., None] / 255
    return to_codes(veiled * (1 - part) + air * part)


def _jpeg(image: Rgb, quality: float, _: Shot) -> Rgb:
    """Compress as a JPEG of this quality, as libjpeg counts it, with half the colour's samples."""
    import cv2

    bgr = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    file = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, round(quality)])[1]
    decoded = cv2.imdecode(file, cv2.IMREAD_COLOR)
    return np.asarray(cv2.cvtColor(decoded, cv2.COLOR_BGR2RGB), np.uint8)


class Kind(NamedTuple):
    """A kind of disturbance."""

    title: str
    apply: Callable[[Rgb, float, Shot], Rgb]
    least: float
    most: float
    """Range of its strength."""


KINDS: Final[Mapping[str, Kind]] = {
    "dark": Kind("less light, in stops", _dark, 0, 12),
    "fog": Kind("fog, 200 m of visibility over", _fog, 0, 20),
    "blur": Kind("out of focus, disk in 1/320 of the width", _blur, 0, 20),
    "dirt": Kind("dirt on the lens, dozens of spots", _dirt, 0, 10),
    "rain": Kind("rain, in 25 mm/h", _rain, 0, 10),
    "jpeg": Kind("JPEG of a quality", _jpeg, 1, 100),
    "noise": Kind("noise of a sensor, gain in 4^", _noise, 0, 6),
    "exposure": Kind("exposure, in stops", _exposure, -10, 10),
}


class Disturbance(NamedTuple):
    """A kind with its strength.

    >>> Disturbance.parse("exposure:-0.5").name, str(Disturbance.parse("exposure:1"))
    ('exposure-minus0_5', 'exposure:+1')
    """

    kind: str
    strength: float

    @classmethod
    def parse(cls, text: str) -> Disturbance:
        """Read ``KIND:STRENGTH``; a `SettingError` with the kinds, or the range, if it is none."""
        kind, _, number = text.strip().partition(":")
        known = KINDS.get(kind)
        if known is None:
            remedy = f"{likely(kind, KINDS)}choose {', '.join(KINDS)} (as fog:2)"
            raise SettingError(f"there is no disturbance {kind!r}", remedy=remedy)
        is_number = re.fullmatch(r"[+-]?\d{1,3}(\.\d{1,3})?", number)
        if not is_number or not known.least <= float(number) <= known.most:
            allowed = f"{known.least:g} to {known.most:g}"
            problem = f"the strength of {kind} is a number from {allowed}: {known.title}"
            raise SettingError(f"{problem} (given: {text!r})")
        return cls(kind, float(number) + 0.0)

    @property
    def name(self) -> str:
        """Its name in tables and paths, as ``fog-2`` and ``exposure-plus1``."""
        sign = "" if KINDS[self.kind].least >= 0 else "minus" if self.strength < 0 else "plus"
        return f"{self.kind}-{sign}{abs(self.strength):g}".replace(".", "_")

    def __str__(self) -> str:
        sign = "+" if KINDS[self.kind].least < 0 < self.strength else ""
        return f"{self.kind}:{sign}{self.strength:g}"

    def of(self, image: Rgb, frame: int, depth: Light | None = None) -> Rgb:
        """Return an image, ``(H, W, 3)`` uint8 RGB, with this disturbance.

        ``frame`` is the number that seeds what is drawn at random; ``depth`` is that of `Shot`,
        by default that of `assumed_depth`.
        """
        if self.strength == 0:
            return image
        if depth is None or depth.shape != image.shape[:2]:
            depth = assumed_depth(*image.shape[:2])
        random = np.random.default_rng((zlib.crc32(self.kind.encode()), frame))
        return KINDS[self.kind].apply(image, self.strength, Shot(depth, random))


@lru_cache(4)
def assumed_depth(height: int, width: int) -> Light:
    """Return the metres to flat ground, by row: h f / (row - horizon).

    A camera like many in cars is assumed: at h = 1.4 m, of f = 0.8 of the width, with the horizon
    at 45 % of the height.
    """
    below = np.arange(height, dtype=np.float32) - np.float32(0.45 * height - 0.01)
    metres = np.float32(1.4 * 0.8 * width) / below
    return np.ascontiguousarray(np.broadcast_to(metres[:, None], (height, width)))

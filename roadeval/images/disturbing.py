"""Disturbed images: a frame in the dark, in fog, out of focus, through a dirty lens, in rain.

A disturbance is a pure function of an image, seeded by the frame's number: threads change nothing.
Strength 0 returns the image itself. Light is linear, 0 to 1 (the inverse of sRGB's curve, IEC
61966-2-1). To add a kind, add a line to `BUILT_IN`; another package adds one by an entry point of
the group ``roadeval.disturbances``.
"""

from __future__ import annotations

import math
import re
import zlib
from collections.abc import Callable, Mapping
from functools import cache, lru_cache
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from roadeval.data import Rgb
from roadeval.errors import SettingError
from roadeval.runtime.discovery import by_name, installed
from roadeval.runtime.text import likely

Light = npt.NDArray[np.float32]
"""Linear light, ``(H, W, 3)``, or a number a pixel, ``(H, W)``."""

FAR, SKY = 80.0, 300.0
"""Metres beyond which objects hide the ground (1/d^2 = 1/ground^2 + 1/FAR^2), and metres to the
sky."""
ROOFS: Final = 6.0
"""Height of houses and trees above the camera, in units of the camera's height above the ground."""
WELL, READ_NOISE = 4096.0, 3.0
"""Electrons of a white pixel, and the standard deviation of a dark one."""

_CODES, _STEPS = np.arange(256) / 255, np.arange(1 << 16) / 65535
_LIGHT_OF: Final = np.where(
    _CODES <= 0.04045, _CODES / 12.92, ((_CODES + 0.055) / 1.055) ** 2.4
).astype(np.float32)
_CODE_OF: Final = np.rint(
    255 * np.where(_STEPS <= 0.0031308, 12.92 * _STEPS, 1.055 * _STEPS ** (1 / 2.4) - 0.055)
).astype(np.uint8)


def to_light(image: Rgb) -> Light:
    """Return the linear light of ``(H, W, 3)`` sRGB codes."""
    return np.take(_LIGHT_OF, image)


def to_codes(light: Light) -> Rgb:
    """Return the sRGB codes of linear light, which clips at 0 and 1."""
    return np.take(_CODE_OF, (np.clip(light, 0, 1) * 65535 + 0.5).astype(np.uint16))


Random = np.random.Generator
Apply = Callable[[Rgb, float, Light, Random], Rgb]
"""A function of the image, the strength, the depth, and the random generator.

The depth is ``(H, W)`` metres to the ground, negative above the horizon, NaN if not known."""


def exposure(image: Rgb, stops: float, *_: object) -> Rgb:
    """Multiply the light by 2^stops, and clip it at white."""
    return np.take(to_codes(_LIGHT_OF * np.float32(2**stops)), image)


def _noisy(light: Light, well: float, random: Random) -> Rgb:
    """Add shot and read noise: the variance of e electrons is e + read^2 (EMVA 1288, 2.2)."""
    deviation = np.sqrt(light * np.float32(well) + np.float32(READ_NOISE**2))
    drawn = random.standard_normal(light.shape, np.float32)
    return to_codes(light + deviation * drawn / np.float32(well))


def noise(image: Rgb, strength: float, _: Light, random: Random) -> Rgb:
    """Add the noise of a sensor with 4096 / 4^(strength - 1) electrons in a white pixel."""
    return _noisy(to_light(image), WELL * 4 ** (1 - strength), random)


def dark(image: Rgb, stops: float, _: Light, random: Random) -> Rgb:
    """Divide the light by 2^stops before it falls on the sensor; the sensor's noise stays."""
    return _noisy(to_light(image) * np.float32(2**-stops), WELL, random)


def _veil(light: Light, per_metre: float, depth: Light) -> tuple[Light, np.float32]:
    """Return light faded into the air's, L t + A (1 - t), t = exp(-b d) (Koschmieder, 1924), and A.

    A is 0.6 of the brightest hundredth of the image; bright pixels above the horizon are sky.
    """
    grey = light.mean(axis=2)
    brightest = np.float32(np.percentile(grey[::4, ::4], 99) + 1e-6)
    metres = np.where(depth < 0, np.float32(-ROOFS), np.float32(1)) * depth
    metres = np.nan_to_num(1 / np.hypot(1 / metres, np.float32(1 / FAR)), nan=FAR)
    sky = np.clip(grey / brightest * 2 - np.float32(0.6), 0, 1) * ~(depth > 0)
    through = np.exp((metres + (np.float32(SKY) - metres) * sky) * np.float32(-per_metre))
    air = np.float32(0.6) * brightest
    return air + (light - air) * through[..., None], air


def fog(image: Rgb, strength: float, depth: Light, _: Random) -> Rgb:
    """Fade in fog of 200 m / strength of visibility V: b = -ln 0.05 / V (WMO-No. 8, chapter 9)."""
    return to_codes(_veil(to_light(image), -math.log(0.05) * strength / 200, depth)[0])


def blur(image: Rgb, strength: float, *_: object) -> Rgb:
    """Put the lens out of focus: a point is a disk of light, of radius width / 320 x strength."""
    import cv2

    radius = strength * image.shape[1] / 320
    reach = np.arange(-math.ceil(radius), math.ceil(radius) + 1)
    disk = np.clip(radius + 0.5 - np.hypot(reach, reach[:, None]), 0, 1)
    return to_codes(cv2.filter2D(to_light(image), -1, disk / disk.sum()))


@lru_cache(4)
def _spots(height: int, width: int, strength: float) -> Light:
    """Return how much of each pixel dirt covers, from 0 to 1; the same for every frame."""
    random, clear = np.random.default_rng(zlib.crc32(b"dirt")), np.ones((height, width))
    rows, columns = np.mgrid[:height, :width]
    for number in range(math.ceil(12 * strength)):
        x, y, size, thick, turn, flat = random.random(6)
        at = ((columns - x * width) + 1j * (rows - y * height)) * np.exp(3j * turn)
        edge = np.hypot(at.real, at.imag * (1 + flat)) / (width * 0.015 * 6**size)
        part = min(1.0, 12 * strength - number)  # the last spot grows
        clear *= 1 - np.exp(-(edge**4)) * part * (0.6 + 0.4 * thick)
    return (1 - clear).astype(np.float32)


def dirt(image: Rgb, strength: float, *_: object) -> Rgb:
    """Add 12 x strength soft spots, which dim and scatter light (Gu et al., 2009, eq. 2).

    A covered pixel keeps a fifth of its light, and gets a quarter of the image's mean.
    """
    light, covered = to_light(image), _spots(*image.shape[:2], strength)[..., None]
    scattered = np.float32(0.25) * light[::4, ::4].mean(axis=(0, 1))
    return to_codes(light + (scattered - np.float32(0.8) * light) * covered)


def rain(image: Rgb, strength: float, depth: Light, random: Random) -> Rgb:
    """Fade as in rain of R = 25 mm/h x strength, b = 0.312 R^0.67 / km (Halder et al., 2019).

    Then draw 300 x strength streaks, near ones longer: L (1 - a) + A a, with the light A of the
    air, which drops refract (Garg and Nayar, 2007).
    """
    import cv2

    height, width = image.shape[:2]
    light, air = _veil(to_light(image), 0.312e-3 * (25 * strength) ** 0.67, depth)
    streaks, slant = np.zeros((height, width), np.uint8), random.normal(0.1, 0.05)
    for x, y, near, thick in random.random((round(300 * strength), 4)):
        length = height * (0.02 + 0.1 * near**2)
        left, top = (1.2 * x - 0.1) * width, (1.1 * y - 0.1) * height
        start, end = ((round(left + y * slant), round(top + y)) for y in (0, length))
        thickness = max(1, round(width / 640 * (1 + near)))
        cv2.line(streaks, start, end, round(50 + 70 * thick), thickness, cv2.LINE_AA)
    part = cv2.blur(streaks, (2, 3)).astype(np.float32)[..., None] / 255
    return to_codes(light + (air - light) * part)


def jpeg(image: Rgb, quality: float, *_: object) -> Rgb:
    """Compress as a JPEG of this quality, as libjpeg counts it."""
    import cv2

    file = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, round(quality)])[1]
    decoded = np.asarray(cv2.imdecode(file, cv2.IMREAD_COLOR), np.uint8)
    return np.ascontiguousarray(decoded[..., ::-1])


class DisturbanceKind(NamedTuple):
    """A kind of disturbance, such as fog."""

    name: str
    """Its word in ``--disturb`` and, with the strength, in tables and paths: lower-case letters."""
    title: str
    """Unit of the strength, such as ``stops of less light``."""
    apply: Apply
    """Returns the disturbed image as a new array, ``(H, W, 3)`` uint8; not called at strength 0."""
    least: float
    """Least strength that `Disturbance.parse` takes. If it is negative, strengths have a sign."""
    most: float
    """Greatest strength that it takes."""


BUILT_IN: Final = (
    DisturbanceKind("dark", "stops of less light", dark, 0, 12),
    DisturbanceKind("fog", "200 m over the visibility", fog, 0, 20),
    DisturbanceKind("blur", "radius in 1/320 of the width", blur, 0, 20),
    DisturbanceKind("dirt", "dozens of spots on the lens", dirt, 0, 10),
    DisturbanceKind("rain", "25 mm/h", rain, 0, 10),
    DisturbanceKind("jpeg", "quality; a lower one is worse", jpeg, 1, 100),
    DisturbanceKind("noise", "gain as a power of 4", noise, 0, 6),
    DisturbanceKind("exposure", "stops of more light, or less", exposure, -10, 10),
)


@cache
def kinds() -> Mapping[str, DisturbanceKind]:
    """Return the kinds by their names, other packages' kinds last."""
    names = [kind.name for kind in BUILT_IN]
    others = installed("disturbances", DisturbanceKind, SettingError, names)
    return by_name((*BUILT_IN, *others))


class Disturbance(NamedTuple):
    """A kind with its strength.

    >>> Disturbance.parse("exposure:-0.5").name, str(Disturbance.parse("exposure:1"))
    ('exposure-minus0_5', 'exposure:+1')
    """

    kind: str
    strength: float

    @classmethod
    def parse(cls, text: str) -> Disturbance:
        """Read ``KIND:STRENGTH``; a `SettingError` that lists the allowed ones if it is none."""
        kind, _, number = text.strip().lower().partition(":")
        if (allowed := kinds().get(kind)) is None:
            remedy = f"{likely(kind, kinds())}choose {', '.join(kinds())} (as fog:2)"
            raise SettingError(f"there is no disturbance {kind!r}", remedy=remedy)
        is_number = re.fullmatch(r"[+-]?\d{1,3}(\.\d{1,3})?", number)
        if not is_number or not allowed.least <= float(number) <= allowed.most:
            ends = f"from {allowed.least:g} to {allowed.most:g} ({allowed.title})"
            ends += f", as {kind}:{np.clip(2, allowed.least, allowed.most):g}"
            raise SettingError(f"{text!r}: the strength of {kind} must be {ends}")
        return cls(kind, float(number) + 0.0)

    @property
    def name(self) -> str:
        """Its name in tables and paths, such as ``fog-2``."""
        sign = "" if not self.is_signed else "minus" if self.strength < 0 else "plus"
        return f"{self.kind}-{sign}{abs(self.strength):g}".replace(".", "_")

    @property
    def is_signed(self) -> bool:
        """Whether strengths may be negative; False for a kind that is not installed here."""
        return self.kind in kinds() and kinds()[self.kind].least < 0

    def __str__(self) -> str:
        sign = "+" if self.is_signed and self.strength > 0 else ""
        return f"{self.kind}:{sign}{self.strength:g}"

    def of(self, image: Rgb, frame: int, depth: Light | None = None) -> Rgb:
        """Return an image, ``(H, W, 3)`` uint8 RGB, with this disturbance.

        ``frame`` seeds the random numbers; ``depth`` is as in `Apply`, by default `assumed_depth`.
        """
        if self.strength == 0:
            return image
        if depth is None or depth.shape != image.shape[:2]:
            depth = assumed_depth(*image.shape[:2])
        random = np.random.default_rng((zlib.crc32(self.kind.encode()), frame))
        return kinds()[self.kind].apply(image, self.strength, depth, random)


@lru_cache(4)
def assumed_depth(height: int, width: int) -> Light:
    """Return the metres to flat ground at each pixel, h f / (row - horizon), for a usual car.

    Its camera is at h = 1.4 m, with f = 0.8 of the width and the horizon at 45 % of the height.
    """
    metres = 1.4 * 0.8 * width / (np.arange(height) - 0.45 * height + 0.01)
    return np.repeat(metres.astype(np.float32)[:, None], width, axis=1)

"""Other cars: painted on five panels each, a body and a cabin in the sun's way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from benchmarks.world.light import Sun
from benchmarks.world.noise import Field, Reflectance
from benchmarks.world.panel import Panel, Picture
from roadeval.data.arrays import Floats

PIXELS_PER_METRE: Final = 90.0
WIDTH: Final = 1.76
LENGTH: Final = 4.2
HEIGHT: Final = 1.46
BODY: Final = (0.0, LENGTH, 0.95)
CABIN: Final = (0.6, 3.1, HEIGHT)
"""Two boxes that cast the shadow: begin and end from the tail, height, metres."""
BONNET: Final = (1.05, 0.8)
BOOT: Final = (0.2, 0.5)
"""Length of the deck between a car's end and its window, and how far that slopes back, metres."""
BELT: Final = 0.96
"""Height of the lower edge of the windows, metres."""
LEAN: Final = 0.30
"""How far the sides lean inwards from there to the roof, metres."""
SEAM: Final = 1.03
"""Panels are stretched by this over their upper neighbours, so that nothing shines through."""

GLASS: Final[Reflectance] = (0.05, 0.06, 0.075)
RUBBER: Final[Reflectance] = (0.02, 0.02, 0.02)
TAIL_LAMP: Final[Reflectance] = (0.24, 0.02, 0.02)
HEAD_LAMP: Final[Reflectance] = (0.60, 0.60, 0.58)
PLATE: Final[Reflectance] = (0.60, 0.60, 0.50)
HUB: Final[Reflectance] = (0.17, 0.17, 0.17)

SIDE: Final = (
    (0.0, 0.35), (0.03, 0.95), (0.25, 1.0), (0.75, 1.40), (1.3, HEIGHT), (2.2, HEIGHT),
    (3.05, 0.98), (3.95, 0.82), (4.17, 0.6), (LENGTH, 0.32),
)  # fmt: skip
SIDE_GLASS: Final = ((0.62, 1.0), (0.92, 1.34), (1.35, 1.38), (2.15, 1.38), (2.8, 0.99))
END: Final = (
    (0.04, 0.28), (0.0, 0.6), (0.0, 0.96), (0.26, 1.40), (0.4, HEIGHT), (WIDTH - 0.4, HEIGHT),
    (WIDTH - 0.26, 1.40), (WIDTH, 0.96), (WIDTH, 0.6), (WIDTH - 0.04, 0.28),
)  # fmt: skip
END_GLASS: Final = ((0.22, 0.98), (0.36, 1.34), (WIDTH - 0.36, 1.34), (WIDTH - 0.22, 0.98))


@dataclass(frozen=True, slots=True, eq=False)
class CarPaint:
    """The painted sides of a car.

    Parameters
    ----------
    window, deck, face
        The end that is nearer to us; the deck is the bonnet or the lid of the boot.
    doors, side_windows
        The side, below and above `BELT`.
    oncoming
        Whether it is the front that is nearer to us.
    """

    window: Picture
    deck: Picture
    face: Picture
    doors: Picture
    side_windows: Picture
    oncoming: bool


def paint(body: Reflectance, oncoming: bool, sun: Sun) -> CarPaint:
    """Paint a car: from behind and its left, or, ``oncoming``, from ahead and its left."""
    near = sun.facing(np.array([0.0, 0.0, -1.0]))
    beside = sun.facing(np.array([1.0 if oncoming else -1.0, 0.0, 0.0]))
    above = sun.facing(np.array([0.0, 1.0, 0.0]))
    side, end = _side(body), _end(body, oncoming)
    belt = len(end) - round(BELT * PIXELS_PER_METRE)
    side = side[:, ::-1] if oncoming else side
    deck = np.full((64, 64, 4), (*body, 1.0), np.float32)
    return CarPaint(
        window=_lit(end[:belt], near, 0.95),
        deck=_lit(deck, above, 1.0),
        face=_lit(end[belt:], near, 0.6),
        doors=_lit(side[belt:], beside, 0.6),
        side_windows=_lit(side[:belt], beside, 0.85),
        oncoming=oncoming,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Car:
    """A car at a moment.

    Parameters
    ----------
    look
        Its pictures.
    foot
        ``(3,)`` metres: the ground below the middle of its nearer end.
    heading
        Of the road there, radians from +Z.
    sunlit
        Share of the sun's disc that the things around leave to it.
    """

    look: CarPaint
    foot: Floats
    heading: float
    sunlit: float

    def panels(self, camera_x: float) -> tuple[Panel, ...]:
        """Return the side that faces ``camera_x``, then window, deck and face of the nearer end."""
        across, along = self._axes()
        left = self.foot - across * WIDTH / 2
        inward = across if camera_x < self.foot[0] else -across
        flank = left if camera_x < self.foot[0] else left + across * WIDTH
        up, above = np.array([0.0, BELT, 0.0]), np.array([0.0, HEIGHT - BELT, 0.0])
        length, rake = BONNET if self.look.oncoming else BOOT
        deck, lean, glass = length * along, above + LEAN * inward, above + rake * along
        long, wide = along * LENGTH, across * WIDTH
        return tuple(
            Panel(picture, corner, right, down, self.sunlit)
            for picture, corner, right, down in (
                (self.look.side_windows, flank + up + lean, long, -lean),
                (self.look.doors, flank + SEAM * up, long, -SEAM * up),
                (self.look.window, left + up + deck + glass, wide, -glass),
                (self.look.deck, left + up + SEAM * deck, wide, -SEAM * deck),
                (self.look.face, left + SEAM * up, wide, -SEAM * up),
            )
        )

    def shadow(self, sun: Sun) -> list[Floats]:
        """Outlines of the car's shadow on the ground, ``(n, 3)`` metres each."""
        begin, end, height = CABIN
        if self.look.oncoming:
            begin, end = LENGTH - end, LENGTH - begin
        return [self._outline(sun, *BODY), self._outline(sun, begin, end, height)]

    def footprint(self) -> Floats:
        """``(4, 3)`` corners of the ground below the car."""
        across, along = self._axes()
        corners = [(-0.5, 0.0), (0.5, 0.0), (0.5, 1.0), (-0.5, 1.0)]
        return np.array([self.foot + x * WIDTH * across + z * LENGTH * along for x, z in corners])

    def _outline(self, sun: Sun, begin: float, end: float, height: float) -> Floats:
        across, along = self._axes()
        corners = np.array(
            [self.foot + x * WIDTH * across + z * along + (0.0, y, 0.0)
             for x in (-0.45, 0.45) for z in (begin, end) for y in (0.15, height)]
        )  # fmt: skip
        hull = cv2.convexHull(sun.shadow_of(corners).astype(np.float32))[:, 0].astype(np.float64)
        return np.insert(hull, 1, 0.0, axis=1)

    def _axes(self) -> tuple[Floats, Floats]:
        sin, cos = np.sin(self.heading), np.cos(self.heading)
        return np.array([cos, 0.0, -sin]), np.array([sin, 0.0, cos])


def _lit(image: Field, facing: float, sky: float) -> Picture:
    """Light a painted panel, ``(h, w, 4)`` RGB and opacity: the sky shines more on its top."""
    gloss = np.linspace(1.3 * sky, 0.7 * sky, len(image), dtype=np.float32)[:, None]
    lit = float(facing > 0)
    return Picture.painted(image, facing, gloss, lit)


def _canvas(width: float) -> Field:
    return np.zeros(
        (round(HEIGHT * PIXELS_PER_METRE), round(width * PIXELS_PER_METRE), 4), np.float32
    )


def _fill(image: Field, outline: Sequence[tuple[float, float]], colour: Reflectance) -> None:
    """Fill a polygon given in metres from the lower left corner."""
    points = np.array(outline) * (1, -1) + (0, HEIGHT)
    cv2.fillPoly(image, [np.round(points * PIXELS_PER_METRE).astype(np.int32)], (*colour, 1.0))


def _box(image: Field, corners: tuple[float, float, float, float], colour: Reflectance) -> None:
    """Fill a rectangle: left, bottom, right and top in metres from the lower left corner."""
    left, bottom, right, top = corners
    _fill(image, [(left, bottom), (right, bottom), (right, top), (left, top)], colour)


def _end(body: Reflectance, oncoming: bool) -> Field:
    """Paint the end of a car, ``(h, w, 4)`` RGB and opacity."""
    image = _canvas(WIDTH)
    for left in (0.1, WIDTH - 0.32):
        _box(image, (left, 0.0, left + 0.22, 0.4), RUBBER)
    _fill(image, END, body)
    _fill(image, END_GLASS, GLASS)
    _box(image, (0.05, 0.28, WIDTH - 0.05, 0.40), RUBBER)
    lamp, height = (HEAD_LAMP, 0.62) if oncoming else (TAIL_LAMP, 0.74)
    for left in (0.06, WIDTH - 0.36):
        _box(image, (left, height, left + 0.30, height + 0.16), lamp)
    if oncoming:
        _box(image, (0.45, 0.56, WIDTH - 0.45, 0.70), RUBBER)
    _box(image, (WIDTH / 2 - 0.26, 0.44, WIDTH / 2 + 0.26, 0.55), PLATE)
    return image


def _side(body: Reflectance) -> Field:
    """Paint the side of a car, tail to the left, ``(h, w, 4)`` RGB and opacity."""
    image = _canvas(LENGTH)
    _fill(image, SIDE, body)
    _fill(image, SIDE_GLASS, GLASS)
    dark = tuple(0.5 * c for c in body)
    for z in (0.95, 1.75, 2.65):
        _box(image, (z, 0.4, z + 0.02, 0.98), (dark[0], dark[1], dark[2]))
    _box(image, (1.7, 0.98, 1.78, 1.40), body)
    for z in (0.78, 3.42):
        centre = round(z * PIXELS_PER_METRE), round((HEIGHT - 0.31) * PIXELS_PER_METRE)
        for radius, colour in ((0.37, RUBBER), (0.22, HUB)):
            cv2.circle(image, centre, round(radius * PIXELS_PER_METRE), (*colour, 1.0), -1)
    return image

"""Figure 2 of the paper: what the camera saw, and which part of it was called road."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from roadeval.data import IGNORE, ROAD, Mask, Rgb, Truth, colours
from roadeval.report.figures.figure import (
    EXAMPLE_WIDTH,
    ExampleFrame,
    FigureData,
    FigureSpec,
    variants_of,
)
from roadeval.report.figures.layout import INCH, LETTERS, SMALL, fitting, width_of
from roadeval.report.figures.style import FAINT, INK, heading
from roadeval.report.images import faded, shrink

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH: Final = 8
"""Inches across the figure."""
LEFT: Final = 0.28
TOP: Final = 0.78
"""Inches left of and above the pictures, for the frames' numbers and the titles."""
GAP: Final = 0.05
"""Inches between pictures, and to what names them."""


def road_masks(data: FigureData) -> Figure | None:
    """Draw a row a frame: the image, each variant's mask over it, and the truth over it."""
    from matplotlib.figure import Figure
    from matplotlib.transforms import Bbox

    from roadeval.report.figures.picture import Picture

    if not data.examples:
        return None
    truth = any(example.truth is not None for example in data.examples)
    names = variants_of(data.examples)
    rows = [_pictures(example, names, truth=truth) for example in data.examples]
    height, width = rows[0]["camera image"].shape[:2]
    across = (WIDTH - LEFT) / len(rows[0])
    down = (across - GAP) * height / width + GAP
    total = TOP + down * len(rows) + GAP
    figure = Figure(figsize=(WIDTH, total))
    heading(figure, f"Road masks on {data.drive}", _legend(data.examples))
    for number, (example, pictures) in enumerate(zip(data.examples, rows, strict=True)):
        top, bottom = (1 - (TOP + at) / total for at in (number * down, (number + 1) * down - GAP))
        name = f"frame {example.frame}"
        if width_of(name) > INCH * (down - GAP):
            name = str(example.frame)
        _name_row(figure, name, (top + bottom) / 2)
        for column, (title, picture) in enumerate(pictures.items()):
            left, right = (
                (LEFT + at) / WIDTH for at in (column * across, (column + 1) * across - GAP)
            )
            Picture(figure, picture, Bbox.from_extents(left, bottom, right, top))
            if number == 0:
                name = fitting(title, INCH * (across - GAP), LETTERS)
                _name_column(figure, name, (left + right) / 2, top)
    return figure


FIGURE = FigureSpec(
    "fig2_masks", "The paper's figure 2: input and output images, and the truth.", road_masks
)


def _pictures(example: ExampleFrame, variants: Sequence[str], *, truth: bool) -> dict[str, Rgb]:
    """Return an example's pictures by their columns' titles."""
    image = example.image
    pictures = {"camera image": shrink(image, EXAMPLE_WIDTH)}
    for name in variants:
        mask = example.masks.get(name)
        small = shrink(image, EXAMPLE_WIDTH)
        pictures[name] = faded(small) if mask is None else _overlay(image, mask)
    return pictures | ({"ground truth": _overlay(image, example.truth)} if truth else {})


def _legend(examples: Sequence[ExampleFrame]) -> str:
    ignored = any(e.truth is not None and (e.truth == IGNORE).any() for e in examples)
    missing = any(len(e.masks) < len(variants_of(examples)) for e in examples)
    return (
        "Green with a white edge: road"
        + "; grey: ignored, counted nowhere" * ignored
        + "; faded: there is no mask of this frame" * missing
    )


def _name_row(figure: Figure, name: str, middle: float) -> None:
    """Write a frame's name beside its row, whose middle is a share of the figure's height."""
    figure.text(
        *((LEFT - GAP) / WIDTH, middle, name),
        rotation=90,
        ha="right",
        va="center",
        size=SMALL,
        color=FAINT,
    )


def _name_column(figure: Figure, title: str, middle: float, top: float) -> None:
    """Write a title above a column, whose middle and top are shares of the figure."""
    above = GAP / figure.get_figheight()
    figure.text(middle, top + above, title, size=LETTERS, color=INK, ha="center", va="bottom")


def _overlay(image: Rgb, labels: Mask | Truth | None) -> Rgb:
    """Draw a mask or a truth over the image: road tinted, with a white edge; ignored pixels grey.

    The edge tells the road apart in a black and white print, too.
    """
    import cv2

    base = shrink(image, EXAMPLE_WIDTH)
    if labels is None:
        return base
    small = shrink(labels, EXAMPLE_WIDTH, labels=True)
    picture = base.astype(np.float32)
    for value, colour, strength in ((ROAD, colours.ROAD, 0.45), (IGNORE, colours.IGNORE, 0.8)):
        here = small == value
        picture[here] += strength * (np.array(colour, np.float32) - picture[here])
    road = (small == ROAD).view(np.uint8)
    picture[cv2.erode(road, np.ones((3, 3), np.uint8)) != road] = 255
    return np.rint(picture).astype(np.uint8)

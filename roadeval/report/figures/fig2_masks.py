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
from roadeval.report.figures.style import FAINT, INK, heading
from roadeval.report.images import faded, shrink

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH: Final = 8
"""Inches across the figure."""
LEFT: Final = 0.28
TOP: Final = 0.78
"""Inches left of and above the pictures, for the frames' numbers and the titles."""


def road_masks(data: FigureData) -> Figure | None:
    """Draw a row a frame: the image, each variant's mask over it, and the truth over it."""
    from matplotlib.figure import Figure

    from roadeval.report.figures.picture import Picture

    if not data.examples:
        return None
    truth = any(example.truth is not None for example in data.examples)
    names = variants_of(data.examples)
    rows = [_pictures(example, names, truth=truth) for example in data.examples]
    height, width = rows[0]["camera image"].shape[:2]
    row = (WIDTH - LEFT) / len(rows[0]) * height / width
    total = TOP + row * len(rows) + 0.05
    figure = Figure(figsize=(WIDTH, total))
    heading(figure, f"Road masks on {data.drive}", _legend(data.examples))
    grid = figure.subplots(len(rows), len(rows[0]), squeeze=False)
    for axes, example, pictures in zip(grid, data.examples, rows, strict=True):
        for ax, picture in zip(axes, pictures.values(), strict=True):
            Picture(ax, picture)
        _name_row(axes[0], example.frame)
    for ax, title in zip(grid[0], rows[0], strict=True):
        ax.set_title(title, color=INK, pad=4, y=1)
    figure.subplots_adjust(
        left=LEFT / WIDTH,
        right=0.995,
        bottom=0.05 / total,
        top=1 - TOP / total,
        wspace=0.02,
        hspace=0.03,
    )
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


def _name_row(ax: Axes, frame: int) -> None:
    ax.text(
        *(-0.03, 0.5, f"frame {frame}"),
        transform=ax.transAxes,
        rotation=90,
        ha="right",
        va="center",
        size=8,
        color=FAINT,
    )


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

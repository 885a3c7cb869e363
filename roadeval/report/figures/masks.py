"""Figure 2 of the paper: what the camera saw, and which part of it was called road."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from roadeval.data import IGNORE, ROAD, Mask, Rgb, Truth
from roadeval.report.figures.style import FAINT, INK, heading

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH: Final = 400
"""Pixels across a picture, at most."""
LEFT: Final = 0.28
TOP: Final = 0.78
"""Inches left of and above the pictures, for the frames' numbers and the titles."""
GREEN: Final = (0, 158, 115)
GREY: Final = (128, 128, 128)


@dataclass(frozen=True, slots=True, eq=False)
class Example:
    """A frame worth showing: its image, its truth if it has one, and each variant's final mask.

    ``image`` is ``(H, W, 3)`` uint8 RGB, ``truth`` ``(H, W)`` uint8 (0, 1, 255) and each of
    ``masks``, by variant, ``(H, W)`` uint8 (0, 1).
    """

    frame: int
    image: Rgb
    truth: Truth | None
    masks: Mapping[str, Mask]

    def small(self) -> Example:
        """Give it as the figure draws it, which a run can keep at little cost until its end."""
        truth = None if self.truth is None else _fitted(self.truth, self.image)
        masks = {name: _fitted(mask, self.image) for name, mask in self.masks.items()}
        return Example(self.frame, _shrunk(self.image), truth, masks)


def road_masks(drive: str, examples: Sequence[Example]) -> Figure:
    """Draw figure 2: a row a frame, with the image, each mask over it, and the truth over it.

    Parameters
    ----------
    drive
        Stands in the title.
    examples
        At least one, all of the variants of the first.
    """
    from matplotlib.figure import Figure

    columns = _columns(examples)
    width, height = _size(examples[0].image)
    row = (8 - LEFT) / len(columns) * height / width
    total = TOP + row * len(examples) + 0.05
    figure = Figure(figsize=(8, total))
    heading(figure, f"Road masks on {drive}", _legend(examples))
    grid = figure.subplots(len(examples), len(columns), squeeze=False)
    for axes, example in zip(grid, examples, strict=True):
        for ax, picture in zip(axes, columns.values(), strict=True):
            ax.set_axis_off()
            ax.imshow(picture(example), interpolation="antialiased", aspect="auto")
        _name_row(axes[0], example.frame)
    for ax, title in zip(grid[0], columns, strict=True):
        ax.set_title(title, color=INK, pad=4)
    figure.subplots_adjust(
        left=LEFT / 8,
        right=0.995,
        bottom=0.05 / total,
        top=1 - TOP / total,
        wspace=0.02,
        hspace=0.03,
    )
    return figure


def _columns(examples: Sequence[Example]) -> dict[str, Callable[[Example], Rgb]]:
    """Say what each column shows, by its title."""
    columns: dict[str, Callable[[Example], Rgb]] = {"camera image": lambda e: _shrunk(e.image)}
    for variant in examples[0].masks:
        columns[variant] = partial(_mask_picture, variant)
    if any(example.truth is not None for example in examples):
        columns["ground truth"] = lambda e: _overlay(e.image, e.truth)
    return columns


def _mask_picture(variant: str, example: Example) -> Rgb:
    return _overlay(example.image, example.masks[variant])


def _legend(examples: Sequence[Example]) -> str:
    ignored = any(e.truth is not None and (e.truth == IGNORE).any() for e in examples)
    return "Green with a white edge: road" + ("; grey: ignored, counted nowhere" * ignored)


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
    """Lay a mask or a truth over the image: road tinted and edged in white, ignored pixels grey.

    The edge tells the road apart in a black and white print, too.
    """
    import cv2

    base = _shrunk(image)
    if labels is None:
        return base
    small = _fitted(labels, image)
    painted = base.astype(np.float32)
    for value, colour, strength in ((ROAD, GREEN, 0.45), (IGNORE, GREY, 0.8)):
        here = small == value
        painted[here] += strength * (np.array(colour, np.float32) - painted[here])
    road = (small == ROAD).view(np.uint8)
    painted[cv2.erode(road, np.ones((3, 3), np.uint8)) != road] = 255
    return np.rint(painted).astype(np.uint8)


def _shrunk(image: Rgb) -> Rgb:
    """Bring an image down to `WIDTH` pixels across, if it is wider."""
    import cv2

    size = _size(image)
    if size[0] == image.shape[1]:
        return image
    small: Rgb = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return small


def _fitted(labels: Mask | Truth, image: Rgb) -> Mask | Truth:
    """Bring labels to the size in which their image is drawn."""
    import cv2

    fitted: Mask | Truth = cv2.resize(labels, _size(image), interpolation=cv2.INTER_NEAREST)
    return fitted


def _size(image: Rgb) -> tuple[int, int]:
    """Width and height in which an image is drawn."""
    height, width = image.shape[:2]
    if width <= WIDTH:
        return width, height
    return WIDTH, max(round(height * WIDTH / width), 1)

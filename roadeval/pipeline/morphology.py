"""Phase 4, post-processing (section 3.4): morphology, the largest region, its holes (Eq. 17-23)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Final, Literal

import cv2
import numpy as np
from pydantic import ConfigDict, Field, field_validator
from pydantic.dataclasses import dataclass as validated

from roadeval.data import LabelClass, Layer, LayerKind, LayerSpec, Mask, mask_spec
from roadeval.kernels import KERNELS
from roadeval.pipeline.patch import ReferencePatch, patch_mask
from roadeval.pipeline.stage import Output, Stage, View

POST: Final = mask_spec("post", "Road (Eq. 17-23)")
BOUNDARY: Final = LayerSpec(
    "boundary",
    LayerKind.MASK,
    "Road boundary (Eq. 22)",
    (LabelClass(0, "none", (0, 0, 0, 0)), LabelClass(1, "boundary", (240, 228, 66, 255))),
)

Odd = Annotated[int, Field(ge=1, le=999)]


@validated(frozen=True, config=ConfigDict(extra="forbid"))
class MorphologySettings:
    """Settings of phase 4.

    Parameters
    ----------
    element
        Side of the structuring element B in pixels, odd; none: the odd number nearest to 1 %
        of the image's width, at least 3.
    shape
        ``square`` or ``ellipse``.
    operations
        ``open`` (Eq. 20) and ``close`` (Eq. 21) in the order they are applied. Section 4.4
        begins with dilation and erosion, a closing. On a noisy mask that joins the road to
        whatever lies beside it, for good: on two real drives it costs 4 and 10 points of ERR.
        So the opening comes first here, and the preset ``printed`` closes first.
    region
        What is kept: the ``largest`` component, the component with most pixels in the
        reference patch before the vehicle (``patch``; the largest where none has any), or
        ``all`` of them.
    fill
        Whether the holes of what is kept are filled (Eq. 23).
    boundary_element
        Side of the square that erodes the result for its boundary (Eq. 22); 3 gives a line one
        pixel wide.
    patch
        The reference patch.
    """

    element: Odd | None = None
    shape: Literal["square", "ellipse"] = "square"
    operations: tuple[Literal["open", "close"], ...] = ("open", "close")
    region: Literal["largest", "patch", "all"] = "largest"
    fill: bool = True
    boundary_element: Odd = 3
    patch: ReferencePatch = ReferencePatch()

    @field_validator("element", "boundary_element")
    @classmethod
    def _odd(cls, side: int | None) -> int | None:
        if side is not None and side % 2 == 0:
            raise ValueError("must be odd, so that the element has a centre")
        return side


def element_side(width: int) -> int:
    """Odd number nearest to 1 % of an image's width, at least 3."""
    return max(3, 2 * (width // 200) + 1)


def structuring_element(side: int, shape: str) -> Mask:
    """B of Eq. 17-22, ``(side, side)`` uint8."""
    kind = cv2.MORPH_RECT if shape == "square" else cv2.MORPH_ELLIPSE
    element: Mask = cv2.getStructuringElement(kind, (side, side))
    return element


# Outside the image is non-road, for erosion too: OpenCV's own default lets erosion ignore it.


def dilate(mask: Mask, element: Mask) -> Mask:
    """Dilation (Eq. 17)."""
    grown: Mask = cv2.dilate(mask, element, borderType=cv2.BORDER_CONSTANT, borderValue=0)
    return grown


def erode(mask: Mask, element: Mask) -> Mask:
    """Erosion (Eq. 18)."""
    eroded: Mask = cv2.erode(mask, element, borderType=cv2.BORDER_CONSTANT, borderValue=0)
    return eroded


def opening(mask: Mask, element: Mask) -> Mask:
    """Open a mask: erosion, then dilation (Eq. 20; the text announces it as 19)."""
    return dilate(erode(mask, element), element)


def closing(mask: Mask, element: Mask) -> Mask:
    """Close a mask: dilation, then erosion (Eq. 21; the text announces it as 20).

    The dilation may leave the image: cut off there, the erosion would eat road along the edge.
    """
    margin = element.shape[0] // 2
    wide = cv2.copyMakeBorder(mask, margin, margin, margin, margin, cv2.BORDER_CONSTANT, value=0)
    closed = erode(dilate(wide, element), element)
    return closed[margin : closed.shape[0] - margin, margin : closed.shape[1] - margin]


def boundary(mask: Mask, element: Mask) -> Mask:
    """Boundary ``M - (M erode B)`` (Eq. 22)."""
    return mask - erode(mask, element)


def keep_region(mask: Mask, patch: Mask | None = None) -> Mask:
    """Keep one 8-connected component of a mask ("largest and connected areas", section 3.4).

    The largest, or, given a ``patch``, the one with most pixels in it where any has some. Of
    equals the first from the top. An empty mask stays empty.
    """
    if patch is not None and patch.shape != mask.shape:
        raise ValueError(f"a patch of {patch.shape} does not fit a mask of {mask.shape}")
    kept: Mask = KERNELS.keep_region(mask, np.zeros((0, 0), np.uint8) if patch is None else patch)
    return kept


def fill_holes(mask: Mask) -> Mask:
    """Fill what the mask encloses: Eq. 23's fixed point from a seed J in every hole.

    A hole is a 4-connected set of non-road that does not reach the outside of the image; B is
    the cross, which cannot slip between diagonal neighbours of an 8-connected boundary.
    """
    filled: Mask = KERNELS.fill_holes(mask)
    return filled


def post_process(mask: Mask, settings: MorphologySettings) -> Mask:
    """Section 4.4 on an ``(H, W)`` road mask: open, close, keep one region, fill its holes."""
    height, width = mask.shape
    element = structuring_element(settings.element or element_side(width), settings.shape)
    for operation in settings.operations:
        mask = opening(mask, element) if operation == "open" else closing(mask, element)
    if settings.region != "all":
        patch = patch_mask(height, width, settings.patch) if settings.region == "patch" else None
        mask = keep_region(mask, patch)
    return fill_holes(mask) if settings.fill else mask


def bind(settings: MorphologySettings, _parameters: None) -> Callable[[View], Output]:
    """Return phase 4 as a pure function of the mask before it."""
    edge = structuring_element(settings.boundary_element, "square")

    def run(view: View) -> Output:
        if view.mask is None:
            raise ValueError("post-processing needs a stage with a road mask before it")
        mask = post_process(view.mask, settings)
        layers = (Layer(POST, mask), Layer(BOUNDARY, boundary(mask, edge)))
        return Output(layers, mask=mask)

    return run


def layers(_settings: MorphologySettings) -> tuple[LayerSpec, ...]:
    """Name the layers of phase 4."""
    return POST, BOUNDARY


STAGE: Final[Stage[MorphologySettings, None]] = Stage(
    name="post",
    title="Phase 4: morphology",
    settings=MorphologySettings,
    bind=bind,
    layers=layers,
    sees_mask_alone=True,
)

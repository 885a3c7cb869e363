"""A picture within a figure: a camera's image, or something drawn over it."""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING, Any

import cv2
import numpy.typing as npt
from matplotlib.image import FigureImage
from matplotlib.transforms import Affine2D, Bbox, TransformedBbox

from roadeval.data import Rgb
from roadeval.report.images import finest_jpeg

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Picture(FigureImage):
    """An ``(H, W, 3)`` uint8 RGB image that fills a box, given in shares of its figure.

    Matplotlib's own way takes some ten times as long: it brings a picture to size by filters that
    show no difference here, and packs it into an SVG as PNG. Typst takes a JPEG into a PDF as it
    is, and would unpack a PNG and pack it again. Axes, which no picture needs, take as long again.
    """

    def __init__(self, figure: Figure, image: Rgb, box: Bbox) -> None:
        super().__init__(figure)
        self._image = image
        self.box = TransformedBbox(box, figure.transFigure)
        self.set_data(image)
        figure.add_artist(self)

    def can_composite(self) -> bool:
        """Return False: it stays a picture of its own, and is not made one with those beside it."""
        return False

    def draw(self, renderer: Any) -> None:
        """Draw it: into an SVG as JPEG, otherwise pixel by pixel."""
        writer = getattr(renderer, "writer", None)  # an SVG's own
        if writer is None:
            super().draw(renderer)
            return
        content = base64.b64encode(finest_jpeg(self._image)).decode()
        writer.element(
            "image",
            x=f"{self.box.x0:.6g}",
            y=f"{renderer.height - self.box.y1:.6g}",
            width=f"{self.box.width:.6g}",
            height=f"{self.box.height:.6g}",
            preserveAspectRatio="none",
            attrib={"xlink:href": f"data:image/jpeg;base64,{content}"},
        )

    def make_image(
        self, _renderer: Any, magnification: float = 1.0, *_unsampled: bool
    ) -> tuple[npt.NDArray[Any], float, float, Affine2D]:
        """Return it as RGBA in the size of its box, from the bottom up, and where it stands."""
        edges = [round(edge * magnification) for edge in self.box.extents]
        size = edges[2] - edges[0], edges[3] - edges[1]
        how = cv2.INTER_AREA if size[0] < self._image.shape[1] else cv2.INTER_CUBIC
        sized = cv2.cvtColor(cv2.resize(self._image, size, interpolation=how), cv2.COLOR_RGB2RGBA)
        left, bottom = (edge / magnification for edge in edges[:2])
        return sized[::-1], left, bottom, Affine2D()

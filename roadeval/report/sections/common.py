"""Parts that several sections share."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from roadeval.data import TRUTH, mask_spec
from roadeval.report.blocks import ImageFile
from roadeval.report.images import ExampleFrame, LayerImage, faded, jpeg, variants_of

ROAD: Final = mask_spec("road", "road")


def example_pictures(examples: Sequence[ExampleFrame]) -> Iterator[tuple[str, ImageFile]]:
    """Yield for each example the image, each variant's mask over it, and the truth over it."""
    names = variants_of(examples)
    for example in examples:
        yield f"frame {example.frame}", jpeg(LayerImage("", example.image))
        for name in names:
            mask = example.masks.get(name)
            if mask is None:
                yield f"{name}: no mask", jpeg(LayerImage("", faded(example.image)))
            else:
                yield name, jpeg(LayerImage("", example.image, ROAD, mask))
        if example.truth is not None:
            yield "truth", jpeg(LayerImage("", example.image, TRUTH, example.truth))

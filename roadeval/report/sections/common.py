"""Parts that several sections share."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from roadeval.data import TRUTH, mask_spec
from roadeval.data.words import percent
from roadeval.evaluation.metrics import SHORT
from roadeval.report.blocks import Cell, ImageFile
from roadeval.report.chart import looks
from roadeval.report.images import ExampleFrame, LayerImage, faded, jpeg, variants_of

ROAD: Final = mask_spec("road", "road")


def variant_cell(name: str, names: Sequence[str]) -> Cell:
    """Return a variant's name with the dot of its colour among ``names``."""
    return Cell(name, dot=looks(names)[name].colour)


def rate_cells(rates: Mapping[str, float], *, bold: bool) -> list[Cell]:
    """Return a mask's cells in a short table of rates; its ERR may be bold."""
    return [Cell(percent(rates.get(name)), bold=bold and name == "ERR") for name in SHORT]


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

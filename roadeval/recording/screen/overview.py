"""The viewer's first tab: everything that matters, on a screen of 1920x1080.

From top to bottom: what the camera saw and what went wrong; a row a variant with its phases from
left to right, equal phases below each other; the rates over time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import rerun.blueprint as rrb

from roadeval.data import BASELINE, FINAL_STAGE, LayerSpec, VariantLayout
from roadeval.evaluation.metrics import SHORT
from roadeval.recording import layout as at
from roadeval.recording.layout import Layout
from roadeval.recording.screen import views
from roadeval.recording.screen.views import BlueprintPart

# All sizes are points; the viewer takes them as shares of the room that it has.
_WIDTH: Final = 1920
_HEIGHT: Final = 990
_TITLE: Final = 26
_HEADER: Final = 120
_LEAST_WORDS: Final = 400
_LEAST_CURVES: Final = 250
_LEAST_PICTURE: Final = 200

_ROWS: Final = 2
"""Most variants that have a row: more would leave every picture too small to read."""
_OUTCOMES: Final = 3
"""Most variants whose errors stand on top."""

Cell = tuple[LayerSpec, ...]
"""Layers that share a picture."""


def overview(layout: Layout) -> BlueprintPart:
    """Return the first tab."""
    rows = {variant.name: _cells(variant) for variant in layout.variants[:_ROWS]}
    columns = max(len(cells) for cells in rows.values())
    shortest = min(rows, key=lambda name: len(rows[name]))
    free = columns - len(rows[shortest])
    aside = {shortest: views.events(wide=free > 2)} if free > 1 else {}

    ratio = layout.height / layout.width
    row = min((_WIDTH - _HEADER) / columns * ratio, _HEIGHT / 3) + _TITLE
    pictures = _pictures(layout)
    height = _HEIGHT - row * len(rows) - _LEAST_CURVES - _TITLE
    width = max(min(height / ratio, (_WIDTH - _LEAST_WORDS) / len(pictures)), _LEAST_PICTURE)
    top = width * ratio + _TITLE
    return rrb.Vertical(
        _top(pictures, width),
        *(_row(name, cells, columns, aside.get(name)) for name, cells in rows.items()),
        _bottom(layout, None if aside else views.events(wide=False)),
        row_shares=[top, *[row] * len(rows), max(_HEIGHT - top - row * len(rows), _LEAST_CURVES)],
        name="Overview",
    )


def _pictures(layout: Layout) -> list[BlueprintPart]:
    """Return views of the camera, the truth, and what each variant made of it."""
    return [
        views.camera(),
        *([views.truth()] if layout.has_truth else []),
        *(views.outcome(layout, variant) for variant in layout.variants[:_OUTCOMES]),
    ]


def _top(pictures: Sequence[BlueprintPart], width: float) -> BlueprintPart:
    words = views.document(at.GUIDE, "What you see")
    shares = [*[width] * len(pictures), _WIDTH - width * len(pictures)]
    return rrb.Horizontal(*pictures, words, column_shares=shares)


def _cells(variant: VariantLayout) -> list[Cell]:
    """Return the layers, grouped into pictures.

    An overlay joins the overlay before it, as rings join their shadow, unless it is a stage's
    mask: each of those begins a picture of its own.
    """
    cells: list[Cell] = []
    for spec in variant.layers:
        joins = views.is_overlay(spec) and spec.name not in variant.stages
        if joins and cells and views.is_overlay(cells[-1][0]):
            cells[-1] = (*cells[-1], spec)
        else:
            cells.append((spec,))
    return cells


def _row(
    variant: str, cells: Sequence[Cell], columns: int, aside: BlueprintPart | None
) -> BlueprintPart:
    """Return a variant's row, filled from the right: equal phases stand below each other."""
    width = (_WIDTH - _HEADER) / columns
    space = (columns - len(cells)) * width
    # Titles must be short here: the layers' names.
    titles = (" + ".join(spec.name for spec in cell) for cell in cells)
    pictures = [views.layers(t, variant, c) for t, c in zip(titles, cells, strict=True)]
    header = views.document(at.guide_path(variant))
    start, shares = ([header, aside], [_HEADER, space]) if aside else ([header], [_HEADER + space])
    return rrb.Horizontal(*start, *pictures, column_shares=[*shares, *[width] * len(cells)])


def _bottom(layout: Layout, aside: BlueprintPart | None) -> BlueprintPart:
    plots = (
        [_rate(layout, rate) for rate in SHORT if rate in layout.rates]
        if layout.has_truth
        else [views.stage_times(variant) for variant in layout.variants[:_ROWS]]
    )
    return rrb.Horizontal(*plots, *([aside] if aside else []))


def _rate(layout: Layout, rate: str) -> BlueprintPart:
    """Return a graph that compares a rate of the final masks."""
    finals = [(variant.name, variant.stages[-1]) for variant in layout.variants]
    finals += [(BASELINE, FINAL_STAGE)] * layout.baseline
    paths = [at.scalar_path("metrics", *final, rate) for final in finals]
    return views.plot(f"{rate}: {SHORT[rate].in_words}", paths)

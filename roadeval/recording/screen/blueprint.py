"""The viewer's blueprint: which views there are, and how they are arranged.

The first tab is an overview that fits a screen of 1920x1080. From top to bottom: what the camera
saw and what went wrong; a row a variant with its phases from left to right, equal phases below each
other; the rates over time. Further tabs hold every layer and every number.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import rerun.blueprint as rrb

from roadeval.data import BASELINE, ERRORS, FINAL_STAGE, LayerKind, LayerSpec, VariantLayout
from roadeval.evaluation.metrics import SHORT
from roadeval.recording import layout as at
from roadeval.recording.layout import Layout

BlueprintPart = Any
"""A view or a container of views."""
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


def arrange(layout: Layout) -> rrb.Blueprint:
    """Return the arrangement of a recording's views."""
    tabs = [overview(layout), *(_every_layer(layout, v) for v in layout.variants)]
    if layout.has_truth:
        tabs += [_rates(layout), _counts(layout)]
    tabs.append(rrb.Vertical(*map(stage_times, layout.variants), name="Timing"))
    results = (
        (at.OVERVIEW, "Results"),
        ("windows", "Windows (CSV)"),
        (at.SUMMARY, "Summary (JSON)"),
    )
    texts = (document(at.result_path(name), title) for name, title in results)
    tabs.append(rrb.Horizontal(*texts, name="Results"))
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        # Opens at the last frame: the first ones may be training frames, whose error maps are
        # empty, and a blueprint cannot name a frame to open at.
        rrb.TimePanel(
            state="collapsed", timeline=at.FRAME, play_state="following", fps=layout.rate_hz
        ),
        auto_views=False,
        auto_layout=False,
    )


def _every_layer(layout: Layout, variant: VariantLayout) -> BlueprintPart:
    views = [camera(), *(layers(spec.title, variant.name, (spec,)) for spec in variant.layers)]
    if layout.has_shadow_truth:
        views.append(picture("Truth: shadow", at.CAMERA, at.TRUE_SHADOW))
    if layout.has_truth:
        views += [truth(), outcome(layout, variant)]
    return rrb.Grid(*views, grid_columns=4, name=f"{variant.name}: every layer")


def _rates(layout: Layout) -> BlueprintPart:
    """Return graphs, a row a stage and a column a rate."""
    plots = []
    for stage in dict.fromkeys(stage for _, stage in layout.scored()):
        variants = [variant for variant, other in layout.scored() if other == stage]
        for rate in filter(layout.rates.__contains__, SHORT):
            paths = [at.scalar_path("metrics", variant, stage, rate) for variant in variants]
            plots.append(plot(f"{rate} of {stage}", paths))
    return rrb.Grid(*plots, grid_columns=len(SHORT), name="Rates by stage")


def _counts(layout: Layout) -> BlueprintPart:
    """Return graphs, a row a variant and a column a stage."""
    plots = [
        plot(f"{variant}: pixels of {stage}", [at.scalar_path("counts", variant, stage)])
        for variant, stage in layout.scored()
    ]
    columns = max(len(variant.stages) for variant in layout.variants)
    return rrb.Grid(*plots, grid_columns=columns, name="Counts")


def overview(layout: Layout) -> BlueprintPart:
    """Return the first tab."""
    rows = {variant.name: _cells(variant) for variant in layout.variants[:_ROWS]}
    columns = max(map(len, rows.values()))
    shortest = min(rows, key=lambda name: len(rows[name]))
    free = columns - len(rows[shortest])
    aside = {shortest: events(wide=free > 2)} if free > 1 else {}

    pictures = [camera(), *([truth()] if layout.has_truth else [])]
    pictures += [outcome(layout, variant) for variant in layout.variants[:_OUTCOMES]]
    ratio = layout.height / layout.width
    row = min((_WIDTH - _HEADER) / columns * ratio, _HEIGHT / 3) + _TITLE
    height = _HEIGHT - row * len(rows) - _LEAST_CURVES - _TITLE
    width = max(min(height / ratio, (_WIDTH - _LEAST_WORDS) / len(pictures)), _LEAST_PICTURE)
    top = width * ratio + _TITLE
    guide = document(at.GUIDE, "What you see")
    shares = [*[width] * len(pictures), _WIDTH - width * len(pictures)]
    return rrb.Vertical(
        rrb.Horizontal(*pictures, guide, column_shares=shares),
        *(_row(name, cells, columns, aside.get(name)) for name, cells in rows.items()),
        rrb.Horizontal(*_curves(layout), *([] if aside else [events(wide=False)])),
        row_shares=[top, *[row] * len(rows), max(_HEIGHT - top - row * len(rows), _LEAST_CURVES)],
        name="Overview",
    )


def _cells(variant: VariantLayout) -> list[Cell]:
    """Return the layers, grouped into pictures.

    An overlay joins the overlay before it, as rings join their shadow, unless it is a stage's
    mask: each of those begins a picture of its own.
    """
    cells: list[Cell] = []
    for spec in variant.layers:
        joins = is_overlay(spec) and spec.name not in variant.stages
        if joins and cells and is_overlay(cells[-1][0]):
            cells[-1] = (*cells[-1], spec)
        else:
            cells.append((spec,))
    return cells


def _row(
    variant: str, cells: Sequence[Cell], columns: int, aside: BlueprintPart | None
) -> BlueprintPart:
    """Return a variant's row, filled from the right, so that equal phases are aligned."""
    width = (_WIDTH - _HEADER) / columns
    space = (columns - len(cells)) * width
    # Titles must be short here: the layers' names.
    pictures = [layers(" + ".join(spec.name for spec in cell), variant, cell) for cell in cells]
    header = document(at.guide_path(variant))
    start, shares = ([header, aside], [_HEADER, space]) if aside else ([header], [_HEADER + space])
    return rrb.Horizontal(*start, *pictures, column_shares=[*shares, *[width] * len(cells)])


def _curves(layout: Layout) -> list[BlueprintPart]:
    """Return graphs that compare the rates of the final masks, or without truth the times."""
    if not layout.has_truth:
        return [stage_times(variant) for variant in layout.variants[:_ROWS]]
    finals = [(variant.name, variant.stages[-1]) for variant in layout.variants]
    finals += [(BASELINE, FINAL_STAGE)] * layout.baseline
    return [
        plot(
            f"{rate}: {SHORT[rate].in_words}",
            [at.scalar_path("metrics", *final, rate) for final in finals],
        )
        for rate in SHORT
        if rate in layout.rates
    ]


# --- Single views ---------------------------------------------------------------------------------


def picture(title: str, *paths: str) -> BlueprintPart:
    """Return a view of images drawn over each other."""
    return rrb.Spatial2DView(origin="/", contents=list(paths), name=title)


def camera() -> BlueprintPart:
    """Return a view of the image as logged."""
    return picture("Camera", at.CAMERA)


def truth() -> BlueprintPart:
    """Return a view of the truth: which pixels are road."""
    return picture("Truth: road", at.CAMERA, at.TRUTH_PATH)


def outcome(layout: Layout, variant: VariantLayout) -> BlueprintPart:
    """Return a view of the variant's errors, or without truth of what it calls road."""
    what, name = ("errors", ERRORS.name) if layout.has_truth else ("road", variant.stages[-1])
    return picture(f"{variant.name}: {what}", at.CAMERA, at.layer_path(variant.name, name))


def is_overlay(spec: LayerSpec) -> bool:
    """Return whether a layer is drawn over the camera's image; others stand alone."""
    return spec.kind in (LayerKind.MASK, LayerKind.LABELS)


def layers(title: str, variant: str, specs: Sequence[LayerSpec]) -> BlueprintPart:
    """Return one view of layers of a variant."""
    below = [at.CAMERA] if is_overlay(specs[0]) else []
    return picture(title, *below, *(at.layer_path(variant, spec.name) for spec in specs))


def plot(title: str, paths: Sequence[str]) -> BlueprintPart:
    """Return a graph of numbers over time."""
    return rrb.TimeSeriesView(
        origin="/",
        contents=list(paths),
        name=title,
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.LeftTop),
    )


def stage_times(variant: VariantLayout) -> BlueprintPart:
    """Return a graph of how long each stage of a variant took."""
    return plot(f"{variant.name}: milliseconds a stage", [f"/timing/{variant.name}/**"])


def document(path: str, title: str | None = None) -> BlueprintPart:
    """Return a view of a text; without a title it has no title bar either."""
    return rrb.TextDocumentView(
        origin=path, contents=[path], name=title, titlebar=title is not None
    )


def events(*, wide: bool) -> BlueprintPart:
    """Return views of how frames were used, of each variant's health, and of the notes."""
    state = rrb.StateTimelineView(origin="/state", name="How it went")
    notes = rrb.TextLogView(
        origin=at.NOTES,
        contents=[at.NOTES],
        name="Notes",
        columns=rrb.TextLogColumns(timeline_columns=[at.FRAME], text_log_columns=["body"]),
        format_options=rrb.TextLogFormat(monospace_body=False),
    )
    return (
        rrb.Horizontal(state, notes, column_shares=[1, 2]) if wide else rrb.Vertical(state, notes)
    )

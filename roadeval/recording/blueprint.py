"""What the viewer shows when a recording is opened: made for 1920x1080, nothing to touch.

The overview reads as the pipeline runs: the camera and what went wrong above, below it a row
a variant with its phases from left to right, and the rates over time at the bottom. Further
tabs hold every layer, every number, the notes and the results.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Final

import rerun.blueprint as rrb

from roadeval.data import BASELINE, ERRORS, FINAL_STAGE, LayerKind, LayerSpec, VariantLayout
from roadeval.recording import layout as at
from roadeval.recording.layout import Layout

View = Any
"""A view or a container of views."""

_WIDTH: Final = 1920
_HEIGHT: Final = 1000
"""Points that the viewer leaves for views on a screen of 1920x1080."""
_TITLE: Final = 26
"""Height of a view's title bar in points."""
_OVERVIEW_RATES: Final = ("ERR", "FPR", "FNR")


def arrange(layout: Layout) -> rrb.Blueprint:
    """Arrange the views of a recording."""
    tabs = [_overview(layout), *(_every_layer(layout, v) for v in layout.variants)]
    if layout.has_truth:
        tabs += [_rates(layout), _counts(layout)]
    tabs += [_timing(layout), _results(layout)]
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.TopPanel(state="expanded"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        _time_panel(layout),
        auto_views=False,
        auto_layout=False,
    )


def _overview(layout: Layout) -> View:
    ratio = layout.height / layout.width
    shown = layout.variants[:2]
    columns = max((len(_cells(v)) for v in shown), default=1)
    phase = _WIDTH / max(columns, 5) * ratio + _TITLE
    top = 400 * ratio + _TITLE
    bottom = max(_HEIGHT - top - phase * len(shown), 170)
    return rrb.Vertical(
        _top(layout),
        *(_phases(layout, v, columns) for v in shown),
        _bottom(layout),
        row_shares=[top, *[phase] * len(shown), bottom],
        name="Overview",
    )


def _top(layout: Layout) -> View:
    maps = [_errors(layout, v) for v in layout.variants[:2]]
    text = rrb.TextDocumentView(origin=at.GUIDE, contents=[at.GUIDE], name="What you see")
    return rrb.Horizontal(
        _camera(layout), *maps, text, column_shares=[*[1.0] * (1 + len(maps)), 1.5]
    )


def _camera(layout: Layout) -> View:
    return _picture([at.CAMERA], "Camera")


def _errors(layout: Layout, variant: VariantLayout) -> View:
    if layout.has_truth:
        return _picture([at.CAMERA, at.layer_path(variant.name, ERRORS.name)],
                        f"{variant.name}: errors")
    return _picture([at.CAMERA, at.layer_path(variant.name, variant.stages[-1])], f"{variant.name}")


def _cells(variant: VariantLayout) -> list[list[LayerSpec]]:
    cells = []
    for spec in variant.layers:
        overlay = spec.kind in (LayerKind.MASK, LayerKind.LABELS)
        if overlay and cells and spec.name not in variant.stages and cells[-1][-1].kind in (LayerKind.MASK, LayerKind.LABELS):
            cells[-1].append(spec)
        else:
            cells.append([spec])
    return cells


def _phases(layout: Layout, variant: VariantLayout, columns: int) -> View:
    views = [_cell(variant, c) for c in _cells(variant)]
    return rrb.Horizontal(*views)


def _cell(variant: VariantLayout, specs: list[LayerSpec]) -> View:
    contents = [at.layer_path(variant.name, s.name) for s in specs]
    if specs[0].kind in (LayerKind.MASK, LayerKind.LABELS):
        contents = [at.CAMERA, *contents]
    return _picture(contents, f"{variant.name}: {specs[0].title}")


def _picture(contents: Sequence[str], name: str) -> View:
    return rrb.Spatial2DView(origin="/", contents=list(contents), name=name)


def _bottom(layout: Layout) -> View:
    plots = [
        rrb.TimeSeriesView(
            origin="/",
            contents=[at.scalar_path("metrics", v, FINAL_STAGE, rate) for v in [*(v.name for v in layout.variants), BASELINE]],
            name=f"{rate} of {FINAL_STAGE}",
            axis_y=rrb.ScalarAxis(range=(0,1)),
        ) for rate in _OVERVIEW_RATES] if layout.has_truth else []
    return rrb.Horizontal(*plots, rrb.StateTimelineView(origin="/state", name="State"), rrb.TextLogView(origin=at.NOTES, name="Notes"))


def _every_layer(layout: Layout, variant: VariantLayout) -> View:
    views = [_cell(variant, [s]) for s in variant.layers]
    return rrb.Grid(*views, name=f"{variant.name}: every layer")


def _rates(layout: Layout) -> View:
    return rrb.Grid(*[rrb.TimeSeriesView(origin=f"/metrics/{v.name}/{s}", name=f"{v.name} {s}") for v in layout.variants for s in v.stages], name="Rates")


def _counts(layout: Layout) -> View:
    return rrb.Grid(*[rrb.TimeSeriesView(origin=f"/counts/{v.name}/{s}", name=f"{v.name} {s}") for v in layout.variants for s in v.stages], name="Counts")


def _timing(layout: Layout) -> View:
    return rrb.Vertical(*[rrb.TimeSeriesView(origin=f"/timing/{v.name}", name=f"{v.name}: milliseconds a stage") for v in layout.variants], name="Timing")


def _results(layout: Layout) -> View:
    return rrb.Horizontal(
        rrb.TextDocumentView(origin=at.result_path("overview"), name="Overview"),
        rrb.TextDocumentView(origin=at.result_path("windows"), name="Windows"),
        rrb.TextDocumentView(origin=at.result_path("summary"), name="Summary"), name="Results")


def _time_panel(layout: Layout) -> View:
    return rrb.TimePanel(state="collapsed", timeline=at.FRAME, play_state="paused")

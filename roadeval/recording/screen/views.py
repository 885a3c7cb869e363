"""Single views, of which the viewer's tabs are made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import rerun.blueprint as rrb

from roadeval.data import ERRORS, LayerKind, LayerSpec, VariantLayout
from roadeval.recording import layout as at
from roadeval.recording.layout import Layout

BlueprintPart = Any
"""A view or a container of views."""


def picture(title: str, paths: Sequence[str]) -> BlueprintPart:
    """Return a view of images drawn over each other."""
    return rrb.Spatial2DView(origin="/", contents=list(paths), name=title)


def camera() -> BlueprintPart:
    """Return a view of the image as logged."""
    return picture("Camera", [at.CAMERA])


def truth() -> BlueprintPart:
    """Return a view of the truth: which pixels are road."""
    return picture("Truth: road", [at.CAMERA, at.TRUTH_PATH])


def outcome(layout: Layout, variant: VariantLayout) -> BlueprintPart:
    """Return a view of the variant's errors, or without truth of what it calls road."""
    name = ERRORS.name if layout.has_truth else variant.stages[-1]
    title = f"{variant.name}: {'errors' if layout.has_truth else 'road'}"
    return picture(title, [at.CAMERA, at.layer_path(variant.name, name)])


def is_overlay(spec: LayerSpec) -> bool:
    """Return whether a layer is drawn over the camera's image; others stand alone."""
    return spec.kind in (LayerKind.MASK, LayerKind.LABELS)


def layers(title: str, variant: str, specs: Sequence[LayerSpec]) -> BlueprintPart:
    """Return one view of layers of a variant."""
    below = [at.CAMERA] if is_overlay(specs[0]) else []
    return picture(title, [*below, *(at.layer_path(variant, spec.name) for spec in specs)])


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
    if wide:
        return rrb.Horizontal(state, notes, column_shares=[1, 2])
    return rrb.Vertical(state, notes)

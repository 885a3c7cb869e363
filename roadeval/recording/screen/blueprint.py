"""The viewer's blueprint: the overview, and tabs with all the rest."""

from __future__ import annotations

import rerun.blueprint as rrb

from roadeval.data import VariantLayout
from roadeval.evaluation.metrics import SHORT
from roadeval.recording import layout as at
from roadeval.recording.layout import Layout
from roadeval.recording.screen import views
from roadeval.recording.screen.overview import overview
from roadeval.recording.screen.views import BlueprintPart


def arrange(layout: Layout) -> rrb.Blueprint:
    """Return the arrangement of a recording's views."""
    tabs = [overview(layout), *(_every_layer(layout, v) for v in layout.variants)]
    if layout.has_truth:
        tabs += [_rates(layout), _counts(layout)]
    tabs += [_timing(layout), _results()]
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        _time_panel(layout),
        auto_views=False,
        auto_layout=False,
    )


def _every_layer(layout: Layout, variant: VariantLayout) -> BlueprintPart:
    pictures = [
        views.camera(),
        *(views.layers(spec.title, variant.name, (spec,)) for spec in variant.layers),
    ]
    if layout.has_shadow_truth:
        pictures.append(views.picture("Truth: shadow", [at.CAMERA, at.TRUE_SHADOW]))
    if layout.has_truth:
        pictures += [views.truth(), views.outcome(layout, variant)]
    return rrb.Grid(*pictures, grid_columns=4, name=f"{variant.name}: every layer")


def _rates(layout: Layout) -> BlueprintPart:
    """Return graphs, a row a stage and a column a rate."""
    plots = [
        views.plot(
            f"{rate} of {stage}",
            [
                at.scalar_path("metrics", variant, other, rate)
                for variant, other in layout.scored()
                if other == stage
            ],
        )
        for stage in dict.fromkeys(stage for _, stage in layout.scored())
        for rate in SHORT
        if rate in layout.rates
    ]
    return rrb.Grid(*plots, grid_columns=len(SHORT), name="Rates by stage")


def _counts(layout: Layout) -> BlueprintPart:
    """Return graphs, a row a variant and a column a stage."""
    plots = [
        views.plot(f"{variant}: pixels of {stage}", [at.scalar_path("counts", variant, stage)])
        for variant, stage in layout.scored()
    ]
    columns = max(len(variant.stages) for variant in layout.variants)
    return rrb.Grid(*plots, grid_columns=columns, name="Counts")


def _timing(layout: Layout) -> BlueprintPart:
    return rrb.Vertical(*map(views.stage_times, layout.variants), name="Timing")


def _results() -> BlueprintPart:
    return rrb.Horizontal(
        views.document(at.result_path(at.OVERVIEW), "Results"),
        views.document(at.result_path("windows"), "Windows (CSV)"),
        views.document(at.result_path(at.SUMMARY), "Summary (JSON)"),
        name="Results",
    )


def _time_panel(layout: Layout) -> rrb.TimePanel:
    """Return a time panel that opens at the last frame and plays at the drive's own rate.

    The first frames may be training frames, whose error maps are empty, and a blueprint cannot
    name a frame to open at.
    """
    return rrb.TimePanel(
        state="collapsed",
        timeline=at.FRAME,
        play_state="following",
        fps=layout.rate_hz,
    )

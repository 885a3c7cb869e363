"""The arrangement of the viewer: its blueprint, colours, names and documents.

The first tab is an overview that fits a screen of 1920x1080. From top to bottom: the camera's image
and the errors; a row for each variant with its phases from left to right, equal phases below each
other; the rates over time, the states of the frames, and notes. Further tabs hold every layer and
every number.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import cycle, product
from typing import Any, Final

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from roadeval.data import (
    BASELINE,
    ERRORS,
    FILTERED,
    FINAL_STAGE,
    TRUTH,
    UNFILTERED,
    Calibration,
    Health,
    LayerKind,
    LayerSpec,
    Role,
    VariantLayout,
    colours,
)
from roadeval.data.colours import Colour
from roadeval.data.words import percent, short_names
from roadeval.evaluation.metrics import SHORT, TESTED
from roadeval.geometry.ground import Ground
from roadeval.recording import layout as at
from roadeval.recording.codecs import Codec
from roadeval.recording.layout import Layout
from roadeval.runtime.text import as_markdown

BlueprintPart = Any
"""A view or a container of views."""
_TOP, _ROW, _BOTTOM = 64, 44, 50
"""Shares of the overview's height: its first row, a variant's row, and the curves."""
_PICTURE, _HEADER = 100, 50
"""Shares of a row's width: each picture, and at least its header."""
_ROWS: Final = 2
"""Greatest number of variants that have a row: with more every picture would be too small."""
_ABREAST: Final = 3
"""Cameras side by side."""
_OUTCOMES: Final = 4
"""Greatest number of variants with a picture of errors at the top."""

Cell = tuple[LayerSpec, ...]
"""Layers that share a picture."""


def arrange(layouts: Mapping[str, Layout]) -> rrb.Blueprint:
    """Return the arrangement of a recording's views.

    ``layouts`` are the cameras' layouts by the prefix of their entities' paths; the prefix is empty
    for a drive with one camera. The first tab of a rig shows every camera with its first variant's
    errors, and curves.
    """
    if "" in layouts:
        tabs = _tabs(layouts[""])
    else:
        names, pictures, paths, tabs = short_names([*layouts]), [], [], []
        for prefix, layout in layouts.items():
            view = outcome(layout, layout.shown[0])
            view.name = f"{names[prefix]}: {view.name}"
            _add_prefix(prefix, [view])
            pictures.append(view)
            variants = layout.shown[:_ROWS] if layout.has_truth else ()
            paths += [f"{prefix}{at.PERCENT}/{v.name}/{v.stages[-1]}/{TESTED}" for v in variants]
            parts = _tabs(layout)
            _add_prefix(prefix, parts, layout.clouds)
            tabs.append(rrb.Tabs(*parts, active_tab=0, name=names[prefix]))
        curves = [plot(f"{TESTED} by camera, %", paths)] if paths else []
        below = rrb.Horizontal(*curves, document(at.GUIDE, "What you see"))
        grid = rrb.Grid(*pictures, grid_columns=min(len(pictures), _ABREAST))
        tabs.insert(0, rrb.Vertical(grid, below, row_shares=[3, 1], name="All cameras"))
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        # It opens at the last frame: the first ones may be training frames with empty error maps,
        # and a blueprint cannot name a frame.
        rrb.TimePanel(
            state="collapsed",
            timeline=at.FRAME if "" in layouts else at.STAMP,
            play_state="following",
            fps=next(iter(layouts.values())).rate_hz,
        ),
        auto_views=False,
        auto_layout=False,
    )


def _add_prefix(prefix: str, parts: Sequence[BlueprintPart], beside: Sequence[str] = ()) -> None:
    """Add a camera's prefix to all paths of views and containers.

    The paths ``beside`` the cameras' stay as they are.
    """
    for part in parts:
        if not isinstance(part, rrb.View):
            _add_prefix(prefix, part.contents, beside)
            continue
        part.origin = prefix + (part.origin if part.origin != "/" else "")
        part.contents = [path if path in beside else prefix + path for path in part.contents]
        part.visualizer_overrides = {
            prefix + str(path): visualizer for path, visualizer in part.visualizer_overrides.items()
        }


def _tabs(layout: Layout) -> list[BlueprintPart]:
    """Return the views of a camera, a tab each."""
    tabs = [overview(layout)]
    if layout.ground:
        tabs.append(_on_the_ground(layout, layout.ground))
    for variant in layout.variants:
        views = [camera(), *(layers(spec.title, variant.name, (spec,)) for spec in variant.layers)]
        if layout.has_shadow_truth:
            views.append(picture("Truth: shadow", at.CAMERA, at.TRUE_SHADOW))
        if layout.has_truth:
            views += [truth(), outcome(layout, variant)]
        tabs.append(rrb.Grid(*views, grid_columns=4, name=f"{variant.name}: every layer"))
    of_variants = []
    for variant in layout.shown if layout.disturbed else ():
        below_of = {
            n: f"{at.DISTURBED}/{n}" for n, v in layout.disturbed.items() if variant.name in v
        }
        views = [
            picture(f"{name}: errors", below + at.CAMERA, f"{below}/{variant.name}/{ERRORS.name}")
            for name, below in below_of.items()
        ]
        grid = rrb.Grid(outcome(layout, variant), *views, name=variant.name)
        of_variants += [grid] if views else []
    if of_variants:
        tabs.append(rrb.Tabs(*of_variants, active_tab=0, name="Disturbed"))
    if layout.has_truth:
        masks = [*layout.scored()]
        rates = [rate for rate in SHORT if rate in layout.rates]
        plots = []
        for stage, rate in product(dict.fromkeys(stage for _, stage in masks), rates):
            paths = [f"{at.PERCENT}/{v}/{stage}/{rate}" for v, other in masks if other == stage]
            plots.append(plot(f"{rate} of {stage}, %", paths))
        tabs.append(rrb.Grid(*plots, grid_columns=len(SHORT), name="Rates by stage"))
        plots = [plot(f"{v}: pixels of {s}", [f"/counts/{v}/{s}"]) for v, s in masks]
        columns = max(len(variant.stages) for variant in layout.variants)
        tabs.append(rrb.Grid(*plots, grid_columns=columns, name="Counts"))
    tabs.append(rrb.Vertical(*map(stage_times, layout.variants), name="Timing"))
    results = ("windows", "Windows (CSV)"), (at.SUMMARY, "Summary (JSON)")
    texts = (document(f"/results/{name}", title) for name, title in results)
    tabs.append(rrb.Horizontal(*texts, name="Results"))
    return tabs


def _on_the_ground(layout: Layout, ground: Ground) -> BlueprintPart:
    """Return the ground in space, below the camera, and from above with each variant's errors."""
    names = [v.name for v in layout.shown[:_OUTCOMES]] if layout.has_truth else []
    shown = {"Truth: road": TRUTH.name} if layout.has_truth else {}
    shown |= {f"{name}: errors": name for name in names}
    flat = [picture(title, at.GROUND, f"/ground/{name}") for title, name in shown.items()]
    flat = [picture("From above", at.GROUND), *flat]
    if not ground.is_posed or not layout.calibration:
        return rrb.Grid(*flat, grid_columns=len(flat), name="On the ground")
    near, far, _ = layout.extent
    paths = [at.GROUND, *(f"/ground/{name}" for name in names[:1]), at.CAMERA, *layout.clouds]
    space = rrb.Spatial3DView(
        origin="/",
        contents=paths,
        name=f"In space: {names[0]}" if names else "In space",
        spatial_information=rrb.SpatialInformation(target_frame=_frame_of(layout.calibration)),
        eye_controls=rrb.EyeControls3D(
            position=(0, -far / 5, -near * 2),
            look_target=(0, 2, (near + far) / 2.5),
            eye_up=(0, -1, 0),
        ),
        # The camera's picture lies on the ground; the frustum of the ground's camera is not shown.
        overrides={
            at.CAMERA: rr.Pinhole.from_fields().visualizer(),
            at.GROUND: rr.EncodedImage.from_fields().visualizer(),
        },
    )
    grid = rrb.Grid(*flat, grid_columns=len(flat))
    return rrb.Horizontal(space, grid, column_shares=[2, 3], name="On the ground")


def overview(layout: Layout) -> BlueprintPart:
    """Return the first tab."""
    rows: dict[str, list[Cell]] = {}
    for variant in layout.shown[:_ROWS]:
        cells = rows[variant.name] = []
        for spec in variant.layers:
            # An overlay joins the one before it, unless it is the mask of a stage.
            joins = is_overlay(spec) and spec.name not in variant.stages
            if joins and cells and is_overlay(cells[-1][0]):
                cells[-1] = (*cells[-1], spec)
            else:
                cells.append((spec,))
    columns = max(map(len, rows.values()))
    shortest = min(rows, key=lambda name: len(rows[name]))
    aside = {shortest: _events()} if len(rows[shortest]) + 1 < columns else {}
    pictures = [camera(), *([truth()] if layout.has_truth else [])]
    pictures += [outcome(layout, variant) for variant in layout.shown[:_OUTCOMES]]
    # Graphs of the final masks' rates, or without truth of the stages' times.
    graphs = [] if layout.has_truth else [stage_times(v) for v in layout.shown[:_ROWS]]
    finals = [f"{variant.name}/{variant.stages[-1]}" for variant in layout.variants]
    finals += [f"{BASELINE}/{FINAL_STAGE}"] * layout.baseline
    for rate in (rate for rate in SHORT if layout.has_truth and rate in layout.rates):
        paths = [f"{at.PERCENT}/{final}/{rate}" for final in finals]
        graphs.append(plot(f"{rate}, %: {SHORT[rate].in_words}", paths))
    graphs += [] if aside else [_events()]
    parts = [rrb.Horizontal(*pictures, document(at.GUIDE, "What you see"))]
    # Rows are filled from the right, so that equal phases are aligned. Their titles must be short:
    # they are the layers' names.
    for name, cells in rows.items():
        views = [layers(" + ".join(spec.name for spec in cell), name, cell) for cell in cells]
        space, header = _PICTURE * (columns - len(cells)), document(f"{at.GUIDE}/{name}")
        if layout.has_truth:
            header = rrb.Vertical(header, document(f"{at.FRAME_RATES}/{name}"), row_shares=[8, 5])
        start, shares = [header], [_HEADER + space]
        if name in aside:
            start, shares = [aside[name], header], [space, _HEADER]
        shares += [_PICTURE] * len(cells)
        parts.append(rrb.Horizontal(*start, *views, column_shares=shares))
    return rrb.Vertical(
        *parts,
        rrb.Horizontal(*graphs),
        row_shares=[_TOP, *[_ROW] * len(rows), _BOTTOM],
        name="Overview",
    )


def picture(title: str, *paths: str) -> BlueprintPart:
    """Return a view of images that lie over each other."""
    return rrb.Spatial2DView(origin="/", contents=list(paths), name=title)


def camera() -> BlueprintPart:
    """Return a view of the image as logged."""
    return picture("Camera", at.CAMERA)


def truth() -> BlueprintPart:
    """Return a view of the road's truth."""
    return picture("Truth: road", at.CAMERA, at.TRUTH_PATH)


def outcome(layout: Layout, variant: VariantLayout) -> BlueprintPart:
    """Return a view of the variant's errors, or without truth of its road mask."""
    what, name = ("errors", ERRORS.name) if layout.has_truth else ("road", variant.stages[-1])
    return picture(f"{variant.name}: {what}", at.CAMERA, f"/{variant.name}/{name}")


def is_overlay(spec: LayerSpec) -> bool:
    """Return whether a layer is drawn over the camera's image; others are shown alone."""
    return spec.kind in (LayerKind.MASK, LayerKind.LABELS)


def layers(title: str, variant: str, specs: Sequence[LayerSpec]) -> BlueprintPart:
    """Return one view of several layers of a variant."""
    below = [at.CAMERA] if is_overlay(specs[0]) else []
    return picture(title, *below, *(f"/{variant}/{spec.name}" for spec in specs))


def plot(title: str, paths: Sequence[str]) -> BlueprintPart:
    """Return a graph of numbers over time."""
    return rrb.TimeSeriesView(
        origin="/",
        contents=list(paths),
        name=title,
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.LeftTop),
    )


def stage_times(variant: VariantLayout) -> BlueprintPart:
    """Return a graph of the milliseconds that a variant's stages took."""
    return plot(f"{variant.name}: milliseconds a stage", [f"/timing/{variant.name}/**"])


def document(path: str, title: str | None = None) -> BlueprintPart:
    """Return a view of a text, with a title bar if it has a title."""
    return rrb.TextDocumentView(
        origin=path, contents=[path], name=title, titlebar=title is not None
    )


def _events() -> BlueprintPart:
    """Return, side by side, the frames' roles with each variant's health, and the notes."""
    notes = rrb.TextLogView(
        origin=at.NOTES,
        contents=[at.NOTES],
        name="Notes",
        columns=rrb.TextLogColumns(timeline_columns=[at.FRAME], text_log_columns=["body"]),
        format_options=rrb.TextLogFormat(monospace_body=False),
    )
    states = rrb.StateTimelineView(origin="/state", name="How each frame went")
    return rrb.Horizontal(states, notes, column_shares=[2, 3])


StaticData = Iterator[tuple[str, list[Any]]]
"""Entity paths with the archetypes to log there."""

_VARIANTS: Final[Mapping[str, Colour]] = {
    FILTERED: colours.FILTERED,
    UNFILTERED: colours.UNFILTERED,
    BASELINE: colours.BLIND,
}
_MARKDOWN: Final = rr.MediaType.MARKDOWN
_STAGES: Final = (colours.ORANGE, *colours.EXTRA)
_STATES: Final[Mapping[str, Colour]] = {
    Health.OK: colours.GREEN,
    Health.DEGRADED: colours.ORANGE,
    Health.FAILED: colours.VERMILLION,
    Role.EVALUATED: colours.SKY_BLUE,
    Role.TRAINING: colours.PURPLE,
    Role.COPY: colours.DARK_GREY,
    Role.GAP: colours.DARK_GREY,
    Role.UNLABELLED: colours.GREY,
    Role.PICKED: colours.ORANGE,
}
_OUTCOME_COLOURS: Final[Mapping[str, Colour]] = {
    "TP": colours.TP,
    "TN": colours.TN,
    "FP": colours.FP,
    "FN": colours.FN,
    "N": colours.GREY,
}
_ERRORS: Final = """\
**Errors:** *green* road found, *orange-red* non-road called road (FP), *pink* road missed (FN),
*grey* ignored.
"""
_ROW_GUIDE: Final = """\
**Rows:** the phases of {rows} from left to right; *green* is what a phase calls road.
Masks are recorded exactly, maps of numbers approximately.
{others}
"""
_CURVES: Final = """\
**Curves:** rates of the final masks; *blind*, the training frames' mean truth, never looks at the
image.
"""
_NO_TRUTH: Final = """\
The log has no truth for the road, so there are no errors and no rates.
"""
_HANDLING: Final = """\
**Space** plays. The tabs above hold every layer, every number and the results.
"""


def before_the_first_frame(
    layout: Layout, codecs: Mapping[str, Codec], camera: str = ""
) -> StaticData:
    """Yield the static data that a recording begins with; ``camera`` is its short name in a rig."""
    for path, codec in codecs.items():
        yield path, _style(codec)
    if calibration := layout.calibration:
        # Lens and place belong to named frames, as in recordings that Rerun makes of MCAP
        # files: a pinhole of the entity itself would remove its pictures from every flat view.
        frame, mounting = _frame_of(calibration), calibration.mounting
        lens: list[Any] = [
            rr.Pinhole(
                image_from_camera=np.array(calibration.matrix).reshape(3, 3),
                resolution=[calibration.width, calibration.height],
                child_frame=f"{frame}_image_plane",
                parent_frame=frame,
            )
        ]
        if mounting is not None:
            lens.append(
                rr.Transform3D(
                    translation=mounting.translation,
                    quaternion=mounting.rotation,
                    child_frame=frame,
                    parent_frame=mounting.parent,
                )
            )
        yield at.CAMERA, lens
    if layout.ground:
        yield from _plane(layout, layout.ground)
    yield at.LAYOUT, [rr.TextDocument(layout.to_json())]
    yield from _guides(layout, {})
    yield at.PROPERTIES, [rr.AnyValues(format=at.FORMAT, **layout.properties)]
    for name, header in layout.tables.items():
        yield f"/results/{name}", [rr.AnyValues(header=header.rstrip())]
    lanes: dict[str, tuple[str, ...]] = {at.ROLE: tuple(Role)}
    lanes |= {f"/state/{variant.name}": tuple(Health) for variant in layout.variants}
    for path, states in lanes.items():
        colours = [_STATES[state] for state in states]
        yield path, [rr.StateConfiguration(values=states, colors=colours)]
    yield from _lines(layout, f"{camera} " if camera else "")


def _style(codec: Codec) -> list[Any]:
    """Return how the viewer shows a kind of image: masks lie over the camera's image."""
    match codec.spec.kind:
        case LayerKind.MASK:
            return [rr.EncodedImage.from_fields(media_type="image/png", draw_order=10)]
        case LayerKind.LABELS:
            classes = [rr.AnnotationInfo(c.value, c.name, c.rgba) for c in codec.spec.classes]
            size, byte = (codec.width, codec.height), rr.ChannelDatatype.U8
            pixels = rr.components.ImageFormat(
                *size, color_model=rr.ColorModel.L, channel_datatype=byte
            )
            labels = rr.SegmentationImage.from_fields(format=pixels, opacity=1.0, draw_order=10)
            return [rr.AnnotationContext(classes), labels]
        case LayerKind.SCALAR:  # the viewer takes grey levels for fractions, in any unit
            return [
                rr.EncodedDepthImage.from_fields(
                    meter=1.0, depth_range=(0.0, 1.0), colormap=rr.components.Colormap.Viridis
                )
            ]
        case LayerKind.RGB:
            return [rr.EncodedImage.from_fields(draw_order=-10)]


def _frame_of(calibration: Calibration) -> str:
    """Return the name of a camera's coordinate frame."""
    return calibration.frame_id or at.CAMERA.strip("/")


_ABOVE: Final = 20.0
"""Height in metres of a camera that looks straight down: its picture lies on the ground."""
_DOWN: Final = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Rotation from this camera's right, down and forward to ahead, left and up."""


def _plane(layout: Layout, ground: Ground) -> StaticData:
    """Yield the place of the ground's pictures in space: a camera above the ground has them."""
    frame = _frame_of(layout.calibration) if layout.calibration else at.CAMERA.strip("/")
    if ground.is_posed and layout.calibration:
        near, far, width = layout.extent
        turn, at_camera = ground.axes()
        above = np.array([(near + far) / 2, 0.0, _ABOVE])
        across, along, focal = width / at.CELL, (far - near) / at.CELL, _ABOVE / at.CELL
        pinhole = rr.Pinhole(
            image_from_camera=[[focal, 0, across / 2], [0, focal, along / 2], [0, 0, 1]],
            resolution=[across, along],
            image_plane_distance=_ABOVE,
            child_frame=f"{frame}_ground_image",
            parent_frame=f"{frame}_above",
        )
        place = rr.Transform3D(
            translation=turn @ above + at_camera,
            mat3x3=turn @ _DOWN,
            child_frame=f"{frame}_above",
            parent_frame=frame,
        )
        yield at.GROUND, [pinhole, place]
    for path in (at.GROUND, *(path for path, _ in layout.from_above())):
        yield path, [rr.CoordinateFrame(f"{frame}_ground_image")]


def before_a_rig(prefixes: Mapping[str, str], first: Layout) -> StaticData:
    """Yield the static data that a recording of several cameras begins with.

    ``prefixes`` begin the paths of each camera's entities; ``first`` is one camera's layout.
    """
    topics = ("image_topic", "truth_topic")
    shared = {name: value for name, value in first.properties.items() if name not in topics}
    yield at.PROPERTIES, [rr.AnyValues(format=at.FORMAT, **shared, cameras=list(prefixes))]
    yield at.CAMERAS, [rr.TextDocument(json.dumps(prefixes))]
    yield _rig_guide(first.drive, prefixes)


def after_a_rig(texts: Mapping[str, str]) -> StaticData:
    """Yield the static data that a recording of several cameras ends with."""
    summary = json.loads(texts[at.SUMMARY])
    yield _rig_guide(summary["drive"]["name"], summary["cameras"], summary["verdict"])
    yield from _results(texts)


def _rig_guide(drive: str, cameras: Iterable[str], verdict: str = "") -> tuple[str, list[Any]]:
    names = f"**Cameras:** {as_markdown(', '.join(cameras))}"
    tabs = "**Tabs:** one for each camera."
    return _guide(drive, verdict, names, "", _ERRORS, tabs, "", _HANDLING)


def _lines(layout: Layout, camera: str) -> StaticData:
    """Yield the names and colours of graphs of rates and counts; ``camera`` begins the names."""
    extra = cycle(colours.EXTRA)
    names = [*(variant.name for variant in layout.variants), BASELINE]
    variants = {name: _VARIANTS.get(name) or next(extra) for name in names}
    counts = rr.SeriesLines(names=list(_OUTCOME_COLOURS), colors=list(_OUTCOME_COLOURS.values()))
    for variant, stage in layout.scored():
        for rate in layout.rates:
            line = _line(camera + variant, variants[variant])
            yield f"/metrics/{variant}/{stage}/{rate}", [line]
            if rate in SHORT:
                yield f"{at.PERCENT}/{variant}/{stage}/{rate}", [line]
        yield f"/counts/{variant}/{stage}", [counts]


def timing_lines(paths: Iterable[str]) -> StaticData:
    """Yield the colours of the graphs of stages' times, in the order in which stages run."""
    stages: dict[str, Colour] = {}
    for path in paths:
        if path.startswith("/timing/"):
            stage = path.rpartition("/")[2]
            colour = stages.setdefault(stage, _STAGES[len(stages) % len(_STAGES)])
            yield path, [_line(stage, colour)]


def after_the_last_frame(layout: Layout, texts: Mapping[str, str]) -> StaticData:
    """Yield the static data that a recording ends with.

    The seconds of a run lie apart from its summary, beside the timing: everything else is the same
    when the same log is replayed again.
    """
    summary = json.loads(texts.get(at.SUMMARY, "{}"))
    yield from _guides(layout, summary)
    yield at.SECONDS, [rr.TextDocument(json.dumps(summary.pop("seconds", {})))]
    timeless = {at.SUMMARY: json.dumps(summary, indent=2)} if summary else {}
    yield from _results({**texts, **timeless})


def _results(texts: Mapping[str, str]) -> StaticData:
    yield from ((f"/results/{name}", [rr.TextDocument(text)]) for name, text in texts.items())


def _line(name: str, colour: Colour) -> rr.SeriesLines:
    return rr.SeriesLines(names=name, colors=colour, widths=2.0)


def _guides(layout: Layout, summary: Mapping[str, Any]) -> StaticData:
    """Yield the guide to the first tab and the rows' headers; ``summary`` is empty at first.

    The guide begins with the verdict on the drive; a header has the variant's name, its title, and
    the rates of its final mask.
    """
    names = [as_markdown(variant.name) for variant in layout.shown]
    others = " and ".join(names[_ROWS:])
    rows = _ROW_GUIDE.format(
        rows=" and ".join(names[:_ROWS]),
        others=f"Further tabs show the phases of {others}." if others else "",
    )
    parts = [_ERRORS, rows, _CURVES] if layout.has_truth else [_NO_TRUTH, rows]
    yield _guide(layout.drive, str(summary.get("verdict", "")), *parts, _HANDLING)
    for variant, name in zip(layout.shown, names, strict=True):
        rates = summary.get("totals", {}).get(variant.name, {}).get(variant.stages[-1], {})
        # A heading would break the name in such a narrow column.
        drive = [f"{rate} {percent(rates[rate])} %" for rate in SHORT if rate in rates]
        parts = [f"**{name}**", "  \n".join(["Drive:", *drive] if drive else [])]
        parts.append(as_markdown(variant.title))
        text = "\n\n".join(filter(None, parts)) + "\n"
        yield f"{at.GUIDE}/{variant.name}", [rr.TextDocument(text, media_type=_MARKDOWN)]


def _guide(drive: str, verdict: str, *parts: str) -> tuple[str, list[Any]]:
    text = [f"### {as_markdown(drive)}", "", as_markdown(verdict), "", *parts]
    return at.GUIDE, [rr.TextDocument("\n".join(text), media_type=_MARKDOWN)]

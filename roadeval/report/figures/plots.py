"""The report's own figures, as vectors."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import BASELINE
from roadeval.report.blocks import Asset
from roadeval.report.figures.style import FAINT, INK, RC, Look, looks
from roadeval.report.findings import Heat, Totals

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH: Final = 7.4
"""Inches; a page's text is 6.7 wide, so letters come out a little smaller than said here."""
BARS: Final = 400
"""More frames than this are drawn as means of neighbours."""
FP: Final = "#D55E00"
FN: Final = "#CC79A7"


def vector(draw: Callable[[], Figure]) -> Asset:
    """Draw a figure as SVG; equal figures give equal bytes.

    Text stays text, in the font that `roadeval.report.pdf.typeset` finds with Matplotlib, so that
    the document embeds each font once and its figures can be searched.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    buffer = io.BytesIO()
    look: Any = {**RC, "svg.fonttype": "none", "svg.hashsalt": "roadeval"}
    with mpl.rc_context(look):
        figure = draw()
        FigureCanvasSVG(figure)
        figure.savefig(buffer, format="svg", dpi=200, metadata={"Date": None})
    return Asset(buffer.getvalue())


def difference(
    frames: pd.DataFrame, treated: str, control: str, found: Mapping[str, Any]
) -> Figure:
    """Draw the paired difference of ERR over the drive, and its mean with the interval.

    Parameters
    ----------
    frames
        Indexed by ``frame``, with a column ``ERR``.
    treated, control
        The variants, for their colours.
    found
        The difference as in ``summary.json``.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, 2.6), layout="constrained")
    ax = figure.subplots()
    group = max(-(-len(frames) // BARS), 1)
    places = np.arange(0, len(frames), group)
    values = 100 * _grouped(frames["ERR"].to_numpy(float), group)
    look = looks([treated, control])
    for name, wanted in ((control, values > 0), (treated, values <= 0)):
        ax.bar(
            places[wanted] + (group - 1) / 2, values[wanted], 0.86 * group, color=look[name].colour
        )
    if found["low"] is not None:
        ax.axhspan(100 * found["low"], 100 * found["high"], color=INK, alpha=0.12, linewidth=0)
    ax.axhline(100 * found["mean"], color=INK, linewidth=1.2, linestyle=(0, (4, 2)))
    ax.axhline(0, color=FAINT, linewidth=0.8)
    _frame_ticks(ax, frames.index.to_numpy())
    ax.set_ylabel("difference of ERR, pp")
    ax.margins(y=0.12)
    for height, align, word in ((0.98, "top", "worse"), (0.02, "bottom", "better")):
        ax.text(
            *(0.006, height, f"{treated} {word}"),
            transform=ax.transAxes,
            va=align,
            color=FAINT,
            size=8,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 1.5},
        )
    return figure


def regions(table: pd.DataFrame, variants: Sequence[str], names: Mapping[str, str]) -> Figure:
    """Draw the error rate in each region, and its share of the pixels and of the errors.

    Parameters
    ----------
    table
        ``variant``, ``region``, ``ERR``, ``pixels`` and ``errors``.
    variants
        Those to draw, in order.
    names
        The regions to draw, from top to bottom, with their names for people.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, 0.75 + 0.24 * len(names)), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    rows = np.arange(len(names))
    pixels = table.drop_duplicates("region").set_index("region")["pixels"].reindex([*names])
    right.barh(rows, 100 * pixels, 0.7, color="#E3E3E3", label="share of the pixels")
    for name, look in looks(variants).items():
        own = table[table["variant"] == name].set_index("region").reindex([*names])
        for ax, column in ((left, "ERR"), (right, "errors")):
            marks(ax, 100 * own[column].to_numpy(float), rows, look)
    left.set_yticks(rows, list(names.values()))
    left.invert_yaxis()
    left.set_xlabel("ERR within the region, %")
    right.set_xlabel("share of the wrong pixels, %")
    for ax in (left, right):
        ax.set_xlim(left=0)
        ax.grid(axis="x")
    handles, labels = left.get_legend_handles_labels()
    more, also = right.get_legend_handles_labels()
    figure.legend(
        [*handles, more[also.index("share of the pixels")]],
        [*(label.partition(":")[0] for label in labels), "share of the pixels"],
        loc="outside upper left",
        ncols=len(labels) + 1,
        handlelength=1.5,
    )
    return figure


def stages(totals: Totals) -> Figure:
    """Draw ERR, FPR and FNR of each stage's mask, a line a variant."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, 2.5), layout="constrained")
    names = list(dict.fromkeys(s for v, own in totals.items() for s in own if v != BASELINE))
    for ax, rate in zip(figure.subplots(1, 3), ("ERR", "FPR", "FNR"), strict=True):
        for variant, look in looks(list(totals)).items():
            own = totals[variant]
            if variant == BASELINE:
                value = next(iter(own.values()))[rate]
                ax.axhline(in_percent(value), color=look.colour, linestyle=look.dash, linewidth=1.3)
                continue
            places = [names.index(stage) for stage in own]
            values = [in_percent(total[rate]) for total in own.values()]
            ax.plot(places, values, color=look.colour, linestyle=look.dash, linewidth=look.width)
            marks(ax, np.array(places), np.array(values), look)
        ax.set_xticks(range(len(names)), names)
        ax.set_xlim(-0.3, len(names) - 0.7)
        ax.set_ylim(bottom=0)
        ax.set_title(f"{rate}, %", loc="left")
    legend(figure, list(totals))
    return figure


def heat(maps: Sequence[Heat]) -> Figure:
    """Draw where false positives and false negatives lie, a row a variant."""
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.figure import Figure

    height, width = maps[0].fp.shape
    row = (WIDTH - 0.9) / 2 * height / width
    figure = Figure(figsize=(WIDTH, (row + 0.1) * len(maps) + 0.5), layout="constrained")
    grid = figure.subplots(len(maps), 2, squeeze=False)
    for column, (title, colour) in enumerate(
        (("false positives: non-road called road", FP), ("false negatives: road missed", FN))
    ):
        shares = [(each.fp, each.fn)[column] for each in maps]
        top = max(np.nanmax([np.nanmax(np.nan_to_num(share)) for share in shares]), 0.01)
        colours = LinearSegmentedColormap.from_list("", ["white", colour, "#1A0A00"])
        palette = colours.with_extremes(bad="#BBBBBB")
        for ax, each, share in zip(grid[:, column], maps, shares, strict=True):
            drawn = ax.imshow(100 * share, cmap=palette, vmin=0, vmax=100 * top, aspect="auto")
            ax.set_xticks([])
            ax.set_yticks([])
            ax.spines[:].set_visible(True)
            if column == 0:
                ax.set_ylabel(each.variant)
        grid[0, column].set_title(title, loc="left")
        bar = figure.colorbar(drawn, ax=grid[:, column], location="bottom", aspect=40, pad=0.02)
        bar.set_label("% of the frames that label the pixel", size=8)
        bar.outline.set_visible(False)
    return figure


def coverage(table: pd.DataFrame) -> Figure:
    """Draw the share of the image that each variant calls road, over the frames."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, 2.6), layout="constrained")
    ax = figure.subplots()
    frames = table.index.to_numpy()
    for name, look in looks(list(table.columns)).items():
        ax.plot(
            frames,
            100 * table[name],
            color=look.colour,
            linestyle=look.dash,
            linewidth=look.width,
        )
    ax.set_xlabel("frame")
    ax.set_ylabel("image called road, %")
    ax.set_ylim(bottom=0)
    legend(figure, list(table.columns))
    return figure


def marks(ax: Axes, x: Any, y: Any, look: Look) -> None:
    """Draw a variant's marks, and no line between them."""
    face = "white" if look.hollow else look.colour
    ax.plot(
        x,
        y,
        label=look.label,
        color=look.colour,
        marker=look.marker,
        markersize=5.5,
        markerfacecolor=face,
        linestyle="none",
        zorder=look.order + 1,
        clip_on=False,
    )


def legend(figure: Figure, variants: Sequence[str]) -> None:
    """Write above the axes which variant is drawn how."""
    from matplotlib.lines import Line2D

    handles = [
        Line2D(
            [],
            [],
            color=look.colour,
            linestyle=look.dash,  # type: ignore[arg-type]
            linewidth=look.width,
            marker=None if name == BASELINE else look.marker,
            markersize=5,
            markerfacecolor="white" if look.hollow else look.colour,
            label=name,
        )
        for name, look in looks(variants).items()
    ]
    figure.legend(handles=handles, loc="outside upper left", ncols=6, handlelength=3.2)


def _frame_ticks(ax: Axes, frames: Any) -> None:
    """Label places along the evaluated frames with round numbers of frames."""
    from matplotlib.ticker import MaxNLocator

    wanted = MaxNLocator(nbins=10, integer=True).tick_values(frames[0], frames[-1])
    wanted = wanted[(wanted >= frames[0]) & (wanted <= frames[-1])]
    places = np.unique(np.searchsorted(frames, wanted))
    ax.set_xticks(places, [str(frame) for frame in frames[places]])
    ax.set_xlim(-0.5, len(frames) - 0.5)
    ax.set_xlabel("frame")


def _grouped(values: Any, group: int) -> Any:
    """Average neighbours, an undefined value left out."""
    starts = np.arange(0, len(values), group)
    known = ~np.isnan(values)
    sums = np.add.reduceat(np.where(known, values, 0.0), starts)
    counts = np.add.reduceat(known.astype(float), starts)
    return np.divide(sums, counts, out=np.zeros(len(starts)), where=counts > 0)


def in_percent(fraction: float | None) -> float:
    """Turn a fraction into percent, an undefined one into NaN."""
    return np.nan if fraction is None else 100 * fraction

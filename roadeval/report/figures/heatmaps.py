"""Heat maps: in how many frames each part of the image was wrong."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from roadeval.data import colours
from roadeval.report.figures.charts import WIDTH
from roadeval.report.figures.layout import INCH, SMALL, fitting, place_maps
from roadeval.report.figures.values import tops_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from roadeval.report.findings import ErrorHeatmap

MAPS_SHARE: Final = 0.62
"""Share of the page's width that `heatmap` is drawn for, so that its letters keep their size."""


def heatmap(maps: Sequence[ErrorHeatmap], among: Sequence[ErrorHeatmap] | None = None) -> Figure:
    """Draw where false positives and false negatives are, a row a variant.

    Equal shades are equal shares in all maps ``among`` which these are; by default these alone.
    """
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.figure import Figure

    height, width = maps[0].fp.shape
    figure = Figure(figsize=(MAPS_SHARE * WIDTH, 3))
    grid = figure.subplots(len(maps), 2, squeeze=False)
    bars = place_maps(figure, len(maps), height / width)
    columns = (
        ("FP: non-road called road", colours.FP, [each.fp for each in maps]),
        ("FN: road missed", colours.FN, [each.fn for each in maps]),
    )
    tops = tops_of(among or maps)
    for axes, cax, (title, colour, shares), top in zip(grid.T, bars, columns, tops, strict=True):
        shades = ["white", colours.hex_of(colour), colours.hex_of(colours.MOST_ERRORS)]
        bad = colours.hex_of(colours.NEVER_LABELLED)
        palette = LinearSegmentedColormap.from_list("", shades).with_extremes(bad=bad)
        for ax, share in zip(axes, shares, strict=True):
            drawn = ax.imshow(100 * share, cmap=palette, vmin=0, vmax=100 * top, aspect="auto")
            ax.set_xticks([])
            ax.set_yticks([])
            ax.spines[:].set_visible(True)
        axes[0].set_title(title, loc="left", y=1)
        bar = figure.colorbar(drawn, cax=cax, orientation="horizontal")
        bar.set_label("% of the frames")
        bar.outline.set_visible(False)
    for ax, each in zip(grid[:, 0], maps, strict=True):
        room = INCH * figure.get_figheight() * ax.get_position().height
        ax.set_ylabel(fitting(each.variant, room), size=SMALL)
    return figure

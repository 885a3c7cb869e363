"""What is drawn, as text: every line, mark and picture with its numbers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import to_hex

from roadeval.report import blocks
from roadeval.report.chart import Chart
from roadeval.report.figures import FigurePicture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def charted(figure: blocks.Figure) -> str:
    """The charts of a report's figure."""
    return "\n".join([f"figure: {figure.caption}", *map(_charted, figure.charts)])


def _charted(chart: Chart) -> str:
    told = f"  {chart.kind} {chart.title!r} in {chart.unit}"
    lines = [f"{told}{', from zero' if chart.from_zero else ''}"]
    lines += [f"    names {' | '.join(chart.names)}"] if chart.names else []
    lines += [f"    share {_numbers(chart.share)}"] if chart.share else []
    lines += [f"    across {chart.across}"] if chart.across else []
    for axis, ends in (("x", chart.x_range), ("y", chart.y_range)):
        lines += [f"    {axis} from {ends[0]:.4g} to {ends[1]:.4g}"] if ends else []
    if level := chart.level:
        ends = _numbers((level.value, level.low, level.high))
        lines.append(f"    level {level.name!r}: {ends}")
    for each in chart.series:
        look = f"{each.look.colour} {each.look.dash} {each.look.mark}{' hollow' * each.look.hollow}"
        lines.append(f"    {each.name!r}, {look}: {_points(each.x, each.y)}")
        lines += [f"        from {_numbers(each.low)} to {_numbers(each.high)}"] if each.low else []
    return "\n".join(lines)


def _numbers(values: Any) -> str:
    return " ".join(f"{each:.4g}" for each in values)


def described(figure: Figure) -> str:
    """A figure's words and data, axes by axes."""
    width, height = figure.get_size_inches()
    lines = [f"figure of {width:.3g} x {height:.3g} inches", *_words(figure), *_pictures(figure)]
    for number, axes in enumerate(figure.axes, 1):
        lines += [f"  axes {number}", *(f"    {line}" for line in _axes(axes))]
    return "\n".join(lines)


def _words(figure: Figure) -> Iterator[str]:
    for text in figure.texts:
        yield f"  text {text.get_text()!r}"
    for legend in filter(None, (axes.get_legend() for axes in figure.axes)):
        yield f"  legend {legend.get_title().get_text()!r}"
        for handle, text in zip(legend.legend_handles, legend.get_texts(), strict=True):
            yield f"  legend {text.get_text()!r}: {_look(handle)}"


def _pictures(figure: Figure) -> Iterator[str]:
    """The pictures of figure 2, with their places in shares of the figure."""
    for picture in figure.artists:
        if isinstance(picture, FigurePicture):
            box = picture.box.transformed(figure.transFigure.inverted())
            place = " ".join(f"{share:.3g}" for share in box.extents)
            pixels = np.asarray(picture.get_array())
            yield f"  picture of {pixels.shape} at {place}, mean {pixels.mean():.5g}"


def _axes(axes: Axes) -> Iterator[str]:
    for label in ("xlabel", "ylabel"):
        if text := getattr(axes, f"get_{label}")():
            yield f"{label} {text!r}"
    yield from _sides(axes)
    for line in axes.lines:
        yield f"line {_points(line.get_xdata(), line.get_ydata())}: {_look(line)}"
    for text in axes.texts:
        x, y = text.get_position()
        yield f"text {text.get_text()!r} at {x:.4g} {y:.4g}, size {text.get_size():.3g}"


def _sides(axes: Axes) -> Iterator[str]:
    """The range, the words and the grid of each side."""
    for side in "xy":
        low, high = getattr(axes, f"get_{side}lim")()
        ticks = getattr(axes, f"get_{side}ticklabels")()
        names = " | ".join(tick.get_text() for tick in ticks)
        yield f"{side} from {low:.4g} to {high:.4g}: {names}".rstrip(": |")
        grid = [line for line in getattr(axes, f"get_{side}gridlines")() if line.get_visible()]
        if grid and axes.axison:
            yield f"{side} grid: {_look(grid[0])}"


def _look(artist: Any) -> str:
    """The colours, dash and mark of a line."""
    parts = []
    for name in ("color", "linestyle", "linewidth", "marker", "markerfacecolor"):
        value = getattr(artist, f"get_{name}", lambda: None)()
        if value is None or value in ("None", ""):
            continue
        if "color" in name:
            value = to_hex(value, keep_alpha=to_hex(value, keep_alpha=True)[-2:] != "ff")
        parts.append(f"{name} {value}")
    return ", ".join(parts)


def _points(x: Any, y: Any) -> str:
    places = zip(np.asarray(x, float), np.asarray(y, float), strict=True)
    return " ".join(f"({a:.4g} {b:.4g})" for a, b in places)

"""What is drawn, as text: every line, mark and picture with its numbers."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import numpy as np
from PIL import Image

from roadeval.report import blocks
from roadeval.report.chart import Chart


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


def described(report: blocks.Report) -> str:
    """The words and pictures of a figure of the paper; its charts are told by `charted`."""
    lines = [f"figure file: {report.title}", f"  {report.subtitle}"]
    for grid in (block for block in report.blocks if isinstance(block, blocks.ImageGrid)):
        for title, image in grid.pictures:
            pixels = np.asarray(Image.open(BytesIO(image.content)))
            lines.append(f"  picture {title!r} of {pixels.shape}, mean {pixels.mean():.4g}")
    return "\n".join(lines)


def _points(x: Any, y: Any) -> str:
    places = zip(np.asarray(x, float), np.asarray(y, float), strict=True)
    return " ".join(f"({a:.4g} {b:.4g})" for a, b in places)

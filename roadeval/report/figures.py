"""The paper's figures 2, 3a and 3b as PNG and PDF files, drawn as the report draws them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from roadeval.data import BASELINE, FILTERED, IGNORE, UNFILTERED, Rows
from roadeval.evaluation import score
from roadeval.report.blocks import Block, Document, Figure, Text
from roadeval.report.chart import Chart
from roadeval.report.charts.rates import over_windows
from roadeval.report.images import ExampleFrame, example_grid, variants_of
from roadeval.report.pdf.typeset import figure_files

DPI: Final = 254
"""Dots an inch of a PNG: 1,600 across."""
LABELS: Final[Mapping[str, str]] = {
    FILTERED: "filtered: with the shadow filter",
    UNFILTERED: "unfiltered: without it",
    BASELINE: "blind: never looks at the image",
}
"""Names in the legend of a figure that stands alone."""


def write_figures(
    folder: Path, drive: str, windows: Rows, examples: Sequence[ExampleFrame]
) -> list[Path]:
    """Write every figure that has something to draw as PNG and PDF; return the files.

    Equal figures give equal files, byte for byte.

    Parameters
    ----------
    folder
        Where; made if it is not there.
    drive
        Its name, for titles.
    windows
        As ``windows.csv``, any number of variants; no row without truth.
    examples
        A few frames, for figure 2.

    Raises
    ------
    OSError
        If the folder cannot be written to.
    ReportError
        If the system's folder for temporary files cannot be.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = {
        folder / f"{name}.{kind}": content
        for name, figure in figures(drive, windows, examples)
        for kind, content in figure_files(figure, DPI).items()
    }
    for path, content in files.items():
        path.write_bytes(content)
    return [*files]


def figures(
    drive: str, windows: Rows, examples: Sequence[ExampleFrame]
) -> Iterator[tuple[str, Document]]:
    """Yield the name and the content of each figure that has something to draw."""
    if examples:
        ignored = any(e.truth is not None and (e.truth == IGNORE).any() for e in examples)
        missing = any(len(e.masks) < len(variants_of(examples)) for e in examples)
        note = (
            "Green with a white edge: road"
            + "; grey: ignored, counted nowhere" * ignored
            + "; faded: there is no mask of this frame" * missing
        )
        yield "fig2_masks", _document(f"Road masks on {drive}", note, example_grid(examples))
    if len(windows):
        for name, title, rates in (
            ("fig3a_error_rate", "Error rate", ["ERR"]),
            ("fig3b_fp_fn_rate", "False positive and false negative rate", ["FPR", "FNR"]),
        ):
            charts = [_labelled(chart) for chart in over_windows(windows, rates)]
            yield name, _document(f"{title} on {drive}", _about(windows), Figure(charts, ""))


def _document(title: str, note: str, block: Block) -> Document:
    return Document("", title, "", "", [Text(title, "title"), Text(note, "note"), block])


def _labelled(chart: Chart) -> Chart:
    named = [replace(each, name=LABELS.get(each.name, each.name)) for each in chart.series]
    return replace(chart, series=named)


def _about(windows: Rows) -> str:
    """Return what a point of the figures over the drive is."""
    stages = ", ".join(score.finals(windows).distinct("stage"))
    sizes = score.each_window(windows)["frames"]
    size, rest = sizes.max(), sizes[-1]
    each = f"each point is the mean of {size} frames" if size > 1 else "each point is one frame"
    short = f", the last of {rest}" if rest < size else ""
    return f"Final mask ({stages}); {each}{short}; lower is better"

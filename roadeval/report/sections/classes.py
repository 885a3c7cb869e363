"""The classes of the truth: which of them the false road is, and which hide missed road."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from roadeval.data.words import percent
from roadeval.evaluation.tables import by_class, only
from roadeval.report.blocks import Block, Cell, Details, Figure, Heading, Table, Text
from roadeval.report.captions import caption
from roadeval.report.chart import Chart, ChartKind, looks
from roadeval.report.charts.standard import series
from roadeval.report.findings import Findings
from roadeval.results.fleet import FleetFolder
from roadeval.results.sentences import describe_classes

MOST: Final = 8
"""Most classes in the charts."""
LEAST: Final = 0.005
"""Least share of the false road, or of the missed road, of a class in the charts."""


def section(findings: Findings | FleetFolder) -> Iterator[Block]:
    """Yield the part of each class in the errors; nothing without classes."""
    rows, focus = findings.table("classes"), findings.facts.focus
    of_focus = by_class(only(rows, variant=focus))
    if not len(of_focus):
        return
    yield Heading("Which class is the false road")
    if sentence := " ".join(describe_classes(rows, str(focus)).values()):
        yield Text(f"{focus}: {sentence}")
    is_other = of_focus["truth"] == "other"
    is_wrong = is_other & (of_focus[["false", "missed"]].max(axis=1) >= LEAST)
    shown = of_focus[is_wrong].head(MOST)
    names = [name for name in findings.finals if name in {*rows["variant"]}]
    parts = {name: by_class(only(rows, variant=name)).reindex(shown.index) for name in names}
    charts = [
        Chart(
            title,
            ChartKind.MARKS,
            [
                series(name, look, range(len(shown)), 100 * parts[name][column])
                for name, look in looks(names).items()
            ],
            names=[*shown.index],
            share=(100 * shown["of_other"]).tolist() if column == "false" else (),
        )
        for column, title in (
            ("false", "Share of the false road"),
            ("missed", "Share of the missed road beside it"),
        )
    ]
    if len(shown):
        yield Figure(charts, caption("classes"))
    columns: dict[str, list[Cell | str]] = {
        "class": [*of_focus.index],
        "truth": [*of_focus["truth"]],
        "of the pixels": [*map(percent, of_focus["pixels"].where(of_focus["truth"] != "ignored"))],
        "called road": [*map(percent, of_focus["road"])],
        "of the false road": [*map(percent, of_focus["false"].where(is_other))],
        "of the missed road": [*map(percent, of_focus["missed"].where(is_other))],
        "worst frames": [
            Cell(text, frames=[int(word) for word in text.split() if word.isdecimal()])
            for text in of_focus["worst"]
        ],
    }
    if isinstance(findings, FleetFolder):
        del columns["worst frames"]
    table = Table(
        [*columns],
        [*zip(*columns.values(), strict=True)],
        text_columns=[0, 1],
        caption=caption("table of classes", variant=focus),
        small=True,
    )
    yield Details("Every class in numbers", [table])

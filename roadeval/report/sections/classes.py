"""The truth's classes that are taken for road, or beside which road is missed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from roadeval.data.words import percent
from roadeval.evaluation.tables import by_class, only
from roadeval.report.blocks import Block, Cell, Details, Figure, Heading, Table, Text
from roadeval.report.captions import caption
from roadeval.report.charts.standard import OF_CLASSES, regions
from roadeval.report.findings import Findings
from roadeval.results.fleet import FleetFolder
from roadeval.results.why import describe_classes

MOST: Final = 8
"""Greatest number of classes in the charts."""
LEAST: Final = 0.005
"""A class in the charts has at least this share of the false road or of the missed road."""


def section(findings: Findings | FleetFolder) -> Iterator[Block]:
    """Yield each class's shares of the errors; nothing without classes."""
    import pandas as pd

    rows, focus = findings.table("classes"), findings.facts.focus
    names = [name for name in findings.facts.finals if name in {*rows["variant"]}]
    if focus not in names:
        return
    by_variant = {name: by_class(only(rows, variant=name)) for name in names}
    of_focus, parts = by_variant[focus], pd.concat(by_variant, names=["variant"])
    yield Heading("What is taken for road")
    if sentence := " ".join(describe_classes(rows, focus).values()):
        yield Text(f"{focus}: {sentence}")
    is_other = of_focus["truth"] == "other"
    is_wrong = is_other & (of_focus[[*OF_CLASSES]].max(axis=1) >= LEAST)
    if titles := {name: name for name in of_focus.index[is_wrong][:MOST]}:
        shares = parts[[*OF_CLASSES]].assign(pixels=parts["of_other"])
        yield Figure(regions(shares, names, titles, OF_CLASSES), caption("classes"))
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

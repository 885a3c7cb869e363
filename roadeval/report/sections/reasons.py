"""Where the errors are, and which stage broke it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import Final

from roadeval.data import BASELINE, FILTERED, UNFILTERED
from roadeval.report.blocks import Block, Cell, Figure, Heading, Table, Text
from roadeval.report.figures import plots
from roadeval.report.findings import Findings
from roadeval.report.sections.front import SIDE_BY_SIDE, counted, variant_cell
from roadeval.report.words import DASH, number, percent, points

REGIONS: Final = {
    "shadow": "inside detected shadow",
    "shadow_edge": "at the edge of detected shadow",
    "lit": "in light",
    "true_shadow": "inside true shadow",
    "boundary": "near the road's edge",
    "interior": "away from the road's edge",
}
"""The regions' names for people, in the report's order; row bands follow."""
FILTER: Final = "filter"
"""Names the filter's part among the stages' in `Findings.parts`."""
MAPS: Final = 2
"""Variants whose heat maps share a figure."""


def where(found: Findings) -> Iterator[Block]:
    """Say in which parts of the image the errors lie."""
    yield Heading("Where the errors are")
    names, table = region_names(found), found.regions
    variants = [*found.finals]
    yield Figure(
        plots.vector(lambda: plots.regions(table, variants, names)),
        "Error rate within each region, and the region's share of all wrong pixels beside its "
        "share of all pixels: a mark to the right of the grey bar is more than its share.",
    )
    yield from _regions(found, names)
    yield Text(_said(found), "note")
    for place in range(0, len(found.heat), MAPS):
        yield Figure(
            plots.vector(partial(plots.heat, found.heat[place : place + MAPS])),
            f"Where the final masks go wrong, {_counted(found)}. Grey: never labelled.",
            width=0.68,
        )


def region_names(found: Findings) -> dict[str, str]:
    """Name the regions that were counted, the row bands by what they show."""
    present = found.regions["region"].unique().tolist()
    bands = [name for name in present if name.startswith("band_")]
    height = found.summary["drive"].get("height") or 0
    named = {name: text for name, text in REGIONS.items() if name in present}
    for place, name in enumerate(bands):
        first, after = (-(-height * edge // len(bands)) for edge in (place, place + 1))
        end = {0: ", the top", len(bands) - 1: ", the bottom"}.get(place, "")
        named[name] = (
            f"image rows {first}{DASH}{after - 1}" if height else f"image rows, band {place}"
        ) + end
    return named


def _regions(found: Findings, names: Mapping[str, str]) -> Iterator[Table]:
    """Tabulate the regions; two tables where the variants do not fit side by side."""
    shares = {"ERR": "ERR within, %", "errors": "share of its wrong pixels, %"}
    together = len(found.finals) <= SIDE_BY_SIDE
    for columns in [[*shares]] if together else [[column] for column in shares]:
        yield _region_table(found, names, {column: shares[column] for column in columns})


def _region_table(found: Findings, names: Mapping[str, str], columns: Mapping[str, str]) -> Table:
    variants = [*found.finals]
    told = {(row["region"], row["variant"]): row for row in found.regions.to_dict("records")}
    rows: list[list[Cell | str]] = [
        [
            text,
            percent(told[region, variants[0]]["pixels"], 1),
            *(percent(told[region, name][column], 1) for column in columns for name in variants),
        ]
        for region, text in names.items()
    ]
    kinds = [region.split("_")[0] == "band" for region in names]
    first_band = kinds.index(True) if any(kinds) else len(rows)
    halves = [place for place, region in enumerate(names) if region == "boundary"]
    return Table(
        ["<region", "of all, %", *(name for _ in columns for name in variants)],
        rows,
        breaks=sorted({*halves, first_band} - {0, len(rows)}),
        groups=[
            ("", 1),
            ("pixels", 1),
            *((title, len(variants)) for title in columns.values()),
        ],
        small=True,
    )


def _said(found: Findings) -> str:
    width = next(
        (s["evaluation"]["boundary_width"] for s in found.summary["settings"].values()), None
    )
    near = f"within {width} pixels of" if width else "near"
    return (
        "Shadow is what the filter took for shadow, right or wrong; where it is not true shadow, "
        f"that is a finding of its own. Near the road's edge means {near} the border between road "
        "and non-road in the truth. Counts of all evaluated frames together; regions overlap."
    )


def _counted(found: Findings) -> str:
    return f"over {counted(found)}"


# --- Stages ---------------------------------------------------------------------------------------


def stages(found: Findings) -> Iterator[Block]:
    """Say what each stage did to the mask, and which part of the error is whose."""
    yield Heading("Which stage broke it")
    totals = found.totals
    yield Figure(
        plots.vector(lambda: plots.stages(totals)),
        f"Rates of each stage's mask, means over the frames. Dotted: {BASELINE}, for scale.",
    )
    yield _stages(found)
    if len(found.changes):
        yield Text(
            "Repaired and spoiled: labelled pixels that the stage has right and the mask before it "
            f"wrong, and the reverse, {_counted(found)}.",
            "note",
        )
    yield Heading("How the error of the final mask comes about", 2)
    yield _parts(found)
    yield Text(_sum(found), "note")
    yield from _oracles(found)


def _stages(found: Findings) -> Table:
    changes = {
        (row["variant"], row["after"]): (row["repaired"], row["spoiled"])
        for row in found.changes.to_dict("records")
    }
    rows: list[list[Cell | str]] = []
    breaks = []
    for variant, own in found.totals.items():
        breaks.append(len(rows))
        for place, (stage, total) in enumerate(own.items()):
            repaired, spoiled = changes.get((variant, stage), (None, None))
            rows.append(
                [
                    variant_cell(variant, [*found.totals]) if place == 0 else "",
                    stage,
                    Cell(percent(total["ERR"]), bold=stage == found.finals[variant]),
                    percent(total["FPR"]),
                    percent(total["FNR"]),
                    percent(found.overlap[variant][stage]["IoU"]),
                    percent(repaired),
                    percent(spoiled),
                ]
            )
    return Table(
        ["<variant", "<stage", "ERR", "FPR", "FNR", "IoU", "repaired", "spoiled"],
        rows,
        breaks=breaks[1:],
        caption="Percent: of the frames' pixels (ERR), non-road (FPR) and road (FNR).",
    )


def _parts(found: Findings) -> Table:
    """Tabulate the mean ERR of each final mask as a sum over its stages."""
    columns = list(dict.fromkeys(part for parts in found.parts.values() for part in parts))
    return Table(
        ["<final mask", *columns, "ERR"],
        [
            [
                variant_cell(variant, [*found.totals]),
                *(_part(parts, part) for part in columns),
                Cell(percent(found.total(variant)["ERR"]), bold=True),
            ]
            for variant, parts in found.parts.items()
        ],
    )


def _part(parts: Mapping[str, float], part: str) -> str:
    if part not in parts:
        return DASH
    first = part == next(iter(parts))
    return percent(parts[part]) if first else points(parts[part])


def _sum(found: Findings) -> str:
    parts = max(found.parts.values(), key=len)
    first, *rest = parts
    meaning = {
        FILTER: f"what {FILTERED} has more or less than {UNFILTERED} in that mask",
        **{name: f"what {name} made of it" for name in rest if name != FILTER},
    }
    told = "; ".join(f"{name}: {meaning[name]}" for name in rest)
    return (
        f"A sum, in percent of the pixels. {first}: the error of the mask that the last stage is "
        f"given, without the filter{'; ' if told else ''}{told}. Percentage points add up to ERR."
    )


def _oracles(found: Findings) -> Iterator[Block]:
    """Show what remains when a stage is replaced by the truth, where the run counted that."""
    if not len(found.oracles):
        return
    yield Heading("If a stage were perfect", 2)
    rows: list[list[Cell | str]] = [
        [
            variant_cell(row["variant"], [*found.totals]),
            f"perfect {row['oracle']}",
            percent(row["as_is"]),
            Cell(percent(row["ERR"]), bold=True),
            points(row["ERR"] - row["as_is"]),
            percent(row["FPR"]),
            percent(row["FNR"]),
            number(row["frames"]),
        ]
        for row in found.oracles.to_dict("records")
    ]
    yield Table(
        [
            *("<variant", "<if there were a", "ERR as it is", "ERR then", "change, pp"),
            *("FPR then", "FNR then", "frames"),
        ],
        rows,
        small=True,
    )
    yield Text(
        "Oracles: the stage's output replaced by the truth while replaying, and the stages after "
        "it run on that; ignored pixels count as non-road, or lit. No result, but a bound on "
        "what mending the stage could bring, and what the stages after it lose by themselves.",
        "note",
    )

"""The report's first page: the verdict, the key table, the frames, and what to beware of."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from roadeval.data import BASELINE, FILTERED, FINAL_STAGE, UNFILTERED
from roadeval.report.blocks import (
    Block,
    Break,
    Cell,
    Columns,
    Contents,
    Heading,
    Points,
    Strip,
    Table,
    Text,
)
from roadeval.report.figures.style import looks
from roadeval.report.findings import Findings
from roadeval.report.pictures import asset
from roadeval.report.words import defined, listing, number, percent

PAPERS: Final = ("ERR", "FPR", "FNR", "ACC")
"""The rates of the paper that the report tells; the other two mirror FNR and FPR."""
SIDE_BY_SIDE: Final = 3
"""More variants than this do not fit beside each other under several rates."""
CROWDED: Final = 7
"""Variants and warnings together that leave room for all thumbnails."""
PARTIAL: Final = (
    "This run did not reach its end: the report covers the part of the recording that can be read."
)


def summary(found: Findings) -> Iterator[Block]:
    """Lay out the first page."""
    yield Heading("Summary")
    if not found.complete:
        yield Points("Partial recording", [PARTIAL], "warning")
    yield Text(str(found.summary["verdict"]), "verdict")
    if note := _how_sure(found):
        yield Text(note, "note")
    if found.totals:
        yield key_table(found)
    alarms = list(warnings(found))
    if found.thumbnails:
        # A crowded page has room for one row of four only.
        shown = found.thumbnails[: 4 if len(found.finals) + len(alarms) > CROWDED else None]
        yield Strip([(shot.title, asset(shot)) for shot in shown], 4)
        yield Text(_legend(found), "note")
    yield Columns(
        [_accounting(found.summary["frames"])],
        [Points("Beware", alarms, "warning")] if alarms else [Points("Beware", ["Nothing known."])],
    )
    yield Contents()
    yield Break()


def key_table(found: Findings) -> Table:
    """Tabulate every final mask's rates; the best of each column is bold."""
    names = [*found.finals]
    columns = {rate: [found.total(name)[rate] for name in names] for rate in PAPERS}
    columns["pooled ERR"] = [found.total(name)["pooled_ERR"] for name in names]
    for rate in ("IoU", "F1", "precision"):
        columns[rate] = [found.overlap[name][found.finals[name]][rate] for name in names]
    if found.beyond:
        columns["boundary F"] = [found.beyond.get(name, {}).get("boundary_F") for name in names]
    best = {title: _best(title, values) for title, values in columns.items()}
    rows: list[list[Cell | str]] = [
        [
            variant_cell(name, names),
            number(found.total(name)["frames"]),
            *(
                Cell(percent(values[place]), bold=place == best[title])
                for title, values in columns.items()
            ),
        ]
        for place, name in enumerate(names)
    ]
    return Table(
        ["<final mask", "frames", *columns],
        rows,
        caption=(
            "Percent. The paper's rates are means over the evaluated frames; pooled ERR, IoU, F1 "
            f"and precision are of all pixels together.{_edge(found)} Bold: the best."
        ),
    )


def _edge(found: Findings) -> str:
    widths = {told["width"] for told in found.beyond.values()}
    return f" Boundary F: the road's edge within {widths.pop()} pixels." if widths else ""


def variant_cell(name: str, names: Sequence[str]) -> Cell:
    """Name a variant, with the dot of its colour."""
    return Cell(name, dot=looks(list(names))[name].colour)


def counted(found: Findings) -> str:
    """Say which frames' masks were read for what the tables do not hold."""
    evaluated = found.summary["frames"]["evaluated"]
    if found.sampled == evaluated:
        return f"all {evaluated} evaluated frames"
    if found.pictured == evaluated:
        return f"{found.sampled} frames spread evenly over the {evaluated} evaluated"
    return (
        f"{found.sampled} of the {found.pictured} frames whose pictures were kept, out of "
        f"{evaluated} evaluated (which may not be a fair sample)"
    )


def warnings(found: Findings) -> Iterator[str]:
    """Say what a reader must know before believing the numbers."""
    yield from map(str, found.summary.get("warnings", ()))
    training = found.summary.get("training", {})
    if training.get("source") == "truth" and training.get("model") is None and found.totals:
        yield (
            "Trained on this drive's own first frames (none of them is evaluated): the rates say "
            "how well it does on a road that it has seen."
        )
    yield from _beaten(found)
    yield from _undefined(found)
    losses = list(found.summary.get("losses", ()))
    yield from (f"Lost: {loss}" for loss in losses[:3])
    if len(losses) > 3:
        yield f"{len(losses) - 3} more frames were lost; summary.json names them."
    if not found.pictured:
        yield "Made without pictures (a results folder holds none): no gallery, no maps."


def _how_sure(found: Findings) -> str:
    told = found.summary.get("difference", {}).get(FINAL_STAGE, {}).get("ERR")
    if not told or told["low"] is None:
        return "The verdict concerns this drive only." if found.totals else ""
    return (
        f"{FILTERED} minus {UNFILTERED}, {100 * told['confidence']:.0f} % interval over "
        f"{told['frames']} frames that are worth about {told['effective_frames']:.0f} independent "
        "ones. The verdict concerns this drive only."
    )


def _legend(found: Findings) -> str:
    first = next(iter(found.finals), None)
    if first is None:
        return "Green: called road."
    return (
        f"Errors of {first} across the drive. Green: road found; orange: non-road called road "
        "(FP); purple: road missed (FN); grey: ignored."
    )


def _accounting(frames: Mapping[str, Any]) -> Table:
    told = [
        (name.replace("_", " "), value) for name, value in frames.items() if isinstance(value, int)
    ]
    skipped = [(f"skipped: {why}", value) for why, value in frames.get("skipped", {}).items()]
    return Table(
        ["<frames", "count"],
        [[name, number(value)] for name, value in [*told, *skipped]],
        small=True,
    )


def _best(title: str, values: Sequence[float | None]) -> int | None:
    known = {place: value for place, value in enumerate(values) if defined(value)}
    pick = min if title.removeprefix("pooled ") in ("ERR", "FPR", "FNR") else max
    return pick(known, key=lambda place: known[place], default=None)


def _beaten(found: Findings) -> Iterator[str]:
    """Name the variants that the baseline beats."""
    if BASELINE not in found.finals:
        return
    blind = found.total(BASELINE)["ERR"]
    worse = [
        name
        for name in found.finals
        if defined(blind) and defined(found.total(name)["ERR"]) and found.total(name)["ERR"] > blind
    ]
    if worse:
        yield (
            f"{listing(worse)} {'is' if len(worse) == 1 else 'are'} worse than {BASELINE} (ERR "
            f"{percent(blind)} %), which never looks at the image: nothing was gained from its "
            "pixels here."
        )


def _undefined(found: Findings) -> Iterator[str]:
    for variant in found.finals:
        total = found.total(variant)
        frames, counts = total["frames"], total["undefined"].items()
        if never := [rate for rate, count in counts if count == frames]:
            yield f"{variant}: undefined on every frame: {listing(never)}."
        if many := [f"{rate} on {count}" for rate, count in counts if 0 < count < frames]:
            yield f"{variant}: undefined on some of {frames} frames, and left out: {listing(many)}."

"""Filtered against unfiltered, frame by frame, and every variant against the baseline."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from roadeval.data import BASELINE
from roadeval.data.words import DASH, defined, listing, number, percent, points
from roadeval.evaluation.stats import Difference
from roadeval.report.blocks import Block, Cell, Figure, Heading, Table, Text
from roadeval.report.charts.differences import difference
from roadeval.report.findings import Findings, PairedComparison
from roadeval.report.sections.common import sampled_frames, variant_cell
from roadeval.results.sentences import correction, marked_interval


def section(findings: Findings) -> Iterator[Block]:
    """Yield what the filter changed, how much masks flicker, and who beats the baseline."""
    filters = [each for each in findings.paired if each.control != BASELINE]
    blind = [each for each in findings.paired if each.control == BASELINE]
    for each in filters:
        yield Heading("Filtered against unfiltered")
        yield from _paired(findings, each)
    if blind:
        yield Heading("Against a guess that never looks at the image", 2 if filters else 1)
        yield _against_baseline(findings, blind)
        yield Text(
            f"{BASELINE}: the training frames' mean truth, thresholded at one half. A variant that "
            "does not beat it has learnt nothing from the pixels. Differences are the variant "
            "minus the guess, with intervals that allow for neighbouring frames' likeness.",
            "note",
        )
    if legend := correction(pair.differences["ERR"] for pair in findings.paired):
        yield Text(legend, "note")
    yield from _flicker(findings)


def _paired(findings: Findings, pair: PairedComparison) -> Iterator[Block]:
    yield _differences(findings, pair)
    change = pair.differences["ERR"]
    if not defined(change.mean):
        yield Text("ERR is undefined on every frame, so nothing tells what the filter does to it.")
        return
    yield Text(_method(change), "note")
    yield Text(frames_changed(pair))
    if pair.pixels is not None:
        yield Text(pixels_changed(findings, pair))
    columns = pair.frames["frame"], pair.frames["ERR"]
    yield Figure(
        [difference(*columns, pair.treated, pair.control, change)],
        f"ERR of {pair.treated} minus {pair.control}, frame by frame.",
    )


def _differences(findings: Findings, pair: PairedComparison) -> Table:
    names = [pair.treated, pair.control]
    return Table(
        ["rate", *names, "difference, pp", "interval, pp", "frames", "effective"],
        [
            [
                rate,
                *(percent(findings.total(name)[rate]) for name in names),
                Cell(points(change.mean), bold=True),
                marked_interval(change),
                number(change.units),
                DASH if change.effective is None else f"{change.effective:.0f}",
            ]
            for rate, change in pair.differences.items()
        ],
        caption=(
            f"Paired differences of the final masks, {pair.treated} minus {pair.control}: percent, "
            "and percentage points with their interval."
        ),
    )


def _method(change: Difference) -> str:
    if change.low is None:
        return f"No interval for ERR: {change.none_because}."
    return (
        f"{percent(change.confidence, 0)} % intervals. Neighbouring frames resemble each other, "
        "and the intervals are the wider for it; effective says how many independent frames would "
        "tell as much. All of this concerns this drive only."
    )


def frames_changed(pair: PairedComparison) -> str:
    """Return on how many frames the filter lowers ERR, raises it and leaves it."""
    better, same, worse = (int((np.sign(pair.frames["ERR"]) == sign).sum()) for sign in (-1, 0, 1))
    count = max(better + same + worse, 1)
    parts = [
        f"lowers ERR on {better} frames ({percent(better / count, 0)} %)",
        f"raises it on {worse} ({percent(worse / count, 0)} %)",
        *([f"leaves it on {same} ({percent(same / count, 0)} %)"] if same else []),
    ]
    return f"Of {better + same + worse} frames the filter {listing(parts)}."


def pixels_changed(findings: Findings, pair: PairedComparison) -> str:
    """Return which share of the pixels the filter made right and wrong, and what remains."""
    assert pair.pixels is not None
    right, wrong, labelled = pair.pixels
    net = int(pair.frames["wrong"].sum())
    change = f"{number(abs(net))} {'more' if net > 0 else 'fewer'} wrong pixels in all"
    return (
        f"Of the labelled pixels of {sampled_frames(findings)}, {percent(right / labelled)} % are "
        f"newly right with the filter and {percent(wrong / labelled)} % newly wrong; over all "
        f"frames that leaves {change}."
    )


def _flicker(findings: Findings) -> Iterator[Block]:
    """Tabulate how much of each final mask changes from frame to frame, beside the truth's own."""
    known = {name: each for name, each in findings.facts.beyond.items() if defined(each["flicker"])}
    if not known:
        return
    yield Heading("From one frame to the next", 2)
    yield Table(
        ["final mask", "flicker, %", "the truth's own, %", "beyond it, pp", "pairs of frames"],
        [
            [
                variant_cell(name, [*findings.finals]),
                Cell(percent(each["flicker"]), bold=True),
                percent(each["truth_flicker"]),
                points(each["flicker"] - each["truth_flicker"]),
                number(each["pairs"]),
            ]
            for name, each in known.items()
        ],
    )
    yield Text(
        "Flicker: the share of pixels, labelled in both of two frames read one after the other, "
        "whose mask differs. What moves must change, as the truth does; only what goes beyond it "
        "is unrest. Motion is not taken out.",
        "note",
    )


def _against_baseline(findings: Findings, blind: Sequence[PairedComparison]) -> Table:
    return Table(
        ["final mask", "ERR", "difference, pp", "interval, pp", "frames better", "frames worse"],
        [
            [
                variant_cell(pair.treated, [*findings.finals]),
                percent(findings.total(pair.treated)["ERR"]),
                Cell(points((change := pair.differences["ERR"]).mean), bold=True),
                marked_interval(change),
                number(int((pair.frames["ERR"] < 0).sum())),
                number(int((pair.frames["ERR"] > 0).sum())),
            ]
            for pair in blind
        ],
    )

"""The paper's tables and figures, and with the filter against without."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from roadeval.data import BASELINE, FILTERED, TRUTH, UNFILTERED, mask_spec
from roadeval.report.blocks import Asset, Block, Cell, Figure, Heading, Strip, Table, Text
from roadeval.report.figures import plots
from roadeval.report.figures.files import Example
from roadeval.report.figures.rates import error_rate, fp_fn_rate
from roadeval.report.findings import Findings, Versus
from roadeval.report.pictures import Shot, asset
from roadeval.report.sections.front import PAPERS, SIDE_BY_SIDE, counted, variant_cell
from roadeval.report.words import DASH, defined, interval, listing, number, percent, points

PAPER_ROW: Final = 10
"""Frames in a row of the paper's figures (section 5)."""
ROAD: Final = mask_spec("road", "road")


def paper(found: Findings) -> Iterator[Block]:
    """Show rates over the drive as the paper does, and figures 2, 3a and 3b."""
    yield Heading("Over the drive: the paper's tables and figures")
    if len(found.windows):
        yield from _rows(found)
    if found.examples:
        yield Strip(list(example_pictures(found.examples)), len(found.examples[0].masks) + 2)
        yield Text("The paper's figure 2: input and output images, and the truth.", "note")
    if len(found.windows):
        name = str(found.summary["drive"]["name"])
        for draw, caption in (
            (error_rate, "The paper's figure 3a: error rate."),
            (fp_fn_rate, "The paper's figure 3b: false positive and false negative error rates."),
        ):
            yield Figure(plots.vector(lambda draw=draw: draw(name, found.windows)), caption)  # type: ignore[misc]


def _rows(found: Findings) -> Iterator[Block]:
    """Tabulate the rows; several tables where the variants do not fit side by side."""
    names = [*found.finals]
    together = len(names) <= SIDE_BY_SIDE
    for rates in [PAPERS] if together else [(rate,) for rate in PAPERS]:
        yield _row_table(found, names, rates)
    long = "" if found.rows == PAPER_ROW else f" The paper's rows are of {PAPER_ROW}."
    yield Text(
        f"Rows of {found.rows} evaluated frames: the mean of the frames' rates in percent.{long} "
        "The last line is the mean over all evaluated frames.",
        "note",
    )


def _row_table(found: Findings, names: list[str], rates: tuple[str, ...]) -> Table:
    told = {
        (row["variant"], row["stage"], row["window"]): row
        for row in found.windows.to_dict("records")
    }
    spans = found.windows.drop_duplicates("window").sort_values("window")
    lines: list[list[Cell | str]] = [
        [
            _span(row["first_frame"], row["last_frame"]),
            *(
                percent(told.get((name, found.finals[name], row["window"]), {}).get(rate))
                for rate in rates
                for name in names
            ),
        ]
        for row in spans.to_dict("records")
    ]
    lines.append(
        [
            Cell("all", bold=True),
            *(Cell(percent(found.total(n)[rate]), bold=True) for rate in rates for n in names),
        ]
    )
    return Table(
        ["<frames", *(_short(name) for _ in rates for name in names)],
        lines,
        breaks=[len(lines) - 1],
        groups=[("", 1), *((f"{rate}, %", len(names)) for rate in rates)],
        small=True,
    )


def _span(first: int, last: int) -> str:
    return str(first) if first == last else f"{first}{DASH}{last}"


def _short(name: str) -> str:
    return {FILTERED: "with", UNFILTERED: "without"}.get(name, name)


def example_pictures(examples: Sequence[Example]) -> Iterator[tuple[str, Asset]]:
    """Paint figure 2: for each frame the image, each variant's mask over it, and the truth."""
    for example in examples:
        yield f"frame {example.frame}", asset(Shot("", example.image))
        for name, mask in example.masks.items():
            yield name, asset(Shot("", example.image, ROAD, mask))
        if example.truth is not None:
            yield "truth", asset(Shot("", example.image, TRUTH, example.truth))


# --- Against each other ---------------------------------------------------------------------------


def against(found: Findings) -> Iterator[Block]:
    """Compare with the filter against without, and every variant with the baseline."""
    filters = [each for each in found.versus if each.control != BASELINE]
    blind = [each for each in found.versus if each.control == BASELINE]
    yield Heading("With the filter against without")
    for each in filters:
        yield from _paired(found, each)
    if not filters:
        yield Text("The two were not both run, so there is nothing to compare.")
    yield from _flicker(found)
    if blind:
        yield Heading("Against a guess that never looks at the image", 2)
        yield _blind(found, blind)
        yield Text(
            f"{BASELINE}: the training frames' mean truth, thresholded at one half. A variant that "
            "does not beat it has learnt nothing from the pixels. Differences are the variant "
            "minus the guess; intervals as above.",
            "note",
        )


def _paired(found: Findings, each: Versus) -> Iterator[Block]:
    yield Table(
        [
            "<rate",
            each.treated,
            each.control,
            "difference, pp",
            "interval, pp",
            "frames",
            "effective",
        ],
        [
            [
                rate,
                *(percent(found.total(name)[rate]) for name in (each.treated, each.control)),
                Cell(points(told["mean"]), bold=True),
                interval(dict(told)),
                number(told["frames"]),
                _effective(told),
            ]
            for rate, told in each.differences.items()
        ],
        caption=(
            f"Paired differences of the final masks, {each.treated} minus {each.control}: percent, "
            "and percentage points with their interval."
        ),
    )
    frames, told = each.frames, each.differences["ERR"]
    if not defined(told["mean"]):
        yield Text("ERR is undefined on every frame, so nothing tells what the filter does to it.")
        return
    yield Text(_method(each), "note")
    yield Text(_shares(each))
    if each.pixels is not None:
        yield Text(_pixels(found, each))
    yield Figure(
        plots.vector(lambda: plots.difference(frames, each.treated, each.control, told)),
        f"ERR of {each.treated} minus {each.control}, frame by frame. Dashed: the mean; grey band: "
        "its interval, where one is given.",
    )


def _flicker(found: Findings) -> Iterator[Block]:
    """Tabulate how much of each final mask changes from frame to frame, beside the truth's own."""
    told = {name: each for name, each in found.beyond.items() if defined(each["flicker"])}
    if not told:
        return
    yield Heading("From one frame to the next", 2)
    yield Table(
        ["<final mask", "flicker, %", "the truth's own, %", "beyond it, pp", "pairs of frames"],
        [
            [
                variant_cell(name, [*found.finals]),
                Cell(percent(each["flicker"]), bold=True),
                percent(each["truth_flicker"]),
                points(each["flicker"] - each["truth_flicker"]),
                number(each["pairs"]),
            ]
            for name, each in told.items()
        ],
    )
    yield Text(
        "Flicker: the share of pixels, labelled in both of two frames read one after the other, "
        "whose mask differs. What moves must change, as the truth does; only what goes beyond it "
        "is unrest. Motion is not taken out.",
        "note",
    )


def _effective(told: Mapping[str, Any]) -> str:
    frames = told["effective_frames"]
    return DASH if frames is None else f"{frames:.0f}"


def _method(each: Versus) -> str:
    told = each.differences["ERR"]
    if told["low"] is None:
        return f"No interval for ERR: {told['reason']}. It would claim more than these frames know."
    how = told.get("method") or told.get("reason")
    return (
        f"{100 * told['confidence']:.0f} % intervals ({how}). Neighbouring frames resemble each "
        "other; effective says how many independent ones they are worth. All of this concerns "
        "this drive only."
    )


def _shares(each: Versus) -> str:
    change = each.frames["ERR"].dropna()
    better, worse = int((change < 0).sum()), int((change > 0).sum())
    same = len(change) - better - worse
    count = max(len(change), 1)
    parts = [
        f"lowers ERR on {better} frames ({100 * better / count:.0f} %)",
        f"raises it on {worse} ({100 * worse / count:.0f} %)",
        *([f"leaves it on {same} ({100 * same / count:.0f} %)"] if same else []),
    ]
    return f"Of {len(change)} frames the filter {listing(parts)}."


def _pixels(found: Findings, each: Versus) -> str:
    assert each.pixels is not None
    right, wrong, labelled = each.pixels
    net = int(each.frames["wrong"].sum())
    change = f"{number(abs(net))} {'more' if net > 0 else 'fewer'} wrong pixels in all"
    return (
        f"Of the labelled pixels of {counted(found)}, {percent(right / labelled)} % are "
        f"newly right with the filter and {percent(wrong / labelled)} % newly wrong; over all "
        f"frames that leaves {change}."
    )


def _blind(found: Findings, blind: list[Versus]) -> Table:
    names = [*found.finals]
    return Table(
        ["<final mask", "ERR", "difference, pp", "interval, pp", "frames better", "frames worse"],
        [
            [
                variant_cell(each.treated, names),
                percent(found.total(each.treated)["ERR"]),
                Cell(points(each.differences["ERR"]["mean"]), bold=True),
                interval(dict(each.differences["ERR"])),
                number(int((each.frames["ERR"] < 0).sum())),
                number(int((each.frames["ERR"] > 0).sum())),
            ]
            for each in blind
        ],
    )

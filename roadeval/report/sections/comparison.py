"""A comparison for people: as a document with figures, and as Markdown for a pull request."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

from roadeval.report.blocks import Block, Cell, Document, Figure, Heading, Points, Table, Text
from roadeval.report.figures.comparison import forest, levels
from roadeval.report.figures.plots import vector
from roadeval.report.figures.rates import error_rate
from roadeval.report.words import defined, interval, listing, moment, number, percent, points

if TYPE_CHECKING:
    import pandas as pd

Content = Mapping[str, Any]
"""As `roadeval.evaluation.comparison.compare` gives it."""
RATES: Final = ("ERR", "FPR", "FNR")
WORDS: Final = (
    "Percent over the frames that both evaluated; differences are new minus base, in percentage "
    "points."
)


def headline(content: Content) -> str:
    """Say in a sentence what came out."""
    if not content["same_drive"]:
        return "Different drives, side by side: no difference is given."
    base = content["results"][0]["label"]
    told = [_told(change) for change in content["changes"] if change["final"]]
    return f"Against {base}: {'; '.join(told)}."


def document(content: Content, windows: pd.DataFrame) -> Document:
    """Write a comparison as a document.

    Parameters
    ----------
    content
        The comparison.
    windows
        The rows over the drive, with each result as a variant; may be empty.
    """
    labels = [each["label"] for each in content["results"]]
    return Document(
        kicker="roadeval comparison",
        title=" and ".join(filter(None, [", ".join(labels[:-1]), labels[-1]])),
        subtitle="; ".join(_result(each) for each in content["results"]),
        footer=f"comparison of {listing(labels)}",
        blocks=list(_blocks(content, windows)),
        keywords=["road recognition", "comparison"],
    )


def markdown(content: Content) -> str:
    """Write a comparison as Markdown."""
    lines = ["# roadeval comparison", "", _escaped(headline(content)), ""]
    lines += [
        f"- {'**FAIL**' if condition['holds'] else 'ok'}: {_escaped(condition['sentence'])}"
        for condition in content["conditions"]
    ]
    lines += ["", *_markdown_table(changes(content)), ""]
    if content["moved"]:
        lines += ["Frames that changed most:", "", *_markdown_table(moved(content)), ""]
    lines += [f"- {_escaped(warning)}" for warning in content["warnings"]]
    lines += ["", WORDS if content["same_drive"] else "Percent over each result's own frames."]
    return "\n".join(lines).rstrip() + "\n"


def changes(content: Content) -> Table:
    """Tabulate every result, variant and stage: the rates, and what changed."""
    if not content["same_drive"]:
        return _levels(content)
    names, rows = _names(content["changes"]), content["changes"]
    return Table(
        [*names, "<stage", "base", "new", "difference", "interval", "FPR", "FNR"],
        [
            [
                *(change[name.removeprefix("<")] for name in names),
                change["stage"],
                percent(change["base"]["ERR"]),
                percent(change["new"]["ERR"]),
                Cell(points(change["difference"]["ERR"]["mean"]), bold=change["final"]),
                interval(change["difference"]["ERR"]),
                *(points(change["new"][r] - change["base"][r]) for r in ("FPR", "FNR")),
            ]
            for change in rows
        ],
        breaks=_breaks(rows),
        groups=[("", len(names) + 1), ("ERR", 4), ("difference", 2)],
        small=True,
    )


def moved(content: Content) -> Table:
    """Tabulate the frames whose error rate changed most."""
    names = _names(content["moved"])
    return Table(
        [*names, "frame", "<stamp", "ERR base", "new", "difference"],
        [
            [
                *(row[name.removeprefix("<")] for name in names),
                str(row["frame"]),
                moment(row["stamp_ns"]),
                percent(row["base"]),
                percent(row["new"]),
                Cell(points(row["change"]), bold=True),
            ]
            for row in content["moved"]
        ],
        breaks=_breaks(content["moved"]),
        small=True,
    )


def _levels(content: Content) -> Table:
    rows = content["changes"]
    return Table(
        ["<result", "<variant", "<stage", "frames", *RATES, "IoU"],
        [
            [
                change["result"],
                change["variant"],
                change["stage"],
                number(change["frames"]),
                *(percent(change["new"][rate]) for rate in (*RATES, "IoU")),
            ]
            for change in rows
        ],
        breaks=_breaks(rows),
        small=True,
    )


def _names(rows: Sequence[Content]) -> tuple[str, ...]:
    """Give the columns that name a row: the result's, unless the variants are the results."""
    alone = all(row["result"] == row["variant"] for row in rows)
    return ("<variant",) if alone else ("<result", "<variant")


def _breaks(rows: Sequence[Content]) -> list[int]:
    """Find the rows at which another result begins."""
    return [
        place
        for place, (above, row) in enumerate(pairwise(rows), 1)
        if above["result"] != row["result"]
    ]


def _blocks(content: Content, windows: pd.DataFrame) -> Iterator[Block]:
    yield Heading("What changed")
    yield Text(headline(content), "verdict")
    failed = [each["sentence"] for each in content["conditions"] if each["holds"]]
    kept = [each["sentence"] for each in content["conditions"] if not each["holds"]]
    if failed:
        yield Points("Limits exceeded", failed, "warning")
    if kept:
        yield Points("Limits kept", kept)
    yield changes(content)
    yield Text(WORDS if content["same_drive"] else "Percent over each result's own frames.", "note")
    yield from _reasons(content)
    if content["warnings"]:
        yield Points("Beware", content["warnings"], "warning")
    finals = [change for change in content["changes"] if change["final"]]
    if not content["same_drive"]:
        yield Figure(vector(lambda: levels(finals)), "Rates of the final masks.")
    else:
        yield Figure(
            vector(lambda: forest(finals)),
            "Change of the final mask's rates against the base; bars are intervals, where given.",
        )
        yield Heading("Over the drive", 2)
        yield Figure(vector(lambda: error_rate("the common frames", windows)), "")
    if content["moved"]:
        yield Heading("Frames that changed most", 2)
        yield moved(content)


def _reasons(content: Content) -> Iterator[Block]:
    """Say why there is no interval, once for each reason."""
    reasons = dict.fromkeys(
        f"{_name(change)}: no interval for ERR, because {told['reason']}."
        for change in content["changes"]
        if change["final"] and (told := change["difference"].get("ERR"))
        if told["low"] is None
    )
    yield from (Text(reason, "note") for reason in reasons)


def _told(change: Content) -> str:
    told = change["difference"]["ERR"]
    name = _name(change)
    if not defined(told["mean"]):
        return f"{name}: ERR undefined"
    if told["low"] == told["high"] == 0:
        return f"{name}: ERR the same on every frame"
    sure = "no interval" if told["low"] is None else f"{interval(told)}"
    return f"{name}: ERR {points(told['mean'])} pp ({sure})"


def _name(change: Content) -> str:
    same = change["result"] == change["variant"]
    return str(change["result"]) if same else f"{change['result']}, {change['variant']}"


def _result(result: Content) -> str:
    return f"{result['label']}: {result['frames']} frames of {result['drive']}"


def _markdown_table(table: Table) -> list[str]:
    heads = [title.removeprefix("<") for title in table.columns]
    sides = ["---" if title.startswith("<") else "---:" for title in table.columns]
    rows: Sequence[Sequence[str]] = [
        [_escaped(cell.text if isinstance(cell, Cell) else cell) for cell in row]
        for row in table.rows
    ]
    return [f"| {' | '.join(cells)} |" for cells in (heads, sides, *rows)]


def _escaped(text: str) -> str:
    """Keep what a path or a name holds from being taken for Markdown."""
    return "".join(f"\\{letter}" if letter in "\\`*_[]<>|#" else letter for letter in text)

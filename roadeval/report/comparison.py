"""The report of a comparison: as a document with figures, and as Markdown for a pull request."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

from roadeval.report.blocks import Block, BulletList, Cell, Document, Figure, Heading, Table, Text
from roadeval.report.figures.charts import forest, levels
from roadeval.report.figures.fig3a_error_rate import FIGURE
from roadeval.report.figures.figure import FigureData
from roadeval.report.figures.files import svg, svg_of
from roadeval.report.markdown import escaped
from roadeval.report.markdown import table as markdown_table
from roadeval.report.words import defined, interval, listing, number, percent, points, timestamp

if TYPE_CHECKING:
    import pandas as pd

Content = Mapping[str, Any]
"""As `roadeval.evaluation.comparison.compare` returns it; or a row of it."""
RATES: Final = ("ERR", "FPR", "FNR")


def headline(content: Content) -> str:
    """Return the result in a sentence."""
    if not content["same_drive"]:
        return "Different drives, side by side: no difference is given."
    base = content["results"][0]["label"]
    changes = [_change(row) for row in content["changes"] if row["final"]]
    return f"Against {base}: {'; '.join(changes)}."


def document(content: Content, windows: pd.DataFrame) -> Document:
    """Return a comparison as a document.

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
        title=listing(labels),
        subtitle="; ".join(
            f"{each['label']}: {each['frames']} frames of {each['drive']}"
            for each in content["results"]
        ),
        footer=f"comparison of {listing(labels)}",
        blocks=list(_blocks(content, windows)),
        keywords=["road recognition", "comparison"],
    )


def markdown(content: Content) -> str:
    """Return a comparison as Markdown."""
    lines = ["# roadeval comparison", "", escaped(headline(content)), ""]
    lines += [
        f"- {'**FAIL**' if condition['holds'] else 'ok'}: {escaped(condition['sentence'])}"
        for condition in content["conditions"]
    ]
    lines += ["", *markdown_table(_rates_table(content)), ""]
    if content["moved"]:
        lines += ["Frames that changed most:", "", *markdown_table(_moved_table(content)), ""]
    lines += [f"- {escaped(warning)}" for warning in content["warnings"]]
    lines += ["", _unit(content)]
    return "\n".join(lines).rstrip() + "\n"


def _blocks(content: Content, windows: pd.DataFrame) -> Iterator[Block]:
    yield Heading("What changed")
    yield Text(headline(content), "verdict")
    yield from _conditions(content["conditions"])
    yield _rates_table(content)
    yield Text(_unit(content), "note")
    yield from _why_no_interval(content["changes"])
    if content["warnings"]:
        yield BulletList("Beware", content["warnings"], "warning")
    finals = [row for row in content["changes"] if row["final"]]
    if content["same_drive"]:
        yield Figure(
            svg(lambda: forest(finals)),
            "Change of the final mask's rates against the base; bars are intervals, where given.",
        )
        yield Heading("Over the drive", 2)
        if picture := svg_of(FIGURE, FigureData("the common frames", windows)):
            yield Figure(picture, "")
    else:
        yield Figure(svg(lambda: levels(finals)), "Rates of the final masks.")
    if content["moved"]:
        yield Heading("Frames that changed most", 2)
        yield _moved_table(content)


def _conditions(conditions: Sequence[Content]) -> Iterator[Block]:
    failed = [each["sentence"] for each in conditions if each["holds"]]
    kept = [each["sentence"] for each in conditions if not each["holds"]]
    if failed:
        yield BulletList("Limits exceeded", failed, "warning")
    if kept:
        yield BulletList("Limits kept", kept)


def _unit(content: Content) -> str:
    if not content["same_drive"]:
        return "Percent over each result's own frames."
    return (
        "Percent over the frames that both evaluated; differences are new minus base, in "
        "percentage points."
    )


# --- Tables ---------------------------------------------------------------------------------------


def _rates_table(content: Content) -> Table:
    """Tabulate the rates of every result, variant and stage, and on one drive their changes."""
    rows = content["changes"]
    return _changes_table(rows) if content["same_drive"] else _levels_table(rows)


def _changes_table(rows: Sequence[Content]) -> Table:
    names = _naming_columns(rows)
    return Table(
        [*names, "stage", "base", "new", "difference", "interval", "FPR", "FNR"],
        [
            [
                *(row[name] for name in names),
                row["stage"],
                percent(row["base"]["ERR"]),
                percent(row["new"]["ERR"]),
                Cell(points(row["difference"]["ERR"]["mean"]), bold=row["final"]),
                interval(row["difference"]["ERR"]),
                *(points(row["new"][rate] - row["base"][rate]) for rate in ("FPR", "FNR")),
            ]
            for row in rows
        ],
        text_columns=range(len(names) + 1),
        breaks=_breaks(rows),
        groups=[("", len(names) + 1), ("ERR", 4), ("difference", 2)],
        small=True,
    )


def _levels_table(rows: Sequence[Content]) -> Table:
    names, rates = ("result", "variant", "stage"), (*RATES, "IoU")
    return Table(
        [*names, "frames", *rates],
        [
            [
                *(row[name] for name in names),
                number(row["frames"]),
                *(percent(row["new"][rate]) for rate in rates),
            ]
            for row in rows
        ],
        text_columns=range(len(names)),
        breaks=_breaks(rows),
        small=True,
    )


def _moved_table(content: Content) -> Table:
    """Tabulate the frames whose error rate changed most."""
    rows = content["moved"]
    names = _naming_columns(rows)
    return Table(
        [*names, "frame", "stamp", "ERR base", "new", "difference"],
        [
            [
                *(row[name] for name in names),
                str(row["frame"]),
                timestamp(row["stamp_ns"]),
                percent(row["base"]),
                percent(row["new"]),
                Cell(points(row["change"]), bold=True),
            ]
            for row in rows
        ],
        text_columns=[*range(len(names)), len(names) + 1],
        breaks=_breaks(rows),
        small=True,
    )


def _naming_columns(rows: Sequence[Content]) -> tuple[str, ...]:
    """Return the columns that name a row; without the result's, where the variants are that."""
    alone = all(row["result"] == row["variant"] for row in rows)
    return ("variant",) if alone else ("result", "variant")


def _breaks(rows: Sequence[Content]) -> list[int]:
    """Return the rows at which another result begins."""
    return [
        place
        for place, (above, row) in enumerate(pairwise(rows), 1)
        if above["result"] != row["result"]
    ]


# --- Sentences ------------------------------------------------------------------------------------


def _why_no_interval(rows: Sequence[Content]) -> Iterator[Text]:
    """Yield the reason why there is no interval, once for each result and variant."""
    reasons = [
        f"{_name(row)}: no interval for ERR, because {change['reason']}."
        for row in rows
        if row["final"] and (change := row["difference"].get("ERR")) and change["low"] is None
    ]
    yield from (Text(reason, "note") for reason in dict.fromkeys(reasons))


def _change(row: Content) -> str:
    change, name = row["difference"]["ERR"], _name(row)
    if not defined(change["mean"]):
        return f"{name}: ERR undefined"
    if change["low"] == change["high"] == 0:
        return f"{name}: ERR the same on every frame"
    sure = "no interval" if change["low"] is None else interval(change)
    return f"{name}: ERR {points(change['mean'])} pp ({sure})"


def _name(row: Content) -> str:
    same = row["result"] == row["variant"]
    return str(row["result"]) if same else f"{row['result']}, {row['variant']}"

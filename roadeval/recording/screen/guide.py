"""Texts in the viewer: a guide to what it shows, and an overview of the results."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from roadeval.data import VariantLayout
from roadeval.data.words import percent
from roadeval.evaluation.metrics import SHORT
from roadeval.recording.layout import Layout
from roadeval.runtime.text import as_markdown

_ERRORS: Final = """\
**Errors:** *green* road found, *orange* non-road called road (FP), *purple* road missed (FN),
*grey* ignored.
"""
_ROWS: Final = """\
**Rows:** a variant each, its phases from left to right; *green* is what a phase calls road.
"""
_CURVES: Final = """\
**Curves:** rates of the final masks; *blind*, the training frames' mean truth, never looks at the
image.
"""
_NO_TRUTH: Final = """\
The log has no truth for the road: there is nothing to score, only what was computed.
"""
_RATES: Final = "In percent: means of the frames' rates; *pooled*: of all pixels."
_QUOTED: Final = "In percent, of all pixels; the threshold is the one of MaxF."
_HANDLING: Final = """\
**Space** plays. The tabs above hold every layer, every number and the results.
"""


def text(layout: Layout, verdict: str = "") -> str:
    """Return the guide to the first tab, after the verdict on the drive if there is one yet."""
    parts = [_ERRORS, _ROWS, _CURVES] if layout.has_truth else [_NO_TRUTH, _ROWS]
    return "\n".join(
        [f"### {as_markdown(layout.drive)}", "", as_markdown(verdict), "", *parts, _HANDLING]
    )


def variant(layout: VariantLayout) -> str:
    """Return the introduction of a variant."""
    # A heading would break the name in a column as narrow as this one.
    return f"**{as_markdown(layout.name)}**\n\n{as_markdown(layout.title)}\n"


def overview(layout: Layout, summary: Mapping[str, Any]) -> str:
    """Return the results for people, from the content of ``summary.json``."""
    return "\n".join(
        [
            f"# {as_markdown(layout.drive)}",
            *("", as_markdown(str(summary.get("verdict", "")))),
            *_list("Warnings", summary.get("warnings", ())),
            *_list("Lost", summary.get("losses", ())),
            *_table(summary.get("totals", {})),
            *_curves(summary.get("curves", {})),
            *_list("Frames", _accounts(summary.get("frames", {}))),
            *_list("Provenance", (f"{k}: {v}" for k, v in layout.properties.items())),
            "",
        ]
    )


def _table(totals: Mapping[str, Any]) -> Iterator[str]:
    rows = [
        (variant, stage, total)
        for variant, stages in totals.items()
        for stage, total in stages.items()
    ]
    titles = {name: name for name in SHORT} | {"pooled_ERR": "pooled ERR"}
    if rows:
        yield from ("", "## Rates", "", _RATES, "")
        yield f"| {' | '.join(['variant', 'stage', *titles.values()])} |"
        yield f"|---|---|{'---|' * len(titles)}"
    for variant, stage, total in rows:
        cells = (percent(total.get(name)) for name in titles)
        yield f"| {' | '.join([as_markdown(variant), stage, *cells])} |"


def _curves(curves: Mapping[str, Any]) -> Iterator[str]:
    """Yield what is quoted of curves over thresholds; the curves' counts are a table beside."""
    rows = [
        (variant, stage, own) for variant, stages in curves.items() for stage, own in stages.items()
    ]
    names = ("AP", "AUC", "MaxF", "threshold", "ECE")
    if rows:
        yield from ("", "## Over thresholds", "", _QUOTED, "")
        yield f"| {' | '.join(['variant', 'stage', *names])} |"
        yield f"|---|---|{'---|' * len(names)}"
    for variant, stage, own in rows:
        cells = (percent(own.get(name)) for name in names)
        yield f"| {' | '.join([as_markdown(variant), stage, *cells])} |"


def _accounts(frames: Mapping[str, Any]) -> Iterator[str]:
    for name, count in frames.items():
        if isinstance(count, Mapping):
            yield from (f"{name}, {reason}: {n}" for reason, n in count.items())
        else:
            yield f"{name}: {count}".replace("_", " ")


def _list(title: str, items: Any) -> list[str]:
    lines = [f"- {as_markdown(item)}" for item in items]
    return ["", f"## {title}", "", *lines] if lines else []

"""Static data of a recording, logged once, whatever the frames: colours, names, documents."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from itertools import cycle
from typing import Any, Final

import rerun as rr

from roadeval.data import BASELINE, FILTERED, UNFILTERED, Health, Role, colours
from roadeval.data.colours import Colour
from roadeval.data.words import percent
from roadeval.evaluation.metrics import SHORT
from roadeval.recording import layout as at
from roadeval.recording.codecs import Codec
from roadeval.recording.layout import Layout
from roadeval.runtime.text import as_markdown

StaticData = Iterator[tuple[str, list[Any]]]
"""Entity paths, and the archetypes to log there."""

_VARIANTS: Final[Mapping[str, Colour]] = {
    FILTERED: colours.FILTERED,
    UNFILTERED: colours.UNFILTERED,
    BASELINE: colours.BLIND,
}
_STAGES: Final = (colours.ORANGE, *colours.EXTRA)
_STATES: Final[Mapping[str, Colour]] = {
    Health.OK: colours.GREEN,
    Health.DEGRADED: colours.ORANGE,
    Health.FAILED: colours.VERMILLION,
    Role.EVALUATED: colours.SKY_BLUE,
    Role.TRAINING: colours.PURPLE,
    Role.COPY: colours.YELLOW,
    Role.GAP: colours.DARK_GREY,
    Role.UNLABELLED: colours.GREY,
}
_COUNTS: Final[Mapping[str, Colour]] = {
    "TP": colours.TP,
    "TN": colours.TN,
    "FP": colours.FP,
    "FN": colours.FN,
    "N": colours.GREY,
}
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
_SHOWN: Final = {name: name for name in SHORT} | {"pooled_ERR": "pooled ERR"}
_OF_CURVES: Final = {name: name for name in ("AP", "AUC", "MaxF", "threshold", "ECE")}
_QUOTED: Final = "In percent, of all pixels; the threshold is the one of MaxF."
_HANDLING: Final = """\
**Space** plays. The tabs above hold every layer, every number and the results.
"""


def before_the_first_frame(layout: Layout, codecs: Mapping[str, Codec]) -> StaticData:
    """Yield what is known before the first frame."""
    for path, codec in codecs.items():
        yield path, list(codec.style())
    yield at.LAYOUT, [rr.TextDocument(layout.to_json())]
    yield at.GUIDE, [_markdown(guide(layout))]
    for variant in layout.variants:
        # A heading would break the name in a column as narrow as this one.
        words = f"**{as_markdown(variant.name)}**\n\n{as_markdown(variant.title)}\n"
        yield at.guide_path(variant.name), [_markdown(words)]
    yield at.PROPERTIES, [rr.AnyValues(format=at.FORMAT, **layout.properties)]
    for name, header in layout.tables.items():
        yield at.result_path(name), [rr.AnyValues(header=header.rstrip())]
    lanes: dict[str, tuple[str, ...]] = {at.ROLE: tuple(Role)}
    lanes |= {at.state_path(variant.name): tuple(Health) for variant in layout.variants}
    for path, states in lanes.items():
        colours = [_STATES[state] for state in states]
        yield path, [rr.StateConfiguration(values=states, colors=colours)]
    yield from _lines(layout)


def _lines(layout: Layout) -> StaticData:
    """Yield names and colours of the graphs of rates and counts."""
    extra = cycle(colours.EXTRA)
    names = [*(variant.name for variant in layout.variants), BASELINE]
    variants = {name: _VARIANTS.get(name) or next(extra) for name in names}
    counts = rr.SeriesLines(names=list(_COUNTS), colors=list(_COUNTS.values()))
    for variant, stage in layout.scored():
        for rate in layout.rates:
            line = _line(variant, variants[variant])
            yield at.scalar_path("metrics", variant, stage, rate), [line]
        yield at.scalar_path("counts", variant, stage), [counts]


def timing_lines(paths: Iterable[str]) -> StaticData:
    """Yield the colours of every stage that is timed, in the order in which they run."""
    stages: dict[str, Colour] = {}
    for path in paths:
        if path.startswith("/timing/"):
            stage = path.rpartition("/")[2]
            colour = stages.setdefault(stage, _STAGES[len(stages) % len(_STAGES)])
            yield path, [_line(stage, colour)]


def after_the_last_frame(layout: Layout, texts: Mapping[str, str]) -> StaticData:
    """Yield what is known after the last frame.

    The seconds that a run took are kept apart from its summary, among the timing: everything
    else is the same when the same log is replayed again.
    """
    summary = json.loads(texts.get(at.SUMMARY, "{}"))
    yield at.GUIDE, [_markdown(guide(layout, str(summary.get("verdict", ""))))]
    yield at.result_path(at.OVERVIEW), [_markdown(overview(layout, summary))]
    yield at.SECONDS, [rr.TextDocument(json.dumps(summary.pop("seconds", {})))]
    kept = {at.SUMMARY: json.dumps(summary, indent=2)} if summary else {}
    for name, text in {**texts, **kept}.items():
        yield at.result_path(name), [rr.TextDocument(text)]


def _markdown(text: str) -> rr.TextDocument:
    return rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)


def _line(name: str, colour: Colour) -> rr.SeriesLines:
    return rr.SeriesLines(names=name, colors=colour, widths=2.0)


# --- Texts ----------------------------------------------------------------------------------------


def guide(layout: Layout, verdict: str = "") -> str:
    """Return the guide to the first tab, after the verdict on the drive if there is one yet."""
    parts = [_ERRORS, _ROWS, _CURVES] if layout.has_truth else [_NO_TRUTH, _ROWS]
    return "\n".join(
        [f"### {as_markdown(layout.drive)}", "", as_markdown(verdict), "", *parts, _HANDLING]
    )


def overview(layout: Layout, summary: Mapping[str, Any]) -> str:
    """Return the results for people, from the content of ``summary.json``."""
    return "\n".join(
        [
            f"# {as_markdown(layout.drive)}",
            *("", as_markdown(str(summary.get("verdict", "")))),
            *_list("Warnings", summary.get("warnings", ())),
            *_list("Lost", summary.get("losses", ())),
            *_table("Rates", _RATES, _SHOWN, summary.get("totals", {})),
            *_table("Over thresholds", _QUOTED, _OF_CURVES, summary.get("curves", {})),
            *_list("Frames", _accounts(summary.get("frames", {}))),
            *_list("Provenance", (f"{k}: {v}" for k, v in layout.properties.items())),
            "",
        ]
    )


def _table(
    title: str, note: str, columns: Mapping[str, str], found: Mapping[str, Any]
) -> Iterator[str]:
    """Yield a table in percent, a row a variant and stage; nothing where there is none."""
    if found:
        yield from ("", f"## {title}", "", note, "")
        yield f"| variant | stage | {' | '.join(columns.values())} |"
        yield f"|---|---|{'---|' * len(columns)}"
    for variant, stages in found.items():
        for stage, own in stages.items():
            cells = " | ".join(percent(own.get(name)) for name in columns)
            yield f"| {as_markdown(variant)} | {stage} | {cells} |"


def _accounts(frames: Mapping[str, Any]) -> Iterator[str]:
    for name, count in frames.items():
        if isinstance(count, Mapping):
            yield from (f"{name}, {reason}: {n}" for reason, n in count.items())
        else:
            yield f"{name}: {count}".replace("_", " ")


def _list(title: str, items: Iterable[Any]) -> list[str]:
    lines = [f"- {as_markdown(item)}" for item in items]
    return ["", f"## {title}", "", *lines] if lines else []

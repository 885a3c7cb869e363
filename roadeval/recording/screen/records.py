"""What stands in a recording once, whatever the frames: colours, names, documents."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final

import rerun as rr

from roadeval.data import BASELINE, FILTERED, UNFILTERED, Health, Role
from roadeval.recording import layout as at
from roadeval.recording.codecs import Codec
from roadeval.recording.layout import Layout
from roadeval.recording.screen import guide

Records = Iterator[tuple[str, list[Any]]]
"""Entity paths, and the archetypes to log there."""
Rgb = tuple[int, int, int]

_KNOWN: Final[Mapping[str, Rgb]] = {
    FILTERED: (0, 114, 178),
    UNFILTERED: (230, 159, 0),
    BASELINE: (153, 153, 153),
}
_FURTHER: Final[tuple[Rgb, ...]] = (
    (0, 158, 115),
    (204, 121, 167),
    (86, 180, 233),
    (213, 94, 0),
    (240, 228, 66),
)
"""Okabe and Ito's colours, safe for the colour-blind, in the order in which they are given out."""
_STAGES: Final = (_KNOWN[UNFILTERED], *_FURTHER)
_LANES: Final[Mapping[str, Rgb]] = {
    Health.OK: (0, 158, 115),
    Health.DEGRADED: (230, 159, 0),
    Health.FAILED: (213, 94, 0),
    Role.EVALUATED: (86, 180, 233),
    Role.TRAINING: (204, 121, 167),
    Role.GAP: (90, 90, 90),
    Role.UNLABELLED: (153, 153, 153),
}
_OUTCOMES: Final[Mapping[str, Rgb]] = {
    "TP": (0, 158, 115),
    "TN": (86, 180, 233),
    "FP": (213, 94, 0),
    "FN": (204, 121, 167),
    "N": (153, 153, 153),
}


def _colours(layout: Layout) -> dict[str, Rgb]:
    """Give every variant, the baseline included, its colour."""
    further = (_FURTHER[i % len(_FURTHER)] for i in range(len(layout.variants)))
    names = [variant.name for variant in layout.variants]
    return {name: _KNOWN.get(name) or next(further) for name in (*names, BASELINE)}


def records(layout: Layout, codecs: Mapping[str, Codec]) -> Records:
    """Yield what is known before the first frame."""
    for path, codec in codecs.items():
        yield path, list(codec.style())
    yield at.LAYOUT, [rr.TextDocument(layout.to_json())]
    yield at.GUIDE, [_markdown(guide.text(layout))]
    for variant in layout.variants:
        yield at.guide_path(variant.name), [_markdown(guide.variant(variant))]
    yield at.PROPERTIES, [rr.AnyValues(format=at.FORMAT, **layout.properties)]
    for name, header in layout.tables.items():
        yield at.result_path(name), [rr.AnyValues(header=header.rstrip())]
    yield from _lanes(layout)
    yield from _lines(layout)


def timing(paths: Iterable[str]) -> Records:
    """Yield the colours of every stage that is timed, in the order in which they run."""
    stages: dict[str, Rgb] = {}
    for path in paths:
        if path.startswith("/timing/"):
            stage = path.rpartition("/")[2]
            colour = stages.setdefault(stage, _STAGES[len(stages) % len(_STAGES)])
            yield path, [_line(stage, colour)]


def results(layout: Layout, texts: Mapping[str, str]) -> Records:
    """Yield what is known after the last frame.

    The seconds that a run took are kept apart from its summary, among the timing: everything
    else is the same when the same log is replayed again.
    """
    summary = json.loads(texts.get(at.SUMMARY, "{}"))
    verdict = str(summary.get("verdict", ""))
    yield at.GUIDE, [_markdown(guide.text(layout, verdict))]
    yield at.result_path(at.OVERVIEW), [_markdown(guide.overview(layout, summary))]
    yield at.SECONDS, [rr.TextDocument(json.dumps(summary.pop("seconds", {})))]
    kept = {at.SUMMARY: json.dumps(summary, indent=2)} if summary else {}
    for name, text in {**texts, **kept}.items():
        yield at.result_path(name), [rr.TextDocument(text)]


def _markdown(text: str) -> rr.TextDocument:
    return rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)


def _lanes(layout: Layout) -> Records:
    lanes: dict[str, tuple[str, ...]] = {at.ROLE: tuple(Role)}
    lanes |= {at.state_path(variant.name): tuple(Health) for variant in layout.variants}
    for path, states in lanes.items():
        colours = [_LANES[state] for state in states]
        yield path, [rr.StateConfiguration(values=states, colors=colours)]


def _lines(layout: Layout) -> Records:
    colours = _colours(layout)
    lines = rr.SeriesLines(names=list(_OUTCOMES), colors=list(_OUTCOMES.values()))
    for variant, stage in layout.scored():
        for rate in layout.rates:
            line = _line(variant, colours[variant])
            yield at.scalar_path("metrics", variant, stage, rate), [line]
        yield at.scalar_path("counts", variant, stage), [lines]


def _line(name: str, colour: Rgb) -> rr.SeriesLines:
    return rr.SeriesLines(names=name, colors=colour, widths=2.0)

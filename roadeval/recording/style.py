"""What stands in a recording once, whatever the frames: colours, names, documents."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

import rerun as rr

from roadeval.data import BASELINE, FILTERED, FINAL_STAGE, UNFILTERED, Health, Role
from roadeval.recording import guide
from roadeval.recording import layout as at
from roadeval.recording.codecs import Codec
from roadeval.recording.layout import Layout

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
_STAGES: Final[tuple[Rgb, ...]] = (
    (86, 180, 233),
    (0, 158, 115),
    (230, 159, 0),
    (204, 121, 167),
    (240, 228, 66),
)
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


def colours(layout: Layout) -> dict[str, Rgb]:
    """Give every variant, the baseline included, its colour."""
    further = (_FURTHER[i % len(_FURTHER)] for i in range(len(layout.variants)))
    names = [variant.name for variant in layout.variants]
    return {**{n: _KNOWN[n] if n in _KNOWN else next(further) for n in names},
            BASELINE: _KNOWN[BASELINE]}


def records(layout: Layout, codecs: Mapping[str, Codec]) -> Records:
    """Yield what is known before the first frame."""
    for path, codec in codecs.items():
        yield path, list(codec.style())
    yield at.LAYOUT, [rr.TextDocument(layout.to_json())]
    yield at.GUIDE, [rr.TextDocument(guide.text(layout), media_type=rr.MediaType.MARKDOWN)]
    yield at.PROPERTIES, [rr.AnyValues(format=at.FORMAT, **layout.properties)]
    for name, header in layout.tables.items():
        yield at.result_path(name), [rr.AnyValues(header=header)]
    yield from _lanes(layout)
    yield from _lines(layout)


def results(texts: Mapping[str, str]) -> Records:
    """Yield what is known after the last frame."""
    for name, text in texts.items():
        kind = rr.MediaType.MARKDOWN if name == at.OVERVIEW else rr.MediaType.TEXT
        yield at.result_path(name), [rr.TextDocument(text, media_type=kind)]


def _lanes(layout: Layout) -> Records:
    for path, values in (
        (at.ROLE, list(Role)),
        *((at.state_path(v.name), list(Health)) for v in layout.variants),
    ):
        yield path, [rr.StateConfiguration(values=values, colors=[_LANES[v] for v in values])]


def _lines(layout: Layout) -> Records:
    colour = colours(layout)
    stages = [(v.name, s) for v in layout.variants for s in v.stages]
    scored = stages + [(BASELINE, FINAL_STAGE)] * layout.baseline
    for variant, stage in scored if layout.has_truth else ():
        for rate in layout.rates:
            yield at.scalar_path("metrics", variant, stage, rate), [_line(variant, colour[variant])]
        lines = rr.SeriesLines(names=list(_OUTCOMES), colors=list(_OUTCOMES.values()))
        yield at.scalar_path("counts", variant, stage), [lines]


def _line(name: str, colour: Rgb) -> rr.SeriesLines:
    return rr.SeriesLines(names=name, colors=colour, widths=2.0)

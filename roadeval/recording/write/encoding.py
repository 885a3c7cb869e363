"""A frame's result encoded for the recording: the slow part, which any thread may do."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field

from roadeval.data import (
    BASELINE,
    ERRORS,
    FINAL_STAGE,
    FrameResult,
    Health,
    LayerKind,
)
from roadeval.recording import layout as at
from roadeval.recording.codecs import Codec
from roadeval.recording.layout import Layout


@dataclass(frozen=True, slots=True, eq=False)
class EncodedFrame:
    """A frame ready to be written. Mappings are by entity path, ``tables`` by name."""

    number: int
    stamp_ns: int
    payloads: Mapping[str, bytes]
    """Image files."""
    scalars: Mapping[str, float] = field(default_factory=dict)
    counts: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    states: Mapping[str, str] = field(default_factory=dict)
    """Every state, empty where there is none."""
    notes: tuple[tuple[str, str], ...] = ()
    """Sentences, each with its level."""
    tables: Mapping[str, str] = field(default_factory=dict)
    """Lines of CSV."""
    worst_error: float = -1.0
    """See `worst_error`."""


def encode_frame(
    result: FrameResult,
    lines: Mapping[str, str],
    layout: Layout,
    codecs: Mapping[str, Codec],
    kinds: Collection[LayerKind],
) -> EncodedFrame:
    """Encode a frame, with its lines of the tables by name.

    Of its images only layers of some ``kinds`` are encoded, and without any kind no image at all.
    """
    level = "WARN" if set(result.health.values()) - {Health.OK} else "INFO"
    lanes = {at.state_path(v.name): result.health.get(v.name, "") for v in layout.variants}
    counts = {
        at.scalar_path("counts", tally.variant, tally.stage): tally.counts
        for tally in result.tallies
    }
    return EncodedFrame(
        number=result.frame.number,
        stamp_ns=result.frame.stamp_ns,
        payloads=dict(_payloads(result, codecs, kinds)) if kinds else {},
        scalars=dict(_scalars(result, layout.rates)),
        counts={path: (c.tp, c.tn, c.fp, c.fn, c.n) for path, c in counts.items()},
        states={at.ROLE: result.role.value, **lanes},
        notes=tuple((note, level) for note in result.notes),
        tables=lines,
        worst_error=worst_error(result),
    )


def _payloads(
    result: FrameResult, codecs: Mapping[str, Codec], kinds: Collection[LayerKind]
) -> Iterator[tuple[str, bytes]]:
    frame = result.frame
    if frame.media_type in ("image/jpeg", "image/png"):
        yield at.CAMERA, bytes(frame.payload)
    else:
        yield at.CAMERA, codecs[at.CAMERA].encode(frame.image)
    for path, mask in ((at.TRUTH_PATH, frame.truth), (at.TRUE_SHADOW, frame.shadow_truth)):
        if mask is not None:
            yield path, codecs[path].encode(mask)
    for variant in result.variants:
        for layer in variant.layers():
            if layer.spec.kind in kinds:
                path = at.layer_path(variant.variant, layer.spec.name)
                yield path, codecs[path].encode(layer.content)
    for name, layer in result.errors.items():
        path = at.layer_path(name, ERRORS.name)
        yield path, codecs[path].encode(layer.array)


def _scalars(result: FrameResult, rates: Collection[str]) -> Iterator[tuple[str, float]]:
    for tally in result.tallies:
        for rate, value in tally.rates.items():
            if rate in rates and not math.isnan(value):
                yield at.scalar_path("metrics", tally.variant, tally.stage, rate), value
    for variant in result.variants:
        for stage in variant.stages:
            where = variant.variant, stage.stage
            yield at.scalar_path("timing", *where), stage.seconds * 1e3
            for name, value in stage.output.facts.items():
                yield at.scalar_path("facts", *where, name), value


def worst_error(result: FrameResult) -> float:
    """Return the greatest ERR of any variant's final mask; -1 for a frame not evaluated."""
    finals = (t for t in result.tallies if t.stage == FINAL_STAGE and t.variant != BASELINE)
    return max((t.rates["ERR"] for t in finals), default=-1.0)

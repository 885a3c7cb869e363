"""A frame's result encoded for the recording: the slow part, which any thread may do."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

from roadeval.data import (
    BASELINE,
    ERRORS,
    FINAL_STAGE,
    Frame,
    FrameResult,
    Health,
    LayerKind,
    Tally,
)
from roadeval.recording import layout as at
from roadeval.recording.codecs import codecs_of
from roadeval.recording.layout import Layout

FLAT: Final = (LayerKind.MASK, LayerKind.LABELS)
"""The kinds of layers that `Images.MASKS` keeps."""


class Images(StrEnum):
    """Which of a frame's images are recorded."""

    ALL = "all"
    MASKS = "masks"
    NONE = "none"


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


class FrameEncoder:
    """Encodes the frames of a recording with this layout."""

    def __init__(self, layout: Layout) -> None:
        self.codecs = codecs_of(layout)
        self._rates = frozenset(layout.rates)
        self._lanes = {variant.name: at.state_path(variant.name) for variant in layout.variants}

    def encode(
        self, result: FrameResult, lines: Mapping[str, str], images: Images = Images.ALL
    ) -> EncodedFrame:
        """Encode a frame, with its lines of the tables by name."""
        level = "WARN" if set(result.health.values()) - {Health.OK} else "INFO"
        return EncodedFrame(
            number=result.frame.number,
            stamp_ns=result.frame.stamp_ns,
            payloads={} if images is Images.NONE else dict(self._payloads(result, images)),
            scalars=dict(self._scalars(result)),
            counts={at.scalar_path("counts", t.variant, t.stage): _row(t) for t in result.tallies},
            states={
                at.ROLE: result.role.value,
                **{path: result.health.get(name, "") for name, path in self._lanes.items()},
            },
            notes=tuple((note, level) for note in result.notes),
            tables=lines,
            worst_error=worst_error(result),
        )

    def _payloads(self, result: FrameResult, images: Images) -> Iterator[tuple[str, bytes]]:
        frame = result.frame
        yield at.CAMERA, self._camera_file(frame)
        for path, mask in ((at.TRUTH_PATH, frame.truth), (at.TRUE_SHADOW, frame.shadow_truth)):
            if mask is not None:
                yield path, self.codecs[path].encode(mask)
        for variant in result.variants:
            for layer in variant.layers():
                if images is Images.ALL or layer.spec.kind in FLAT:
                    path = at.layer_path(variant.variant, layer.spec.name)
                    yield path, self.codecs[path].encode(layer.content)
        for name, layer in result.errors.items():
            path = at.layer_path(name, ERRORS.name)
            yield path, self.codecs[path].encode(layer.array)

    def _camera_file(self, frame: Frame) -> bytes:
        """Return the log's own JPEG or PNG file, or a new one for other encodings."""
        if frame.media_type in ("image/jpeg", "image/png"):
            return bytes(frame.payload)
        return self.codecs[at.CAMERA].encode(frame.image)

    def _scalars(self, result: FrameResult) -> Iterator[tuple[str, float]]:
        for tally in result.tallies:
            for rate, value in tally.rates.items():
                if rate in self._rates and not math.isnan(value):
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


def _row(tally: Tally) -> tuple[int, ...]:
    counts = tally.counts
    return counts.tp, counts.tn, counts.fp, counts.fn, counts.n

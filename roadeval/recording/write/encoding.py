"""A frame's result becomes payloads and plain numbers: pure, heavy, safe in any thread."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from roadeval.data import ERRORS, Frame, FrameResult, Health, LayerKind, Pictures, Tally
from roadeval.recording import layout as at
from roadeval.recording.codecs import CameraCodec, Codec, codec
from roadeval.recording.layout import Layout

FLAT: Final = (LayerKind.MASK, LayerKind.LABELS)
"""What `Pictures.MASKS` keeps of the layers: small, and without loss."""


@dataclass(frozen=True, slots=True, eq=False)
class Encoded:
    """A frame ready to be written.

    Every mapping is by entity path, but ``tables`` by name. ``states`` holds the state of every
    lane, empty for none; ``notes`` pairs of a sentence and its level.
    """

    number: int
    stamp_ns: int
    payloads: Mapping[str, bytes]
    scalars: Mapping[str, float]
    counts: Mapping[str, tuple[int, ...]]
    states: Mapping[str, str]
    notes: tuple[tuple[str, str], ...]
    tables: Mapping[str, str]


class Encoder:
    """Encodes the frames of a recording with this layout."""

    def __init__(self, layout: Layout) -> None:
        self._camera = CameraCodec()
        self.codecs: dict[str, Codec] = {
            at.CAMERA: self._camera,
            **{path: codec(spec, layout.width, layout.height) for path, spec in layout.images()},
        }
        self._rates = frozenset(layout.rates)
        self._lanes = {variant.name: at.state_path(variant.name) for variant in layout.variants}

    def __call__(self, result: FrameResult) -> Encoded:
        """Encode one frame."""
        level = "WARN" if set(result.health.values()) - {Health.OK} else "INFO"
        return Encoded(
            number=result.frame.number,
            stamp_ns=result.frame.stamp_ns,
            payloads=dict(self._pictures(result)),
            scalars=dict(self._scalars(result)),
            counts={at.scalar_path("counts", t.variant, t.stage): _row(t) for t in result.tallies},
            states={
                at.ROLE: result.role.value,
                **{path: result.health.get(name, "") for name, path in self._lanes.items()},
            },
            notes=tuple((note, level) for note in result.notes),
            tables=result.tables,
        )

    def _photo(self, frame: Frame) -> bytes:
        """Pass on the camera's own file where the log holds one, so that nothing is lost twice."""
        if frame.media_type in ("image/jpeg", "image/png"):
            return bytes(frame.payload)
        return self._camera.encode(frame.image)

    def _pictures(self, result: FrameResult) -> Iterator[tuple[str, bytes]]:
        if result.pictures is Pictures.NONE:
            return
        yield at.CAMERA, self._photo(result.frame)
        yield from self._layers(result)

    def _layers(self, result: FrameResult) -> Iterator[tuple[str, bytes]]:
        for path, mask in (
            (at.TRUTH_PATH, result.frame.truth),
            (at.TRUE_SHADOW, result.frame.shadow_truth),
        ):
            if mask is not None:
                yield path, self.codecs[path].encode(mask)
        for variant in result.variants:
            for layer in variant.layers():
                if result.pictures is Pictures.MASKS and layer.spec.kind not in FLAT:
                    continue
                path = at.layer_path(variant.variant, layer.spec.name)
                yield path, self.codecs[path].encode(layer.content)
        for name, layer in result.errors.items():
            path = at.layer_path(name, ERRORS.name)
            yield path, self.codecs[path].encode(layer.array)

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


def _row(tally: Tally) -> tuple[int, ...]:
    counts = tally.counts
    return counts.tp, counts.tn, counts.fp, counts.fn, counts.n

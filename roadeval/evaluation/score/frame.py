"""One frame against its truth: counts, rates, error maps, health; and the baseline."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np

from roadeval.data import (
    BASELINE,
    FINAL_STAGE,
    IGNORE,
    ROAD,
    Counts,
    Frame,
    FrameMetres,
    FrameResult,
    Health,
    Histogram,
    Packed,
    Probability,
    Role,
    Tally,
    Truth,
    TruthBits,
    VariantResult,
    histogram,
)
from roadeval.data.arrays import Bits, Values
from roadeval.data.result import Cells
from roadeval.evaluation import metrics, regions
from roadeval.evaluation.metres import ABOVE, survey_of
from roadeval.evaluation.region import LabelledFrame
from roadeval.evaluation.score.counts import Name, contours, count, error_map
from roadeval.evaluation.score.metres import measure
from roadeval.evaluation.score.thresholds import changes
from roadeval.evaluation.score.unlabelled import doubts_of
from roadeval.evaluation.settings import (
    DEGRADED_ERR,
    DEGRADED_MARGIN,
    FAILED_ERR,
    FAILED_FNR,
    EvaluationSettings,
)
from roadeval.geometry.ground import Ground

K = TypeVar("K", str, int)
"""What further masks are of: the stage that was replaced by the truth, or a training's seed."""
Rates = Mapping[str, float]


def score_frame(
    frame: Frame,
    role: Role,
    variants: tuple[VariantResult, ...],
    settings: EvaluationSettings,
    prior: BlindPrior | None,
    *,
    ground: Ground | None = None,
) -> FrameResult:
    """Score one frame; one that is not `EVALUATED` is passed on without counts.

    Of a training frame it counts alone how probable its road and the rest are, of one without truth
    how much each mask is in doubt, of one that was picked by rank the ERR, apart from all counts.

    A frame must have a truth if its role is `EVALUATED`. A variant's final mask is that of its last
    stage. ``prior`` is the ``blind`` baseline, or None where no frame with truth was trained on;
    ``ground`` is what is before the camera, where that is known.
    """
    if role is Role.TRAINING and frame.truth is not None:
        found = _by_stage(variants, partial(histogram, truth=frame.truth))
        return FrameResult(frame, role, variants, histograms=found)
    if role is Role.UNLABELLED:
        return FrameResult(frame, role, variants, doubts=doubts_of(variants))
    if role is Role.PICKED and frame.truth is not None:
        return FrameResult(frame, role, variants, **_apart(frame.truth, variants))
    if role is not Role.EVALUATED:
        return FrameResult(frame, role, variants)
    if frame.truth is None:
        raise ValueError(f"frame {frame.number} is to be evaluated, but has no truth")
    truth = TruthBits.of(frame.truth)
    masks = {(v.variant, stage): mask for v in variants for stage, mask in v.masks()}
    if prior is not None:
        masks[BASELINE, FINAL_STAGE] = prior.mask(truth.shape)
    names, bits = list(masks), truth.bits_of(masks.values())
    survey = survey_of(ground, settings, truth.shape) if ground else None
    labelled = LabelledFrame(frame, truth, variants, settings, survey)
    tallies = tally(names, bits, truth, regions.of_frame(labelled))
    finals = {result.variant: result.rates for result in tallies}
    blind = finals.pop(BASELINE, None)
    final_bits = {variant: mask for (variant, _), mask in zip(names, bits, strict=True)}
    metres = measure(survey, final_bits, truth) if survey else {}
    last = dict(names)
    return FrameResult(
        frame,
        role,
        variants,
        errors={v.variant: error_map(v.final(), frame.truth) for v in variants},
        tallies=tuple(_with_ground(each, metres, last) for each in tallies),
        health={name: judge(own, blind) for name, own in finals.items()},
        truth_bits=truth,
        changes=changes(names, bits, truth),
        contours=contours(final_bits, truth, settings.boundary_width),
        histograms=_by_stage(variants, partial(histogram, truth=frame.truth)),
        oracles=_tallies({v.variant: v.oracles for v in variants}, truth),
        metres=metres,
        above=_by_stage(variants, partial(survey.levels, truth=frame.truth)) if survey else {},
    )


def _with_ground(tally: Tally, metres: Mapping[str, FrameMetres], last: Mapping[str, str]) -> Tally:
    """Return a final mask's tally with its cells of the ground seen from above as a region."""
    if tally.variant not in metres or last[tally.variant] != tally.stage:
        return tally
    counts = Counts(*metres[tally.variant].counts[0, -1].tolist())
    return replace(tally, regions={**tally.regions, ABOVE: counts})


def _apart(truth: Truth, variants: Iterable[VariantResult]) -> dict[str, Any]:
    """Return the final masks' ERR and error maps, as parts of `FrameResult`."""
    finals = {(each.variant, FINAL_STAGE): Packed.of(each.final()) for each in variants}
    bits = TruthBits.of(truth)
    found = tally(list(finals), bits.bits_of(finals.values()), bits, {})
    return {
        "apart": {each.variant: each.rates["ERR"] for each in found},
        "errors": {each.variant: error_map(each.final(), truth) for each in variants},
    }


def _by_stage(
    variants: Iterable[VariantResult], counted: Callable[[Probability], Histogram]
) -> dict[Name, Histogram]:
    """Return what is counted of each stage that says how probable road is."""
    return {
        (variant.variant, each.stage): counted(each.output.probability)
        for variant in variants
        for each in variant.stages
        if each.output.probability is not None
    }


def tally(
    names: Sequence[Name], masks: Bits, truth: TruthBits, found: Mapping[str, Bits]
) -> tuple[Tally, ...]:
    """Count named masks in the whole frame and in the regions ``found``."""
    counted = count(masks, truth, list(found.values()))
    tallies = []
    for (variant, stage), rows in zip(names, counted.tolist(), strict=True):
        whole, *parts = (Counts(*row) for row in rows)
        by_region = dict(zip(found, parts, strict=True))
        tallies.append(Tally(variant, stage, whole, by_region, metrics.of(whole)))
    return tuple(tallies)


def _tallies(
    variants: Mapping[str, Mapping[K, Mapping[str, Packed]]], truth: TruthBits
) -> dict[K, tuple[Tally, ...]]:
    """Count the variants' further masks, each by what it is of and by its stage."""
    named: dict[K, dict[Name, Packed]] = {}
    for variant, further in variants.items():
        for key, masks in further.items():
            for stage, mask in masks.items():
                named.setdefault(key, {})[variant, stage] = mask
    return {
        key: tally(list(masks), truth.bits_of(masks.values()), truth, {})
        for key, masks in named.items()
    }


def judge(rates: Rates, blind: Rates | None) -> Health:
    """Return a variant's health by its final mask's rates and the baseline's, if there is one.

    An undefined rate counts neither for nor against it. `roadeval.evaluation.settings` gives the
    thresholds and their reasons.
    """
    if rates["ERR"] >= FAILED_ERR or rates["FNR"] >= FAILED_FNR:
        return Health.FAILED
    worse = blind is not None and rates["ERR"] - blind["ERR"] > DEGRADED_MARGIN
    return Health.DEGRADED if worse or rates["ERR"] >= DEGRADED_ERR else Health.OK


@dataclass(frozen=True, eq=False)
class BlindPrior:
    """Where the road was in the training frames."""

    road: Values
    """``(H, W)`` float32: the share of the training frames in which a pixel was road, among those
    that label it; 0 where none does."""

    @classmethod
    def of_truths(cls, truths: Sequence[Truth]) -> BlindPrior:
        """Average the truths, each ``(H, W)`` uint8 with 255 for ignored; a ValueError for none.

        Truths of another size than the first are brought to it, nearest pixel.
        """
        if not truths:
            raise ValueError("a prior needs at least one truth")
        road = np.zeros(truths[0].shape, np.float32)
        labelled = np.zeros_like(road)
        for truth in truths:
            resized = _resized(truth, road.shape, mixed=False)
            road += resized == ROAD
            labelled += resized != IGNORE
        return cls(np.divide(road, labelled, out=np.zeros_like(road), where=labelled > 0))

    def mask(self, shape: tuple[int, int]) -> Packed:
        """Return the mask for a frame of ``shape`` (height, width): road from one half."""
        return Packed.of(_resized(self.road, shape, mixed=True) >= 0.5)


def _resized(image: Cells, shape: tuple[int, ...], *, mixed: bool) -> Cells:
    """Return an image in another size; where its values may not be ``mixed``, the nearest."""
    if image.shape == shape:
        return image
    import cv2

    how = cv2.INTER_LINEAR if mixed else cv2.INTER_NEAREST
    resized: Cells = cv2.resize(image, (shape[1], shape[0]), interpolation=how)
    return resized

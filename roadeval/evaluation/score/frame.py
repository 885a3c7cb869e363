"""The score of one frame: counts, rates, error maps, health; and the ``blind`` baseline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from roadeval import data
from roadeval.data import BASELINE, FINAL_STAGE, IGNORE, ROAD, FrameResult, Packed, Role, TruthBits
from roadeval.data.arrays import Bits, Values
from roadeval.evaluation import metrics, regions
from roadeval.evaluation.metres import ABOVE, survey_of
from roadeval.evaluation.region import LabelledFrame
from roadeval.evaluation.score.classes import count_classes
from roadeval.evaluation.score.counts import Name, changes, contours, count, error_map
from roadeval.evaluation.score.kitti import count_levels
from roadeval.evaluation.score.metre_sums import measure
from roadeval.evaluation.score.unlabelled import doubts_of
from roadeval.evaluation.settings import (
    DEGRADED_ERR,
    DEGRADED_MARGIN,
    FAILED_ERR,
    FAILED_FNR,
    EvaluationSettings,
)
from roadeval.geometry.ground import Ground


def score_frame(
    frame: data.Frame,
    role: Role,
    variants: tuple[data.VariantResult, ...],
    settings: EvaluationSettings,
    prior: BlindPrior | None,
    *,
    ground: Ground | None = None,
) -> FrameResult:
    """Score one frame by its role; only an `EVALUATED` frame is counted, and it needs a truth.

    A training frame gives histograms of the probability of road, a frame without truth gives the
    doubt in each mask, and a frame that was picked by rank gives ERR apart from all counts. A
    variant's final mask is the mask of its last stage. ``prior`` is the ``blind`` baseline, or None
    if no frame with truth was trained on; ``ground`` is None if the camera is not known.
    """
    result, truth = FrameResult(frame, role, variants), frame.truth
    if role is Role.UNLABELLED:
        return replace(result, doubts=doubts_of(variants))
    if truth is None:
        if role is Role.EVALUATED:
            raise ValueError(f"frame {frame.number} cannot be evaluated: it has no truth")
        return result
    if role is Role.TRAINING:
        by_stage = _probabilities(variants).items()
        return replace(result, histograms={name: data.histogram(p, truth) for name, p in by_stage})
    if role is Role.EVALUATED:
        return _evaluate(result, truth, settings, prior, ground)
    if role is not Role.PICKED:
        return result
    scored = score_finals(result, truth)
    apart = {final.variant: final.rates["ERR"] for final in scored.tallies}
    return replace(scored, tallies=(), apart=apart)


def score_finals(result: FrameResult, truth: data.Truth) -> FrameResult:
    """Return a frame's result with the counts and errors of its final masks alone."""
    finals = {(v.variant, [*v.masks()][-1][0]): Packed.of(v.final()) for v in result.variants}
    bits = TruthBits.of(truth)
    return replace(
        result,
        tallies=tuple(tally([*finals], bits.bits_of(finals.values()), bits)),
        errors={v.variant: error_map(v.final(), truth) for v in result.variants},
    )


def _evaluate(
    result: FrameResult,
    truth: data.Truth,
    settings: EvaluationSettings,
    prior: BlindPrior | None,
    ground: Ground | None,
) -> FrameResult:
    """Return the result of an evaluated frame with all its counts and rates."""
    frame, variants, labels = result.frame, result.variants, TruthBits.of(truth)
    masks = {(v.variant, stage): mask for v in variants for stage, mask in v.masks()}
    if prior is not None:
        masks[BASELINE, FINAL_STAGE] = prior.mask(labels.shape)
    names, bits = [*masks], labels.bits_of(masks.values())
    final_bits = {variant: mask for (variant, _), mask in zip(names, bits, strict=True)}
    survey = survey_of(ground, settings, labels.shape) if ground else None
    labelled = LabelledFrame(frame, labels, variants, settings, survey)
    tallies = tally(names, bits, labels, regions.of_frame(labelled))
    metres = measure(survey, final_bits, labels) if survey else {}
    last_places = {variant: place for place, (variant, _) in enumerate(names)}
    for variant, measures in metres.items():
        final = tallies[last_places[variant]]
        with_cells = {**final.regions, ABOVE: data.Counts(*measures.counts[0, -1].tolist())}
        tallies[last_places[variant]] = replace(final, regions=with_cells)
    rates = {mask.variant: mask.rates for mask in tallies}  # a variant's final mask is its last
    blind = rates.pop(BASELINE, None)
    replaced: dict[str, dict[Name, Packed]] = {}
    for v in variants:
        for oracle, oracle_masks in v.oracles.items():
            by_stage = {(v.variant, stage): mask for stage, mask in oracle_masks.items()}
            replaced.setdefault(oracle, {}).update(by_stage)
    probabilities = _probabilities(variants).items()
    finals = {v.variant: v.final() for v in variants}
    codes = frame.classes
    by_class = {} if prior is None else {BASELINE: masks[BASELINE, FINAL_STAGE].pixels()}
    return replace(
        result,
        errors={variant: error_map(mask, truth) for variant, mask in finals.items()},
        tallies=tuple(tallies),
        health={variant: judge(final, blind) for variant, final in rates.items()},
        truth_bits=labels,
        changes=changes(names, bits, labels),
        contours=contours(final_bits, labels, settings.boundary_width),
        histograms={name: data.histogram(p, truth) for name, p in probabilities},
        oracles={
            oracle: tuple(tally([*stages], labels.bits_of(stages.values()), labels))
            for oracle, stages in replaced.items()
        },
        metres=metres,
        kitti=count_levels(frame, masks, dict(probabilities)),
        above={name: survey.levels(p, truth) for name, p in probabilities} if survey else {},
        classes={} if codes is None else count_classes(codes, truth, finals | by_class),
    )


def _probabilities(variants: Sequence[data.VariantResult]) -> dict[Name, data.Probability]:
    """Return the probabilities of road, by variant and stage, of the stages that have them."""
    return {
        (variant.variant, result.stage): result.output.probability
        for variant in variants
        for result in variant.stages
        if result.output.probability is not None
    }


def tally(
    names: Sequence[Name], masks: Bits, truth: TruthBits, by_name: Mapping[str, Bits] | None = None
) -> list[data.Tally]:
    """Count named masks, ``(K, H, words)``, in the whole frame and in regions by their names."""
    by_name = by_name or {}
    counted = count(masks, truth, [*by_name.values()])
    tallies = []
    for (variant, stage), rows in zip(names, counted.tolist(), strict=True):
        frame, *parts = (data.Counts(*row) for row in rows)
        by_region = dict(zip(by_name, parts, strict=True))
        tallies.append(data.Tally(variant, stage, frame, by_region, metrics.of(frame)))
    return tallies


def judge(rates: Mapping[str, float], blind: Mapping[str, float] | None) -> data.Health:
    """Return a variant's health from the rates of its final mask and of the baseline, if any.

    An undefined rate counts neither for nor against it. `roadeval.evaluation.settings` gives the
    thresholds and their reasons.
    """
    if rates["ERR"] >= FAILED_ERR or rates["FNR"] >= FAILED_FNR:
        return data.Health.FAILED
    worse = blind is not None and rates["ERR"] - blind["ERR"] > DEGRADED_MARGIN
    return data.Health.DEGRADED if worse or rates["ERR"] >= DEGRADED_ERR else data.Health.OK


@dataclass(frozen=True, eq=False)
class BlindPrior:
    """Where the road was in the training frames."""

    road: Values
    """``(H, W)`` float32: of the training frames that label a pixel, the share in which it is road;
    0 if no frame labels it."""

    @classmethod
    def of_truths(cls, truths: Sequence[data.Truth]) -> BlindPrior:
        """Average truths, ``(H, W)`` uint8 with 255 for ignored; a ValueError if there are none.

        Truths of another size than the first are resized to its size, by the nearest pixel.
        """
        if not truths:
            raise ValueError("a prior needs at least one truth")
        import cv2

        road = np.zeros(truths[0].shape, np.float32)
        labelled = np.zeros_like(road)
        for truth in truths:
            resized = cv2.resize(truth, road.shape[::-1], interpolation=cv2.INTER_NEAREST)
            road += resized == ROAD
            labelled += resized != IGNORE
        return cls(np.divide(road, labelled, out=np.zeros_like(road), where=labelled > 0))

    def mask(self, shape: tuple[int, int]) -> Packed:
        """Return the mask for a frame of ``shape`` (height, width): road if at least one half."""
        import cv2

        return Packed.of(cv2.resize(self.road, shape[::-1]) >= 0.5)

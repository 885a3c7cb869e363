"""Running chains on frames, stage by stage, with a clock."""

from __future__ import annotations

from collections.abc import Mapping
from time import perf_counter
from typing import Any, Final

from roadeval.config import RunConfig, Variant
from roadeval.data import (
    FILTERED,
    FINAL_STAGE,
    Layer,
    Mask,
    Output,
    Rgb,
    StageResult,
    Truth,
    VariantLayout,
    VariantResult,
    mask_spec,
)
from roadeval.data.packed import Packed
from roadeval.errors import RoadevalError
from roadeval.pipeline.chain import Chain
from roadeval.pipeline.stage import View
from roadeval.training import Model

EXTERNAL: Final = mask_spec(FINAL_STAGE, "Road mask in the log")


def run_variant(
    name: str,
    chain: Chain,
    view: View,
    *,
    truth: Truth | None = None,
    shadow_truth: Truth | None = None,
    known: dict[Any, dict[str, Packed]] | None = None,
    repeats: Mapping[int, Chain] | None = None,
) -> VariantResult:
    """Run a chain on a frame and time each of its stages.

    Given the truth, run it also with each stage that has an oracle replaced by that, untimed;
    ``known`` is what the frame's variants share of it, see `Chain.oracles`. Then the chains of
    further trainings run, too, by their seeds.
    """
    results, outputs = [], []
    start = perf_counter()
    for stage, output in chain.run(view):
        seconds = perf_counter() - start
        results.append(StageResult(stage, output, seconds))
        outputs.append(output)
        start = perf_counter()
    if truth is None:
        return VariantResult(name, tuple(results))
    shared = {} if known is None else known
    oracles = dict(chain.oracles(view, outputs, truth, shadow_truth, shared))
    again = {s: dict(other.repeated(view, outputs)) for s, other in (repeats or {}).items()}
    return VariantResult(name, tuple(results), oracles, again)


def external_layout(name: str, topic: str) -> VariantLayout:
    """Describe a variant whose masks the log carries, under ``topic``."""
    return VariantLayout(name, f"mask in {topic}", (FINAL_STAGE,), (EXTERNAL,))


def external_variant(name: str, mask: Mask) -> VariantResult:
    """Present a mask that the log carries as a variant with the final stage alone."""
    road = Packed.of(mask)
    stage = StageResult(FINAL_STAGE, Output((Layer(EXTERNAL, road),), mask=road), 0.0)
    return VariantResult(name, (stage,))


def bind(variants: tuple[Variant, ...], model: Model) -> Mapping[str, Chain]:
    """Make the variants' chains ready to run with what the model learnt for each."""
    return {v.name: v.pipeline.bind(model.parameters[v.name]) for v in variants}


def run_frame(
    image: Rgb, model: Model, config: RunConfig | None = None, *, variant: str = FILTERED
) -> VariantResult:
    """Run one variant on one image, with all layers: the notebook's way in.

    Parameters
    ----------
    image
        ``(H, W, 3)`` uint8 RGB.
    model
        What `roadeval.train` or `roadeval.load_model` gave.
    config
        The configuration that the model was trained with; the preset ``paper`` by default.
    variant
        Which of its variants to run.

    Returns
    -------
    VariantResult
        The stages' layers, masks, facts and seconds.

    Examples
    --------
    >>> import roadeval
    >>> image = roadeval.Recording("out.rrd").image(frame=12)
    >>> result = roadeval.run_frame(image, roadeval.load_model("city.model"))
    >>> [stage.stage for stage in result.stages]
    ['shadow', 'similarity', 'svm', 'post']
    >>> {layer.spec.name: layer.array.shape for layer in result.layers()}["compensated"]
    (48, 64, 3)
    """
    chains = bind((config or RunConfig()).variants(), model)
    if variant not in chains:
        raise RoadevalError(f"there is no variant {variant}; there are {', '.join(chains)}")
    return run_variant(variant, chains[variant], View.of(image))

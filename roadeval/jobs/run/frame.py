"""Masks of a frame by the variants of a run: computed here, or made by another system."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from roadeval.config.run import RunConfig
from roadeval.config.variants import Variant
from roadeval.data import (
    FILTERED,
    FINAL_STAGE,
    Layer,
    LayerKind,
    LayerSpec,
    Mask,
    Output,
    Packed,
    Probability,
    Rgb,
    StageResult,
    Truth,
    VariantLayout,
    VariantResult,
    mask_spec,
)
from roadeval.errors import RoadevalError
from roadeval.images.decoding import eight_bits
from roadeval.pipeline.chain import Chain
from roadeval.pipeline.stage import View
from roadeval.training.model import Model

EXTERNAL: Final = mask_spec(FINAL_STAGE, "Road mask by another method")
PROBABILITY: Final = LayerSpec(
    "probability", LayerKind.SCALAR, "How probable road is", value_range=(0.0, 1.0), exact=False
)


def run_variant(
    name: str,
    chain: Chain,
    view: View,
    *,
    truth: Truth | None = None,
    shadow_truth: Truth | None = None,
    known: dict[Any, Any] | None = None,
) -> VariantResult:
    """Run a chain on a frame; with truth also with each stage replaced by its oracle.

    ``known`` are intermediate results that the frame's variants share, see `Chain.run`.
    """
    results = tuple(chain.run(view, known))
    outputs = [result.output for result in results]
    oracle_results = () if truth is None else chain.oracles(view, outputs, truth, shadow_truth)
    return VariantResult(name, results, dict(oracle_results))


def external_layout(name: str, where: str, *, probable: bool = False) -> VariantLayout:
    """Describe a variant with masks of another system, and where they lie.

    ``probable`` tells whether they are thresholds on how probable road is.
    """
    layers = (PROBABILITY, EXTERNAL) if probable else (EXTERNAL,)
    return VariantLayout(name, f"mask in {where}", (FINAL_STAGE,), layers)


def external_variant(
    name: str, mask: Mask, probability: Probability | None = None
) -> VariantResult:
    """Present a mask that another system has made as a variant with the final stage alone."""
    road = Packed.of(mask)
    layers = [Layer(EXTERNAL, road)]
    if probability is not None:
        layers.insert(0, Layer(PROBABILITY, eight_bits(probability)))
    output = Output(tuple(layers), mask=road, probability=probability)
    return VariantResult(name, (StageResult(FINAL_STAGE, output, 0.0),))


def bind(variants: tuple[Variant, ...], model: Model) -> Mapping[str, Chain]:
    """Make the variants' chains ready to run with what the model learnt for each."""
    return {v.name: v.pipeline.bind(model.parameters.get(v.name, {})) for v in variants}


def run_frame(
    image: Rgb, model: Model | None, config: RunConfig | None = None, *, variant: str = FILTERED
) -> VariantResult:
    """Run one variant on one image, and return all its layers, for use in a notebook.

    Parameters
    ----------
    image
        ``(H, W, 3)`` uint8 RGB.
    model
        The result of `roadeval.train` or `roadeval.load_model`; None for a variant that learns
        nothing, such as a network.
    config
        The configuration that the model was trained with; the preset ``paper`` by default.

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
    pipelines = (config or RunConfig()).pipelines()
    if variant not in pipelines:
        raise RoadevalError(f"there is no variant {variant}; there are {', '.join(pipelines)}")
    pipeline = pipelines[variant]
    if model is None and pipeline.learning_stages():
        raise RoadevalError(f"variant {variant} needs a model: its stages learn")
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3 or not image.size:
        raise RoadevalError(f"the image is {image.dtype} {image.shape}, not uint8 (H, W, 3)")
    learnt = {} if model is None else model.parameters.get(variant, {})
    return run_variant(variant, pipeline.bind(learnt), View.of(image))

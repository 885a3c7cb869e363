"""Running chains on frames, stage by stage, with a clock."""

from __future__ import annotations

from collections.abc import Mapping
from time import perf_counter

from roadeval.config import Config, Variant
from roadeval.data import FINAL_STAGE, Layer, Mask, Rgb, StageResult, VariantResult, mask_spec
from roadeval.pipeline.chain import Chain
from roadeval.training import Model


def run_variant(name: str, chain: Chain, image: Rgb) -> VariantResult:
    """Run a chain on an ``(H, W, 3)`` uint8 RGB image and time each of its stages."""
    results = []
    start = perf_counter()
    for stage, output in chain.run(image):
        seconds = perf_counter() - start
        results.append(
            StageResult(stage, output.layers, output.mask, output.regions, output.facts, seconds)
        )
        start = perf_counter()
    return VariantResult(name, tuple(results))


def external_variant(name: str, mask: Mask) -> VariantResult:
    """Present a mask that the log carries as a variant with the final stage alone."""
    layer = Layer(mask_spec(FINAL_STAGE, f"Mask of {name}"), mask)
    return VariantResult(name, (StageResult(FINAL_STAGE, (layer,), mask, {}, {}, 0.0),))


def bind(variants: tuple[Variant, ...], model: Model) -> Mapping[str, Chain]:
    """Make the variants' chains ready to run with what the model learnt for each."""
    return {v.name: v.config.bind(model.parameters[v.name]) for v in variants}


def run_frame(
    image: Rgb, model: Model, config: Config | None = None, *, variant: str = "filtered"
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
        ``unfiltered`` runs it without its filters.
    variant
        Whose parameters to use.

    Returns
    -------
    VariantResult
        The stages' layers, masks, facts and seconds.

    Examples
    --------
    >>> result = roadeval.run_frame(image, roadeval.load_model("city.model"))  # doctest: +SKIP
    >>> {layer.spec.name: layer.array.shape for layer in result.layers()}  # doctest: +SKIP
    """
    config = config or Config()
    if variant == "unfiltered":
        config = config.without_filter()
    return run_variant(variant, config.bind(model.parameters[variant]), image)

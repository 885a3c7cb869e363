"""Somebody else's stage: its errors are named, and what it hands out is checked."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from roadeval.data import Layer, LayerKind, LayerSpec
from roadeval.data.packed import Packed
from roadeval.errors import RoadevalError
from roadeval.pipeline.stage import Output, Stage, StageError, TrainingSet, View
from roadeval.runtime.text import visible

S = TypeVar("S")
P = TypeVar("P")


def guarded(stage: Stage[S, P]) -> Stage[S, P]:
    """Return a stage whose every error is a `StageError`, and so is an output that cannot be."""

    def bind(settings: S, parameters: Any) -> Callable[[View], Output]:
        with _named(stage, "cannot be made ready"):
            run = stage.bind(settings, parameters)
            specs = stage.layers(settings)

        def checked(view: View) -> Output:
            with _named(stage, "failed"):
                output = run(view)
                _check(output, view, stage, specs)
            return output

        return checked

    def fit(training_set: TrainingSet, settings: S) -> P:
        assert stage.fit is not None
        with _named(stage, "cannot learn"):
            return stage.fit(training_set, settings)

    return replace(stage, bind=bind, fit=None if stage.fit is None else fit)


@contextmanager
def _named(stage: Stage[Any, Any], what: str) -> Iterator[None]:
    try:
        yield
    except (RoadevalError, MemoryError):
        raise
    except Exception as error:  # whatever somebody's code raises
        said = visible(" ".join(f"{type(error).__name__}: {error}".split()))
        raise StageError(f"stage {stage.name} {what}: {said}") from error


def _check(
    output: Output, view: View, stage: Stage[Any, Any], specs: tuple[LayerSpec, ...]
) -> None:
    """Raise an error where an output is none, or not of the image's size."""
    if not isinstance(output, Output):
        raise TypeError(f"it returned {type(output).__name__} and no Output")
    size = view.image.shape[:2]
    if stage.yields_mask and not isinstance(output.mask, Packed):
        raise TypeError("it handed out no mask (Packed.of makes one)")
    if output.mask is not None and output.mask.shape != size:
        raise ValueError(f"its mask is {output.mask.shape}, and the image {size}")
    image, codes = output.image, output.probability
    if image is not None and (image.shape != view.image.shape or image.dtype != np.uint8):
        raise ValueError(f"its image is {image.dtype} {image.shape}, not uint8 {view.image.shape}")
    if codes is not None and (codes.shape != size or codes.dtype != np.uint16):
        raise ValueError(f"its probability is {codes.dtype} {codes.shape}, not uint16 {size}")
    for layer in output.layers:
        if layer.spec not in specs:
            raise ValueError(f"it handed out a layer {layer.spec.name!r} that it does not announce")
        _check_layer(layer, size)


def _check_layer(layer: Layer, size: tuple[int, int]) -> None:
    """Raise an error where a layer is not of the image's size, or of a type that no codec takes."""
    name, kind, array = layer.spec.name, layer.spec.kind, layer.array
    if array.shape[:2] != size:
        raise ValueError(f"its layer {name!r} is {array.shape}, not {size}")
    if kind is LayerKind.MASK and array.dtype.kind not in "biu":
        raise TypeError(f"its layer {name!r} holds {array.dtype}, and no whole numbers")
    if kind in (LayerKind.LABELS, LayerKind.RGB) and array.dtype != np.uint8:
        raise TypeError(f"its layer {name!r} holds {array.dtype}, not uint8")

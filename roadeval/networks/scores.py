"""From a network's output to how probable road is, pixel by pixel."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from roadeval.data.arrays import Values
from roadeval.networks.settings import NetSettings


def road_probability(scores: Values, settings: NetSettings) -> Values:
    """Compute how probable road is, ``(h, w)`` float32 in 0..1, from scores of all classes.

    Parameters
    ----------
    scores
        ``(C, h, w)`` float32, as the network gives them.
    settings
        Stated ones. For ``argmax`` it is road against the rest: the best class of road against the
        best other one, so that the mask is where it is above one half. For ``threshold`` it is the
        sum over the classes of road, and of a ``sigmoid`` the greatest of them.
    """
    chosen = np.zeros(len(scores), np.bool_)
    chosen[list(road_numbers(settings))] = True
    if settings.decide == "argmax":
        return _against(scores[chosen].max(axis=0), scores[~chosen].max(axis=0), settings)
    if settings.activation == "sigmoid":
        return sigmoid(scores[chosen].max(axis=0))
    if settings.activation == "softmax":
        powers = np.exp(scores - scores.max(axis=0))
        share: Values = powers[chosen].sum(axis=0) / powers.sum(axis=0)
        return share
    total: Values = np.clip(scores[chosen].sum(axis=0), 0, 1)
    return total


def road_numbers(settings: NetSettings) -> tuple[int, ...]:
    """Return the classes that are road in stated settings, which name them by their numbers."""
    return tuple(int(each) for each in settings.road or ())


def sigmoid(values: Values) -> Values:
    """Compute ``1 / (1 + exp(-x))``, in a form that cannot overflow."""
    result: Values = 0.5 + 0.5 * np.tanh(0.5 * values)
    return result


def as_scores(output: npt.NDArray[Any], layout: str) -> npt.NDArray[Any] | None:
    """Return an output as classes, rows and columns; None where it is no map of the image.

    Parameters
    ----------
    output
        Of one image: ``(1, C, h, w)``, or ``(1, h, w, C)`` where the layout is ``NHWC``, or without
        the length of 1, or without classes.
    layout
        Of the input.
    """
    array = output[0] if output.ndim > 2 and len(output) == 1 else output
    if array.ndim == 3 and layout == "NHWC" and len(array) != 1:
        array = array.transpose(2, 0, 1)
    if array.ndim == 2:
        array = array[None]
    return array if array.ndim == 3 and min(array.shape[1:]) > 1 else None


def _against(road: Values, other: Values, settings: NetSettings) -> Values:
    if settings.activation != "none":
        return sigmoid(road - other)
    with np.errstate(invalid="ignore"):
        share: Values = road / (road + other)
    return np.where(road + other > 0, share, 0.0).astype(np.float32)

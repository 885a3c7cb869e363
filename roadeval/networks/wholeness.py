"""Whether a network's file is whole, as far as OpenCV trusts it to be: it would end the process."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import prod
from typing import Any, Final

import numpy as np

from roadeval.networks.onnx_schema import TYPES

MOST_LENGTHS: Final = 16
"""Lengths that the shape of weights may have."""
DIVISORS: Final = frozenset({b"dilations", b"group", b"kernel_shape", b"strides"})
"""Attributes by which sizes are divided."""
_OTHER_DATA: Final = ("data_4", "data_5", "data_6", "data_7", "data_10", "data_11")
"""Where a tensor's numbers may stand in place of ``raw_data``."""


def is_whole(graph: Any) -> bool:
    """Return whether names are text, tensors are made before they are used, and weights are there.

    And whether what sizes are divided by is above 0.

    Parameters
    ----------
    graph
        As `roadeval.networks.onnx_schema` describes it.
    """
    known = {b"", *weights_of(graph), *(each.name for each in graph.input)}
    texts = {b""}
    for node in graph.node:
        if not known.issuperset(node.input):
            return False
        known.update(node.output)
        texts.update((node.name, node.op_type, node.domain))
        texts.update(each.name for each in node.attribute)
        if not all(map(_divides, node.attribute)):
            return False
    outputs = [each.name for each in graph.output]
    return (
        bool(graph.input and outputs)
        and known.issuperset(outputs)
        and _are_text(known | texts)
        and all(map(_has_its_numbers, graph.initializer))
    )


def weights_of(graph: Any) -> Iterator[bytes]:
    """Yield the names of the weights."""
    yield from (tensor.name for tensor in graph.initializer)
    yield from (tensor.values.name for tensor in graph.sparse_initializer)


def _are_text(names: Iterable[bytes]) -> bool:
    try:
        return all(name.decode() is not None for name in names)
    except UnicodeDecodeError:
        return False


def _divides(attribute: Any) -> bool:
    """Return whether an attribute, where sizes are divided by it, is above 0."""
    if attribute.name not in DIVISORS:
        return True
    least: int = min(attribute.ints or [attribute.i])
    return least > 0


def _has_its_numbers(tensor: Any) -> bool:
    if len(tensor.dims) > MOST_LENGTHS or min(tensor.dims, default=0) < 0:
        return False
    if tensor.external_data or any(getattr(tensor, name) for name in _OTHER_DATA):
        return True
    kind = TYPES.get(tensor.data_type)
    if kind is None or kind == "string":
        return True
    wanted: int = prod(tensor.dims) * np.dtype(kind).itemsize
    return len(tensor.raw_data) == wanted

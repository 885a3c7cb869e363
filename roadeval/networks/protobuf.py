"""What onnxruntime does not tell of an ONNX file: its weight files, and what makes its outputs.

An ONNX file is a protobuf message; fields have the numbers of ``onnx.proto``. What is no such
message is a `ValueError`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

PASSING: Final = frozenset(
    {"Cast", "Identity", "Reshape", "Resize", "Slice", "Squeeze", "Transpose", "Unsqueeze"}
)
"""Operators whose output holds the numbers of their input."""
_GRAPH, _NODE, _INITIALIZER, _EXTERNAL_DATA = 7, 1, 5, 13


def weight_files(model: memoryview) -> Iterator[str]:
    """Yield the names of the files beside it that hold a model's weights."""
    for graph in _all(model, _GRAPH):
        for tensor in _all(graph, _INITIALIZER):
            for entry in _all(tensor, _EXTERNAL_DATA):
                key, value = (b"".join(_all(entry, number)) for number in (1, 2))
                if key == b"location":
                    yield _text(value)


def maker(model: memoryview, output: str) -> str:
    """Return the operator that makes the numbers of an output; empty where no node makes it.

    Operators that only move or convert numbers are passed over.
    """
    made_by: dict[str, tuple[str, list[str]]] = {}
    for graph in _all(model, _GRAPH):
        for node in _all(graph, _NODE):
            inputs, outputs, names = (list(map(_text, _all(node, n))) for n in (1, 2, 4))
            made_by |= dict.fromkeys(outputs, ("".join(names), inputs))
    for _ in made_by:
        operator, inputs = made_by.get(output, ("", []))
        if operator not in PASSING or not inputs:
            return operator
        output = inputs[0]
    return ""


def _all(message: memoryview, number: int) -> Iterator[memoryview]:
    """Yield the bytes of each field of a message that has this number."""
    place = 0
    while place < len(message):
        key, begin = _integer(message, place)
        wire = key & 7
        if wire == 0:
            _, place = _integer(message, begin)
        elif wire == 2:
            size, begin = _integer(message, begin)
            place = begin + size
        elif wire in (1, 5):
            place = begin + (8 if wire == 1 else 4)
        else:
            raise ValueError("a kind of field that ONNX does not use")
        if place > len(message):
            raise ValueError("a field that is cut off")
        if key >> 3 == number:
            yield message[begin:place]


def _integer(message: memoryview, place: int) -> tuple[int, int]:
    """Return an integer of variable length and the place behind it."""
    value = 0
    for index, byte in enumerate(message[place : place + 10]):
        value |= (byte & 0x7F) << (7 * index)
        if byte < 0x80:
            return value, place + index + 1
    raise ValueError("an integer that is cut off")


def _text(value: memoryview | bytes) -> str:
    return bytes(value).decode(errors="replace")

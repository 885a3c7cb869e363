"""The part of ONNX's protobuf schema that tells what a network takes and gives.

Most of the attributes' values, and all else, are fields that this part does not know: the parser
passes over them. Texts are bytes here, for a file from elsewhere may hold any, and so are weights.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any, Final

_INTEGER: Final = "int64"
_TEXT: Final = "bytes"

MESSAGES: Final[Mapping[str, Mapping[str, tuple[int, str, bool]]]] = {
    "Model": {
        "ir_version": (1, _INTEGER, False),
        "graph": (7, "Graph", False),
        "metadata_props": (14, "Entry", True),
    },
    "Entry": {"key": (1, _TEXT, False), "value": (2, _TEXT, False)},
    "Graph": {
        "node": (1, "Node", True),
        "initializer": (5, "Tensor", True),
        "input": (11, "Value", True),
        "output": (12, "Value", True),
        "sparse_initializer": (15, "SparseTensor", True),
    },
    "Node": {
        "input": (1, _TEXT, True),
        "output": (2, _TEXT, True),
        "name": (3, _TEXT, False),
        "op_type": (4, _TEXT, False),
        "attribute": (5, "Attribute", True),
        "domain": (7, _TEXT, False),
    },
    "Attribute": {
        "name": (1, _TEXT, False),
        "i": (3, _INTEGER, False),
        "ints": (8, _INTEGER, True),
    },
    "Tensor": {
        "dims": (1, _INTEGER, True),
        "data_type": (2, _INTEGER, False),
        **{f"data_{number}": (number, _TEXT, False) for number in (4, 5, 6, 7, 10, 11)},
        "name": (8, _TEXT, False),
        "raw_data": (9, _TEXT, False),
        "external_data": (13, "Entry", True),
    },
    "SparseTensor": {"values": (1, "Tensor", False)},
    "Value": {"name": (1, _TEXT, False), "type": (2, "Type", False)},
    "Type": {"tensor_type": (1, "TensorType", False)},
    "TensorType": {"elem_type": (1, _INTEGER, False), "shape": (2, "Shape", False)},
    "Shape": {"dim": (1, "Dimension", True)},
    "Dimension": {"dim_value": (1, _INTEGER, False), "dim_param": (2, _TEXT, False)},
}
"""By message and field: its number in onnx.proto, its type, and whether it is repeated."""
_NAMES: Final = (
    *("", "float32", "uint8", "int8", "uint16", "int16", "int32", "int64", "string", "bool"),
    *("float16", "float64", "uint32", "uint64"),
)
TYPES: Final[Mapping[int, str]] = {code: name for code, name in enumerate(_NAMES) if name}
"""Types of numbers, as NumPy calls them, by ONNX's codes."""


@cache
def model_class() -> Any:
    """Return the protobuf class of a model."""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

    file = descriptor_pb2.FileDescriptorProto(name="model.proto", package="part", syntax="proto2")
    kinds = descriptor_pb2.FieldDescriptorProto
    for message, fields in MESSAGES.items():
        described = file.message_type.add(name=message)
        for name, (number, kind, repeated) in fields.items():
            field = described.field.add(name=name, number=number)
            field.label = kinds.LABEL_REPEATED if repeated else kinds.LABEL_OPTIONAL
            if kind in MESSAGES:
                field.type, field.type_name = kinds.TYPE_MESSAGE, f".part.{kind}"
            else:
                field.type = kinds.TYPE_INT64 if kind == _INTEGER else kinds.TYPE_BYTES
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("part.Model"))

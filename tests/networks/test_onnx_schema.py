"""The part of ONNX's schema that is read."""

import pytest

from roadeval.networks.onnx_schema import MESSAGES, TYPES

onnx = pytest.importorskip("onnx", reason="the extra onnx is not installed")

OWN_NAMES = {
    "Model": onnx.ModelProto,
    "Entry": onnx.StringStringEntryProto,
    "Graph": onnx.GraphProto,
    "Node": onnx.NodeProto,
    "Attribute": onnx.AttributeProto,
    "Tensor": onnx.TensorProto,
    "SparseTensor": onnx.SparseTensorProto,
    "Value": onnx.ValueInfoProto,
    "Type": onnx.TypeProto,
    "TensorType": onnx.TypeProto.Tensor,
    "Shape": onnx.TensorShapeProto,
    "Dimension": onnx.TensorShapeProto.Dimension,
}
"""By the name of a message, its class in the onnx package."""


@pytest.mark.parametrize("message", MESSAGES)
def test_fields_have_the_numbers_of_onnx_itself(message):
    known = OWN_NAMES[message].DESCRIPTOR.fields_by_number
    for name, (number, _, repeated) in MESSAGES[message].items():
        field = known[number]
        if name != f"data_{number}":  # numbers that are not read
            assert (field.name, field.is_repeated) == (name, repeated)


def test_types_have_the_codes_of_onnx_itself():
    for code, name in TYPES.items():
        if name != "string":
            assert onnx.helper.tensor_dtype_to_np_dtype(code).name == name

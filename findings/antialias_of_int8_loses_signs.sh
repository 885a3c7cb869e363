#!/usr/bin/env bash
# onnxruntime's antialiased `Resize` of int8 makes every negative number 0: -100 comes out as 0.
#
# Software: onnxruntime 1.32.0 and 1.20.1, with onnx 1.23.2 and numpy 2.4.6.
#
# A segmentation network ends in a `Resize` with `antialias=1` (opset 18; PyTorch's
# `interpolate(..., antialias=True)` is one). onnxruntime's own `quantize_static` makes a network of
# int8 of it, and in the form `QuantFormat.QOperator` the Resize gets the int8 numbers themselves.
# It treats them as bytes of a picture and cuts them to 0 and more. With the mode `cubic` what
# overshoots 127 beside a bright edge becomes 0, too, in place of 127. Nothing is raised; size and
# type are right.
#
# In the example the mask of a road that is made twice as large has an IoU of 0.99 with that of the
# network of floats, but of 0.71 with QOperator and int8: all that was below the int8 0 has the
# score of the int8 0, which is above the limit here, so that the whole picture is road. The form
# `QuantFormat.QDQ`, whose Resize gets floats, is right, and so are uint8, int32, and the same file
# without `antialias`, which passes every test before the attribute is switched on.
#
# Source: ONNX's page of Resize allows int8 as any other type. upsample_antialias.h of onnxruntime
# has one table for types of 8 bits, "clip8", whose values are 0 to 255.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 1.20.1 1.32.0; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    onnxruntime==$version onnx==1.23.2 numpy==2.4.6
  (cd "$folder" && "$folder/$version/bin/python" -W ignore) <<'PYTHON'
import logging

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper
from onnxruntime.quantization import CalibrationDataReader, QuantFormat, QuantType, quantize_static

logging.disable()
onnxruntime.set_default_logger_severity(3)
print(f"onnxruntime {onnxruntime.__version__}")


def run(model, picture):
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    return session.run(None, {"x": picture})[0]


def resize(kind, shape, nodes=(), source="x", filled=(), **attributes):
    """Bytes of a model that ends in a Resize to twice the size."""
    last = helper.make_node("Resize", [source, "", "scales"], ["y"], **attributes)
    scales = numpy_helper.from_array(np.array([1, 1, 2, 2], np.float32), "scales")
    doubled = [1, 1, shape[2] * 2, shape[3] * 2]
    graph = helper.make_graph(
        [*nodes, last],
        "scores",
        [helper.make_tensor_value_info("x", kind, shape)],
        [helper.make_tensor_value_info("y", kind, doubled)],
        [*filled, scales],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=8)
    onnx.checker.check_model(model, full_check=True)
    return model.SerializeToString()


# A flat picture of one number has to stay flat.
for name, kind in {"int8": TensorProto.INT8, "int32": TensorProto.INT32}.items():
    for level in (-100, -1, 100):
        flat = np.full((1, 1, 12, 16), level, name)
        got = run(resize(kind, flat.shape, mode="linear", antialias=1), flat)
        assert got.dtype == flat.dtype
        print(f"  {name}, flat {level}: {np.unique(got)}")
        assert (got == (max(level, 0) if name == "int8" else level)).all()

# An edge from 0 to 125, which `cubic` overshoots by ten steps on both sides.
columns = {}
for name, kind in {"int8": TensorProto.INT8, "int32": TensorProto.INT32}.items():
    edge = np.zeros((1, 1, 12, 16), name)
    edge[..., 8:] = 125
    columns[name] = run(resize(kind, edge.shape, mode="cubic", antialias=1), edge)[0, 0, 5, 13:20]
    print(f"  {name}, an edge from 0 to 125 by cubic: {columns[name]}")
assert columns["int32"][4] > 127 and columns["int8"][4] == 0
assert (columns["int8"][-1] == columns["int32"][-1]).all()

# Smooth scores of a road, and a network of one convolution and a Resize.
rows, columns = np.mgrid[:60, :80]
pictures = [
    np.stack([np.sin(rows / 9 + n), np.cos(columns / 11 - n), np.sin((rows + columns) / 13 + n)])
    for n in range(8)
]
pictures = [picture[None].astype(np.float32) for picture in pictures]
weights = np.zeros((1, 3, 3, 3), np.float32)
weights[0] = np.array([1, 0.8, 0.5])[:, None, None] / 9
bias = np.array([0.4], np.float32)
convolution = helper.make_node(
    "Conv", ["x", "w", "b"], ["c"], kernel_shape=[3, 3], pads=[1, 1, 1, 1]
)
filled = [numpy_helper.from_array(weights, "w"), numpy_helper.from_array(bias, "b")]


class Calibration(CalibrationDataReader):
    def __init__(self):
        self.rest = iter(pictures)

    def get_next(self):
        picture = next(self.rest, None)
        return None if picture is None else {"x": picture}


for antialias in (0, 1):
    model = resize(
        TensorProto.FLOAT,
        [1, 3, 60, 80],
        [convolution],
        "c",
        filled,
        mode="linear",
        antialias=antialias,
    )
    with open("float.onnx", "wb") as file:
        file.write(model)
    scores = run("float.onnx", pictures[0])
    for form in (QuantFormat.QDQ, QuantFormat.QOperator):
        for kind in (QuantType.QUInt8, QuantType.QInt8):
            quantize_static(
                "float.onnx",
                "whole.onnx",
                Calibration(),
                quant_format=form,
                activation_type=kind,
                weight_type=QuantType.QInt8,
            )
            got = run("whole.onnx", pictures[0])
            masks = got > 0, scores > 0
            iou = (masks[0] & masks[1]).sum() / (masks[0] | masks[1]).sum()
            error = np.abs(got - scores).max()
            print(
                f"  antialias={antialias}, {form.name}, {kind.name}: error at most {error:.2f}, "
                f"IoU {iou:.3f}, road {masks[0].mean():.0%} (floats: {masks[1].mean():.0%})"
            )
            is_wrong = antialias and form == QuantFormat.QOperator and kind == QuantType.QInt8
            assert error > 1 if is_wrong else error < 0.1
            assert (iou < 0.75 and masks[0].all()) if is_wrong else iou > 0.95
PYTHON
done

#!/usr/bin/env bash
# onnx's version converter moves the mask of a network by several pixels, and its checker is content.
#
# Software: onnx 1.23.2, its `version_converter`; run by onnxruntime 1.32.0.
#
# A segmentation network of opset 9 or 10 ends in an `Upsample` or `Resize` that takes scores of 60x80
# to an image of 480x640, linearly. Its file is converted to opset 13, as a newer tool asks for. Up to
# opset 10 there is one rule: pixel x of the result lies at x / 8 of the scores. From opset 11 on a
# node states the rule, and one that states none means (x + 1/2) / 8 - 1/2. The converter states
# none. So the converted network takes each score 3.5 pixels further right and down: 2,357 pixels
# of the road's mask change, and its IoU with the mask of the file before is 0.974. Neither
# `convert_version` nor `onnx.checker.check_model` says anything. A small grid of scores moves most,
# by (s - 1) / 2 pixels for a scale of s; with the mode `nearest` and such scales nothing moves, and
# neither does a conversion of `Upsample` to opset 10.
#
# With `coordinate_transformation_mode` set to `asymmetric` on the node after the conversion, both
# files give the same to the last bit.
#
# Source: onnx/version_converter/adapters/resize_10_11.h adds an input to the node and no attribute;
# the page of Resize in ONNX's documentation gives `half_pixel` as the default from opset 11; issue
# 8480 of onnx/onnx, open in November 2026.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  onnx==1.23.2 onnxruntime==1.32.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, version_converter

HEIGHT, WIDTH = 60, 80
rows, columns = np.mgrid[:HEIGHT, :WIDTH]
road = (rows > 25) & (abs(columns - 40) < 1.1 * (rows - 25) + 1)
scores = np.where(road, 1, -1).astype(np.float32)[None, None]


def network(kind, opset, mode, scale):
    """Return a network that only resizes scores, as the last node of a real one does."""
    graph = helper.make_graph(
        [helper.make_node(kind, ["scores", "scales"], ["large"], mode=mode)],
        "head",
        [helper.make_tensor_value_info("scores", TensorProto.FLOAT, scores.shape)],
        [helper.make_tensor_value_info("large", TensorProto.FLOAT, [1, 1, None, None])],
        [helper.make_tensor("scales", TensorProto.FLOAT, [4], [1, 1, scale, scale])],
    )
    opsets = [helper.make_opsetid("", opset)]
    return helper.make_model(graph, opset_imports=opsets, ir_version=5)


def large(model):
    onnx.checker.check_model(model, full_check=True)
    session = onnxruntime.InferenceSession(
        model.SerializeToString(), providers=["CPUExecutionProvider"]
    )
    return session.run(None, {"scores": scores})[0][0, 0]


def changed(kind, opset, mode, scale, to=13):
    """Return the number of mask pixels that a conversion changes, and the IoU of both masks."""
    model = network(kind, opset, mode, scale)
    before, after = large(model) > 0, large(version_converter.convert_version(model, to)) > 0
    iou = (before & after).sum() / (before | after).sum()
    print(
        f"{kind} {opset} to {to}, {mode}, scale {scale}: {(before != after).sum()} of "
        f"{before.size} pixels of the mask change, IoU {iou:.4f}"
    )
    return (before != after).sum(), round(float(iou), 4)


print("onnx", onnx.__version__, "onnxruntime", onnxruntime.__version__)
for kind, opset in (("Resize", 10), ("Upsample", 9)):
    assert changed(kind, opset, "linear", 8) == (2357, 0.9739)
    assert changed(kind, opset, "linear", 4) == (517, 0.9770)
    assert changed(kind, opset, "nearest", 8) == (0, 1)
assert changed("Upsample", 9, "linear", 8, to=10) == (0, 1)

# After the conversion a pixel has what lay 3.5 pixels left of it and above: 3 and 4 have a mean
# there, as both lie between the same two scores.
model = network("Resize", 10, "linear", 8)
before = large(model)
converted = version_converter.convert_version(model, 13)
near, far = slice(1, -3), slice(None, -4)
around = [before[down, right] for down in (near, far) for right in (near, far)]
assert np.allclose(large(converted)[4:, 4:], np.mean(around, axis=0))

(node,) = (node for node in converted.graph.node if node.op_type == "Resize")
print("the converted node states", [attribute.name for attribute in node.attribute])
assert [attribute.name for attribute in node.attribute] == ["mode"]
node.attribute.append(helper.make_attribute("coordinate_transformation_mode", "asymmetric"))
assert np.array_equal(large(converted), before)
print("with coordinate_transformation_mode = asymmetric nothing changes")
PYTHON

#!/usr/bin/env bash
# OpenCV 5 moves the mask of a network with `SAME_UPPER` padding by up to 31 pixels; 4.14 does not.
#
# Software: opencv-python-headless 5.0.0.93, against 4.14.0.94 and onnxruntime 1.32.0; onnx 1.23.2,
# numpy 2.4.6.
#
# Networks from TensorFlow and Keras pad their convolutions by "same", which an ONNX file calls
# `auto_pad="SAME_UPPER"`. A convolution of 3x3 with a stride of 2 on an even size needs one row and
# one column of zeros, and SAME_UPPER says that they come behind the picture. `cv2.dnn` of version
# 4.14 and onnxruntime put them there. `cv2.dnn` of version 5 puts them in front, as SAME_LOWER
# would. Size and type of the result are right and nothing is raised, but each such layer looks at
# what lies one of its own pixels further left and up: a network with four of them, with a stride of
# 16, moves its mask by 15 pixels, one with five by 31. With four layers a road that ends 240 rows
# below the top has an IoU of 0.90 with the mask of version 4.14, with both engines of version 5.
# Pooling is alike. With a stride of 1, or an odd size, both sides are padded alike and the versions
# agree, so that a test with one layer shows nothing.
#
# Padding that is written as numbers, `pads=[0, 0, 1, 1]`, is right in all three.
#
# Source: the page of Conv in ONNX's documentation: SAME_UPPER "add the extra padding at the end".
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 4.14.0.94 5.0.0.93; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    opencv-python-headless==$version numpy==2.4.6 onnx==1.23.2 onnxruntime==1.32.0
  "$folder/$version/bin/python" - <<'PYTHON'
import cv2
import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper

is_new = cv2.__version__.startswith("5")
height, width = 480, 640


def network(layers, kind, **padding):
    """Bytes of a network that halves its picture so many times, and the sizes are all even."""
    smooth = np.outer([1, 2, 1], [1, 2, 1]).astype(np.float32)[None, None] / 16
    weights = ["weights"] if kind == "Conv" else []
    nodes = [
        helper.make_node(
            kind, [f"x{n}", *weights], [f"x{n + 1}"], kernel_shape=[3, 3], strides=[2, 2], **padding
        )
        for n in range(layers)
    ]
    shapes = {"x0": [1, 1, height, width], f"x{layers}": [1, 1, height >> layers, width >> layers]}
    values = [helper.make_tensor_value_info(n, TensorProto.FLOAT, s) for n, s in shapes.items()]
    filled = [numpy_helper.from_array(smooth, "weights")] if weights else []
    graph = helper.make_graph(nodes, "halving", values[:1], values[1:], filled)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    onnx.checker.check_model(model, full_check=True)
    return model.SerializeToString()


def by_opencv(model, picture):
    net = cv2.dnn.readNetFromONNX(np.frombuffer(model, np.uint8))
    net.setInput(picture)
    return net.forward()


def by_onnxruntime(model, picture):
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    return session.run(None, {"x0": picture})[0]


def place_of_edge(scores, layers):
    """Row of the picture at which the scores of the middle column rise above a half."""
    column = scores[0, 0, :, scores.shape[3] // 2]
    after = int(np.argmax(column > 0.5))
    part = (0.5 - column[after - 1]) / (column[after] - column[after - 1])
    return (after - 1 + part + 0.5) * 2**layers


# A smooth edge from dark to bright, with the half at row 240, and one from left to right.
rows = np.clip((np.arange(height) - 239.5) / 200 + 0.5, 0, 1)
columns = np.clip((np.arange(width) - 159.5) / 200 + 0.5, 0, 1)
picture = np.minimum.outer(rows, columns).astype(np.float32)[None, None]

print(f"OpenCV {cv2.__version__}")
for layers in (1, 2, 3, 4, 5):
    model = network(layers, "Conv", auto_pad="SAME_UPPER")
    ours, theirs = by_opencv(model, picture), by_onnxruntime(model, picture)
    assert ours.shape == theirs.shape
    moved = place_of_edge(ours, layers) - place_of_edge(theirs, layers)
    masks = [cv2.resize(s[0, 0], (width, height)) > 0.5 for s in (ours, theirs)]
    iou = (masks[0] & masks[1]).sum() / (masks[0] | masks[1]).sum()
    print(f"  {layers} layers: edge is moved by {moved:.1f} rows, IoU with onnxruntime {iou:.3f}")
    assert abs(moved - (2**layers - 1) * is_new) < 0.6, moved

    # Version 5 does what the numbers of SAME_LOWER say; those of SAME_UPPER are always right.
    upper, lower = (network(layers, "Conv", pads=pads) for pads in ([0, 0, 1, 1], [1, 1, 0, 0]))
    assert np.allclose(by_opencv(upper, picture), theirs, atol=1e-5)
    assert np.allclose(by_onnxruntime(upper, picture), theirs, atol=1e-5)
    assert np.allclose(by_onnxruntime(lower if is_new else upper, picture), ours, atol=1e-5)

for kind in ("MaxPool", "AveragePool"):
    model = network(1, kind, auto_pad="SAME_UPPER")
    equal = np.allclose(by_opencv(model, picture), by_onnxruntime(model, picture), atol=1e-5)
    print(f"  {kind}: {'equal to' if equal else 'not as'} onnxruntime")
    assert equal != is_new
PYTHON
done

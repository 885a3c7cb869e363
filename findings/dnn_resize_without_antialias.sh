#!/usr/bin/env bash
# OpenCV 5 reads a network's `Resize` with `antialias=1` and makes the picture smaller without it.
#
# Software: opencv-python-headless 5.0.0.93, against onnxruntime 1.32.0 and the reference of onnx
# 1.23.2; numpy 2.4.6.
#
# A network makes the camera's picture smaller itself, with `antialias=1` of opset 18 (PyTorch's
# `interpolate(..., antialias=True)`), as its training data were made. onnxruntime and ONNX's
# reference average the pixels that go into one. `cv2.dnn` of version 5 reads the file, says nothing
# and interpolates between the nearest ones: at a quarter of the size fine texture is three times as
# strong as it has to be, and the mask of what is above a limit has an IoU of 0.4 with that of the
# other two; at half the size of 0.7. Version 4.14 refuses such a file. Smooth pictures, and making
# larger, are the same with all, so a test on a synthetic picture passes.
#
# `coordinate_transformation_mode="half_pixel_symmetric"` of opset 19 is taken, too, by both
# versions, and done as `asymmetric`: at a quarter of the size the picture is moved by 1.5 pixels.
#
# Source: ONNX's page of Resize; neither of the two names is in OpenCV's library. cv2.INTER_AREA
# before the network, or onnxruntime, is right.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  opencv-python-headless==5.0.0.93 numpy==2.4.6 onnx==1.23.2 onnxruntime==1.32.0
"$folder/venv/bin/python" - <<'PYTHON'
import cv2
import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper
from onnx.reference import ReferenceEvaluator

height, width = 480, 640
random = np.random.default_rng(0)
gravel = random.normal(0, 1, (1, 1, height, width)).astype(np.float32)
rows, columns = np.mgrid[:height, :width]
hills = (np.sin(rows / 40) + np.cos(columns / 50)).astype(np.float32)[None, None]


def network(divisor, **attributes):
    size = [1, 1, height // divisor, width // divisor]
    node = helper.make_node("Resize", ["x", "", "", "size"], ["y"], mode="linear", **attributes)
    graph = helper.make_graph(
        [node],
        "smaller",
        [helper.make_tensor_value_info("x", TensorProto.FLOAT, gravel.shape)],
        [helper.make_tensor_value_info("y", TensorProto.FLOAT, size)],
        [numpy_helper.from_array(np.array(size, np.int64), "size")],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 19)], ir_version=9)
    onnx.checker.check_model(model, full_check=True)
    return model


def by_opencv(model, picture):
    net = cv2.dnn.readNetFromONNX(np.frombuffer(model.SerializeToString(), np.uint8))
    net.setInput(picture)
    return net.forward()


def by_onnxruntime(model, picture):
    options = {"providers": ["CPUExecutionProvider"]}
    session = onnxruntime.InferenceSession(model.SerializeToString(), **options)
    return session.run(None, {"x": picture})[0]


def by_reference(model, picture):
    return ReferenceEvaluator(model).run(None, {"x": picture})[0]


def iou(one, other, limit):
    return ((one > limit) & (other > limit)).sum() / ((one > limit) | (other > limit)).sum()


print(f"OpenCV {cv2.__version__}, onnxruntime {onnxruntime.__version__}")
for divisor in (2, 4):
    smooth, plain = network(divisor, antialias=1), network(divisor)
    ours, theirs = by_opencv(smooth, gravel), by_onnxruntime(smooth, gravel)
    same = iou(ours, theirs, 0.1)
    print(
        f"  antialias, 1/{divisor}: texture {ours.std():.2f} by OpenCV, "
        f"{theirs.std():.2f} by onnxruntime; IoU of the masks {same:.2f}"
    )
    assert np.array_equal(ours, by_opencv(plain, gravel))
    assert np.allclose(theirs, by_reference(smooth, gravel), atol=1e-4)
    assert np.allclose(by_opencv(plain, gravel), by_onnxruntime(plain, gravel), atol=1e-4)
    assert same < 0.9
    assert ours.std() > 1.2 * theirs.std()
    flat = [program(smooth, hills) for program in (by_opencv, by_onnxruntime)]
    assert iou(*flat, 0.1) > 0.99

symmetric = network(4, coordinate_transformation_mode="half_pixel_symmetric")
asymmetric = network(4, coordinate_transformation_mode="asymmetric")
ours = by_opencv(symmetric, hills)
assert np.array_equal(ours, by_opencv(asymmetric, hills))
theirs = by_onnxruntime(symmetric, hills)
assert np.allclose(theirs, by_reference(symmetric, hills), atol=1e-4)
# The place in the smaller picture with the sine of row 40 of the larger one.
lines = [scores[0, 0, :15, 0] - 1 for scores in (ours, theirs)]
steps = [np.interp(np.sin(1.0), line, np.arange(15)) for line in lines]
print(f"  half_pixel_symmetric, 1/4: moved by {4 * abs(steps[0] - steps[1]):.1f} pixels")
assert 1 < abs(4 * (steps[0] - steps[1])) < 2
PYTHON

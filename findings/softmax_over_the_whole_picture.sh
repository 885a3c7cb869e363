#!/usr/bin/env bash
# A Softmax over the classes in an older ONNX file finds the road by OpenCV, none by onnxruntime.
#
# Software: onnxruntime 1.32.0, opencv-python-headless 5.0.0.93 and 4.14.0.94, onnx 1.23.2; numpy
# 2.4.6.
#
# A segmentation network ends in `Softmax` with `axis=1`, the classes, of scores of N x C x H x W.
# From opset 13 on that is what it says. In a file of opset 12 or older the axis is the place where
# the array is cut into two: all that comes from it on, C x H x W, is one distribution. onnxruntime
# follows that: the probabilities of one picture, not of one pixel, add up to 1, each is a millionth
# or so, and `road > 0.5` is empty. OpenCV takes classes for each pixel, as it was probably meant,
# whatever the opset is. So does the reference implementation in the package `onnx`, which calls
# itself that of the standard, and with the axis left out the three have three answers: onnxruntime
# the whole picture, OpenCV the classes (the old default, 1), the reference each row (the new
# default, -1). The class of the largest probability, `argmax`, is the same with all of them, so
# that a mask by `argmax` tests well and a threshold, an uncertainty or a mean of two networks does
# not. `onnx.version_converter` to opset 13 keeps onnxruntime's meaning: after it OpenCV and the
# reference have no road, either.
#
# Source: ONNX's changelog of operators: Softmax of version 11, "The input does not need to
# explicitly be a 2D vector; rather, it will be coerced into one", against that of version 13,
# "along the given axis".
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
from onnx import TensorProto, helper, version_converter
from onnx.reference import ReferenceEvaluator

height, width = 48, 64
# Scores of ground, road and sky; the lower half is road, with a probability of about 0.9.
scores = np.random.default_rng(0).normal(0, 0.2, (1, 3, height, width)).astype(np.float32)
scores[:, 1, height // 2 :] += 3
scores[:, 2, : height // 2] += 3
truth = np.zeros((height, width), bool)
truth[height // 2 :] = True


def network(opset, **axis):
    node = helper.make_node("Softmax", ["scores"], ["probabilities"], **axis)
    ends = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, scores.shape)
        for name in ("scores", "probabilities")
    ]
    graph = helper.make_graph([node], "softmax", ends[:1], ends[1:])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", opset)], ir_version=7)
    onnx.checker.check_model(model, full_check=True)
    return model


def by_opencv(model):
    net = cv2.dnn.readNetFromONNX(np.frombuffer(model.SerializeToString(), np.uint8))
    net.setInput(scores)
    return net.forward()


def by_onnxruntime(model):
    session = onnxruntime.InferenceSession(
        model.SerializeToString(), providers=["CPUExecutionProvider"]
    )
    return session.run(None, {"scores": scores})[0]


def by_reference(model):
    return ReferenceEvaluator(model).run(None, {"scores": scores})[0]


def what_adds_to_one(probabilities):
    if np.isclose(probabilities.sum(), 1, rtol=1e-3):
        return "picture"
    axes = [axis for axis in (1, 2, 3) if np.allclose(probabilities.sum(axis), 1, rtol=1e-3)]
    return {(1,): "classes", (3,): "row"}[tuple(axes)]


print(f"OpenCV {cv2.__version__}")
programs = {"onnxruntime": by_onnxruntime, "OpenCV": by_opencv, "reference": by_reference}
converted = version_converter.convert_version(network(11, axis=1), 13)
old, new = ["picture", "classes", "classes"], ["classes"] * 3
for words, model, wanted in (
    ("opset 11, axis=1", network(11, axis=1), old),
    ("opset 12, axis=1", network(12, axis=1), old),
    ("opset 13, axis=1", network(13, axis=1), new),
    ("opset 11, no axis", network(11), ["picture", "classes", "row"]),
    ("11 converted to 13", converted, ["picture"] * 3),
):
    found = []
    for name, program in programs.items():
        probabilities = program(model)
        assert probabilities.shape == scores.shape
        found.append(what_adds_to_one(probabilities))
        road = probabilities[0, 1] > 0.5
        print(f"  {words}, {name}: adds to 1 over the {found[-1]}; road is {road.mean():.0%}")
        assert np.array_equal(road, truth & (found[-1] == "classes"))
        if found[-1] != "row":
            assert np.array_equal(probabilities.argmax(1), scores.argmax(1))
    assert found == wanted, found
PYTHON
done

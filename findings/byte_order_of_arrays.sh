#!/usr/bin/env bash
# OpenCV and onnxruntime take an array of big-endian numbers, and read each number the wrong way round.
#
# Software: opencv-python-headless 5.0.0.93 and 4.14.0.94, onnxruntime 1.32.0, Pillow 13.0.0.
#
# Pillow opens a 16-bit TIFF file whose bytes are big-endian, as ImageJ writes them, and
# `numpy.asarray` of the image has the type `>u2`. NumPy prints it, compares it and adds it up like
# any other array. OpenCV takes it without an error and sees 256 where 1 stands: a label image of the
# classes 1, 2 and 300 comes out of `resize`, `threshold`, `inRange` and `imencode` as 256, 512 and
# 11265. onnxruntime does the same to the input of a network: 1.0 as `>f4` is 4.6e-41 there, which a
# network takes for a black image. So are pixels of a ROS image with `is_bigendian` that
# `numpy.frombuffer` reads by their right type. `cv2.imread` of the file itself is right.
#
# Others raise (pyarrow: "Byte-swapped arrays not supported"; a group-by of pandas) or are right
# (SciPy). `array.astype(array.dtype.newbyteorder("="))` before OpenCV and onnxruntime mends it.
#
# Source: both compare the number of the array's type in NumPy, `NPY_USHORT` or `NPY_FLOAT`, which the
# two byte orders share (modules/python/src2/cv2_convert.cpp of OpenCV). Neither documentation says
# that an array has to have the machine's byte order.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 5.0.0.93 4.14.0.94; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    opencv-python-headless==$version onnxruntime==1.32.0 onnx==1.23.2 pillow==13.0.0 \
    numpy==2.4.6 scipy==1.17.1 pandas==3.1.1 pyarrow==26.0.1
  "$folder/$version/bin/python" - "$folder/labels.tif" <<'PYTHON'
import sys

import cv2
import numpy as np
import onnxruntime
import pandas as pd
import pyarrow as pa
from onnx import TensorProto, helper
from PIL import Image
from scipy import ndimage

PIXELS = np.array([[1, 2], [300, 2]])
WRONG = [[256, 512], [11265, 512]]
Image.frombytes("I;16B", (2, 2), PIXELS.astype(">u2").tobytes()).save(sys.argv[1])

labels = np.asarray(Image.open(sys.argv[1]))
print(f"OpenCV {cv2.__version__}, onnxruntime {onnxruntime.__version__}; from Pillow: {labels.dtype}")
assert labels.dtype == ">u2"
assert np.array_equal(labels, PIXELS) and labels.max() == 300
assert np.array_equal(cv2.imread(sys.argv[1], cv2.IMREAD_UNCHANGED), PIXELS)

resized = cv2.resize(labels, (2, 2), interpolation=cv2.INTER_NEAREST)
stored = cv2.imdecode(cv2.imencode(".png", labels)[1], cv2.IMREAD_UNCHANGED)
print("NumPy:", labels.tolist(), "OpenCV:", resized.tolist())
assert resized.tolist() == stored.tolist() == WRONG
assert cv2.inRange(labels, 1, 2).tolist() == [[0, 0], [0, 0]]
assert cv2.threshold(labels, 200, 1, cv2.THRESH_BINARY)[1].all()

graph = helper.make_graph(
    [helper.make_node("Identity", ["image"], ["same"])],
    "network",
    [helper.make_tensor_value_info("image", TensorProto.FLOAT, [3])],
    [helper.make_tensor_value_info("same", TensorProto.FLOAT, [3])],
)
model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10)
session = onnxruntime.InferenceSession(
    model.SerializeToString(), providers=["CPUExecutionProvider"]
)
image = np.array([1, 0.5, 0.25], ">f4")
(same,) = session.run(None, {"image": image})
print("NumPy:", image.tolist(), "onnxruntime:", same.tolist())
assert same.tobytes() == image.tobytes() and (same < 1e-40).all()

native = labels.astype(labels.dtype.newbyteorder("="))
assert np.array_equal(cv2.resize(native, (2, 2), interpolation=cv2.INTER_NEAREST), PIXELS)
(same,) = session.run(None, {"image": image.astype(image.dtype.newbyteorder("="))})
assert same.tolist() == image.tolist()

assert np.array_equal(ndimage.zoom(labels, 1), PIXELS)
for name, call in (
    ("pyarrow", lambda: pa.array(labels.ravel())),
    ("pandas", lambda: pd.DataFrame({"label": labels.ravel()}).groupby("label").size()),
):
    try:
        call()
    except (ValueError, NotImplementedError) as error:
        print(f"{name}: {type(error).__name__}: {error}")
    else:
        raise SystemExit(f"{name} takes such an array now")
PYTHON
done

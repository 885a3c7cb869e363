"""Small networks written by hand, and the same computed in NumPy."""

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

IMAGE = "image"
ROAD = "road"
SIZE = (16, 12)
"""Width and height of the input."""
WIDE = {"kernel_shape": [3, 3], "pads": [1] * 4, "strides": [2, 2]}


def weights(classes: int = 2, seed: int = 0) -> dict[str, np.ndarray]:
    """A convolution of 3x3 with stride 2, and one of 1x1 that makes the classes."""
    rng = np.random.default_rng(seed)
    shapes = {"w1": (4, 3, 3, 3), "b1": (4,), "w2": (classes, 4, 1, 1), "b2": (classes,)}
    return {name: rng.normal(size=shape).astype(np.float32) for name, shape in shapes.items()}


def network(
    path: Path,
    *,
    classes: int = 2,
    values: dict[str, np.ndarray] | None = None,
    last: str | None = None,
    input_shape: tuple = (1, 3, SIZE[1], SIZE[0]),
    operator: str = "Relu",
    dtype: int = TensorProto.FLOAT,
    metadata: dict[str, str] | None = None,
    spare: bool = False,
) -> Path:
    """Write a network of two convolutions.

    ``last`` is the operator that makes the output of the second, ``operator`` the one between
    them, ``spare`` adds the first one's result as a second output.
    """
    values = weights(classes) if values is None else values
    layout = [helper.make_node("Cast", [IMAGE], ["float"], to=TensorProto.FLOAT)]
    channels_last = input_shape[-1] in (1, 3)
    source = "float"
    if channels_last:
        layout.append(helper.make_node("Transpose", ["float"], ["planes"], perm=[0, 3, 1, 2]))
        source = "planes"
    scores = "scores" if last or channels_last else ROAD
    nodes = [
        *layout,
        helper.make_node("Conv", [source, "w1", "b1"], ["c1"], **WIDE),
        helper.make_node(operator, ["c1"], ["r1"]),
        helper.make_node("Conv", ["r1", "w2", "b2"], [scores], kernel_shape=[1, 1]),
    ]
    if last:
        axis = {"axis": 1} if last in ("Softmax", "ArgMax") else {}
        nodes.append(helper.make_node(last, [scores], ["made" if channels_last else ROAD], **axis))
    if channels_last:
        made = "made" if last else scores
        nodes.append(helper.make_node("Transpose", [made], [ROAD], perm=[0, 2, 3, 1]))
    kind = TensorProto.INT64 if last == "ArgMax" else TensorProto.FLOAT
    outputs = [helper.make_tensor_value_info(ROAD, kind, ["n", "c", "h", "w"])]
    if spare:
        outputs.append(helper.make_tensor_value_info("r1", TensorProto.FLOAT, [1, 4, "h", "w"]))
    graph = helper.make_graph(
        nodes,
        "small",
        [helper.make_tensor_value_info(IMAGE, dtype, input_shape)],
        outputs,
        [numpy_helper.from_array(array, name) for name, array in values.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    helper.set_model_props(model, metadata or {})
    onnx.save(model, path)
    return path


def by_ultralytics(path, names, **more):
    """Give a network the metadata of one that Ultralytics has exported."""
    model = onnx.load(path)
    stated = {"author": "Ultralytics", "task": "semantic", "names": str(names), **more}
    helper.set_model_props(model, {key: str(value) for key, value in stated.items()})
    onnx.save(model, path)
    return path


def written(path: Path, nodes: list, values: dict | None = None, **opened) -> Path:
    """Write the network of some nodes, which make ``road`` of the image, a float of 0 to 1.

    ``opened`` are the ``shape`` and the type ``kind`` of ``road`` as the file states them, the
    ``size`` of the image, and ``functions`` of the model.
    """
    kind, shape = opened.get("kind", TensorProto.FLOAT), opened.get("shape")
    width, height = opened.get("size", SIZE)
    graph = helper.make_graph(
        nodes,
        "written",
        [helper.make_tensor_value_info(IMAGE, TensorProto.FLOAT, (1, 3, height, width))],
        [helper.make_tensor_value_info(ROAD, kind, shape)],
        [numpy_helper.from_array(np.array(value), name) for name, value in (values or {}).items()],
    )
    model = helper.make_model(
        graph,
        opset_imports=[helper.make_opsetid(name, 17 - 16 * bool(name)) for name in ("", "own")],
        ir_version=8,
        functions=opened.get("functions", ()),
    )
    onnx.save(model, path)
    return path


def without_end(condition: str) -> onnx.NodeProto:
    """A loop that makes ``road`` of the image, and goes on for as long as a condition holds."""
    body = helper.make_graph(
        [
            helper.make_node("Identity", ["go"], ["on"]),
            helper.make_node("Identity", ["was"], ["is"]),
        ],
        "body",
        [
            helper.make_tensor_value_info("turn", TensorProto.INT64, ()),
            helper.make_tensor_value_info("go", TensorProto.BOOL, ()),
            helper.make_tensor_value_info("was", TensorProto.FLOAT, None),
        ],
        [
            helper.make_tensor_value_info("on", TensorProto.BOOL, ()),
            helper.make_tensor_value_info("is", TensorProto.FLOAT, None),
        ],
    )
    return helper.make_node("Loop", ["", condition, IMAGE], [ROAD], body=body)


def scores(values: dict[str, np.ndarray], planes: np.ndarray) -> np.ndarray:
    """Return the network's output for ``(3, H, W)``: ``(C, H / 2, W / 2)``."""
    wide = np.pad(planes, ((0, 0), (1, 1), (1, 1)))
    rows, columns = (size // 2 for size in planes.shape[1:])
    hidden = np.zeros((4, rows, columns))
    for row in range(3):
        for column in range(3):
            taken = wide[:, row : row + 2 * rows : 2, column : column + 2 * columns : 2]
            hidden += np.tensordot(values["w1"][:, :, row, column], taken, 1)
    hidden = np.maximum(hidden + values["b1"][:, None, None], 0)
    return np.tensordot(values["w2"][:, :, 0, 0], hidden, 1) + values["b2"][:, None, None]


def balanced(image: np.ndarray, classes: int = 2) -> dict[str, np.ndarray]:
    """Weights by which half of an image of the input's size is road, the last class."""
    values = weights(classes)
    logits = scores(values, image.transpose(2, 0, 1) / 255)
    others = logits[:-1].max(axis=0) if classes > 1 else 0
    values["b2"][-1] -= np.float32(np.median(logits[-1] - others))
    return values


def red_network(path: Path, size: tuple[int, int] = (32, 24), bias: float = -105.0) -> Path:
    """Write a network that calls pixels road if their red is above 105 of 255, or another bias."""
    values = {
        "w": np.array([50, 0, 0], np.float32).reshape(1, 3, 1, 1),
        "b": np.array([50 * bias / 255], np.float32),
    }
    shape = (1, 3, size[1], size[0])
    graph = helper.make_graph(
        [
            helper.make_node("Conv", [IMAGE, "w", "b"], ["s"], kernel_shape=[1, 1]),
            helper.make_node("Sigmoid", ["s"], [ROAD]),
        ],
        "red",
        [helper.make_tensor_value_info(IMAGE, TensorProto.FLOAT, shape)],
        [helper.make_tensor_value_info(ROAD, TensorProto.FLOAT, (1, 1, *shape[2:]))],
        [numpy_helper.from_array(array, name) for name, array in values.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    helper.set_model_props(model, {"license": "CC0: made by hand"})
    onnx.save(model, path)
    return path

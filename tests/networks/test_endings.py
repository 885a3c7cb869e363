"""Forty ways in which a network may end, all with the same road: where blue is below one half."""

import cv2
import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper
from PIL import Image

from roadeval.networks import NetSettings, Network, NetworkError
from roadeval.networks.network import fit_image, input_values
from tests.networks.making import IMAGE, ROAD, SIZE, by_ultralytics, network, written

pytestmark = pytest.mark.usefixtures("opened_here_alone")

RNG = np.random.default_rng(3)
EXPECTED = RNG.integers(0, 2, (SIZE[1], SIZE[0]), np.uint8)
FRAME = np.stack([RNG.integers(0, 256, EXPECTED.shape)] * 2 + [255 - 200 * EXPECTED - 20], axis=-1)
FRAME = FRAME.astype(np.uint8)

HALF, FLOAT, DOUBLE = TensorProto.FLOAT16, TensorProto.FLOAT, TensorProto.DOUBLE
WEIGHTS = {
    "w1": np.float32([0, 0, -12]).reshape(1, 3, 1, 1),
    "b1": np.float32([6]),
    "w2": np.float32([[0, 0, 0], [0, 0, -12]]).reshape(2, 3, 1, 1),
    "b2": np.float32([0, 6]),
    "zero": np.float32(0),
    "one": np.float32(1),
    "half": np.float32(0.5),
    "first": np.int64([0]),
    "last": np.int64([1]),
    "end": np.int64([2]),
    "axis": np.int64([1]),
    "second": np.int64(1),
    "fine": np.float32(1 / 255),
    "coarse": np.float32(0.1),
    "bottom": np.uint8(0),
    "middle": np.int8(0),
    "three": np.int64(3),
    "seven": np.int64(7),
}
ONE, TWO = "Conv w1 b1", "Conv w2 b2"
"""The logit of road, and those of the rest and of road."""
MAP = f"{TWO}; ArgMax axis=1"
ROUND = "QuantizeLinear fine bottom; DequantizeLinear fine bottom"
ROUGH = "QuantizeLinear coarse middle; DequantizeLinear coarse middle"

PROBABILITIES = [
    f"{ONE}; Sigmoid",
    f"{ONE}; Sigmoid; Identity",
    f"{ONE}; Sigmoid; Add zero",
    f"{ONE}; Sigmoid; Mul one",
    f"{ONE}; Sigmoid; {ROUND}",
    f"{ONE}; {ROUGH}; Sigmoid; {ROUND}",
    f"{ONE}; Sigmoid; Cast to={HALF}",
    f"{ONE}; Sigmoid; Cast to={DOUBLE}",
    f"{ONE}; Sigmoid; Cast to={HALF}; Cast to={FLOAT}",
    f"{ONE}; Sigmoid; Clip zero one",
    f"{ONE}; Sigmoid; Squeeze axis",
    f"{ONE}; Sigmoid; Mean @; Add zero",
    f"{ONE}; Neg; Sigmoid; Neg; Add one",
    f"{ONE}; HardSigmoid",
    f"{TWO}; Softmax axis=1",
    f"{TWO}; Softmax axis=1; {ROUND}",
    f"{TWO}; Softmax axis=1; Mul one",
    f"{TWO}; Softmax axis=1; Gather second axis=1",
    f"{TWO}; Softmax axis=1; Gather last axis=1",
    f"{TWO}; Softmax axis=1; Slice last end axis",
    f"{TWO}; Softmax axis=1; Slice last end axis; {ROUND}",
    f"{TWO}; Softmax axis=1; Cast to={HALF}",
    f"{TWO}; Sigmoid; Gather last axis=1",
]
LOGITS = [
    ONE,
    f"{ONE}; Identity",
    f"{ONE}; Mul half",
    f"{ONE}; {ROUGH}",
    f"{ONE}; Cast to={HALF}",
    f"{ONE}; Squeeze axis",
    TWO,
    f"{TWO}; {ROUGH}",
    f"{TWO}; LogSoftmax axis=1",
]
MAPS = {
    MAP: 1,
    f"{MAP} keepdims=0": 1,
    f"{MAP}; Cast to={FLOAT}": 1,
    f"{MAP}; Cast to={HALF}": 1,
    f"{MAP}; Cast to={TensorProto.UINT8}": 1,
    f"{TWO}; Neg; ArgMax axis=1; Cast to={FLOAT}": 0,
    f"{ONE}; Greater zero": 1,
    f"{ONE}; Greater zero; Cast to={FLOAT}": 1,
    f"{ONE}; Greater zero; Where seven three; Cast to={FLOAT}": 7,
}


def ended(path, ending, size=SIZE):
    """Write a network of operators, one after the other, each with further inputs and settings."""
    nodes, before = [], IMAGE
    *steps, last = ending.split("; ")
    for place, step in enumerate([*steps, last]):
        operator, *rest = step.split()
        settings = dict(part.split("=") for part in rest if "=" in part)
        more = [before if part == "@" else part for part in rest if "=" not in part]
        after = ROAD if place == len(steps) else f"made {place}"
        numbers = {name: int(value) for name, value in settings.items()}
        nodes.append(helper.make_node(operator, [before, *more], [after], **numbers))
        before = after
    kinds = {"ArgMax": TensorProto.INT64, "Greater": TensorProto.BOOL}
    kind = int(last.partition("to=")[2] or kinds.get(last.split()[0], FLOAT))
    return written(path, nodes, WEIGHTS, kind=kind, size=size)


def road_of(path, ending, frame=FRAME, **settings):
    net = Network.of(NetSettings(file=str(ended(path, ending)), **settings))
    return net, net.road(frame).mask.pixels()


@pytest.mark.parametrize("ending", [*PROBABILITIES, *LOGITS, *MAPS])
def test_however_a_network_ends_its_road_is_the_same(ending, tmp_path):
    chosen = {"road": (MAPS[ending],)} if ending in MAPS else {}
    net, mask = road_of(tmp_path / "n.onnx", ending, **chosen)
    assert np.array_equal(mask, EXPECTED)
    kind = "probabilities" if ending in PROBABILITIES else "logits"
    assert net.facts()["taken_for"] == ("classes" if ending in MAPS else kind)


def test_logits_are_interpolated_and_not_probabilities(tmp_path):
    frame = cv2.resize(FRAME, (37, 29), interpolation=cv2.INTER_NEAREST)
    blue = cv2.resize(frame, SIZE)[..., 2].astype(np.float32)
    expected = cv2.resize(0.5 - blue / 255, (37, 29)) > 0
    for ending in (ONE, TWO, f"{TWO}; LogSoftmax axis=1"):
        _, mask = road_of(tmp_path / "n.onnx", ending, frame)
        assert np.array_equal(mask, expected)


def test_logits_that_are_called_probabilities_are_refused(tmp_path):
    with pytest.raises(NetworkError, match=r"no probabilities; see `net\.activation`"):
        road_of(tmp_path / "n.onnx", ONE, activation="none")


def test_scores_of_several_classes_are_no_map_of_classes(tmp_path):
    with pytest.raises(NetworkError, match="no map of the image"):
        road_of(tmp_path / "n.onnx", TWO, activation="classes", road=(1,))


def test_whole_numbers_that_are_quantised_probabilities_are_no_classes(tmp_path):
    ending = f"{ONE}; Mul half; Sigmoid; QuantizeLinear fine bottom; Cast to={TensorProto.UINT8}"
    path = ended(tmp_path / "n.onnx", ending, (160, 120))
    with pytest.raises(NetworkError, match="DequantizeLinear"):
        Network.of(NetSettings(file=str(path), road=(1,)))


@pytest.mark.parametrize("road", [None, (0,), (1,)])
def test_of_a_single_class_ultralytics_writes_road_as_1(road, tmp_path):
    """``pred.gt(0)`` in ``SemanticSegmentationPredictor.postprocess``, and in its export."""
    path = ended(tmp_path / "n.onnx", f"{ONE}; Greater zero; Cast to={TensorProto.UINT8}")
    net = Network.of(NetSettings(file=str(by_ultralytics(path, {0: "road"})), road=road))
    assert np.array_equal(net.road(FRAME).mask.pixels(), EXPECTED)
    assert (net.settings.road, net.settings.resize) == ((1,), "letterbox")


def test_of_several_classes_ultralytics_names_say_which_is_road(tmp_path):
    path = by_ultralytics(ended(tmp_path / "n.onnx", MAP), {0: "car", 1: "road"})
    assert np.array_equal(
        Network.of(NetSettings(file=str(path))).road(FRAME).mask.pixels(), EXPECTED
    )


def test_class_maps_of_ultralytics_come_back_as_its_own_do(tmp_path):
    """By ``torch.nn.functional.interpolate(mode="nearest")``: the pixel at or before the place."""
    path = by_ultralytics(ended(tmp_path / "n.onnx", MAP), {0: "car", 1: "road"})
    frame = cv2.resize(FRAME, (40, 30), interpolation=cv2.INTER_NEAREST)
    net = Network.of(NetSettings(file=str(path)))
    small = net.road(cv2.resize(frame, SIZE)).mask.pixels()
    rows, columns = (np.arange(n) * m // n for n, m in zip((30, 40), (12, 16), strict=True))
    assert np.array_equal(net.road(frame).mask.pixels(), small[np.ix_(rows, columns)])


@pytest.mark.parametrize("size", [(37, 29), (16, 12), (9, 31), (80, 60)])
@pytest.mark.parametrize("antialias", [True, "bicubic"])
def test_an_antialiased_image_is_pillows(antialias, size):
    settings = NetSettings(file="n", size=size, resize="stretch", antialias=antialias)
    image = RNG.integers(0, 256, (47, 61, 3), np.uint8)
    how = Image.Resampling.BILINEAR if antialias is True else Image.Resampling.BICUBIC
    expected = np.asarray(Image.fromarray(image).resize(size, how))
    assert np.array_equal(fit_image(image, settings), expected)


@pytest.mark.parametrize("dtype", ["float16", "float32"])
def test_levels_become_the_values_that_a_division_by_255_gives(dtype):
    """As makers' code divides; half precision tells a product with 1/255 from it."""
    settings = NetSettings(scale=1 / 255, mean=(0.0,), deviation=(1.0,), layout="NHWC")
    levels = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    values = input_values(levels, settings, dtype)[0]
    assert np.array_equal(values, levels.astype(dtype) / np.dtype(dtype).type(255))


@pytest.mark.parametrize("sign", ["task", "boxes", "queries", "their lengths"])
def test_a_network_that_finds_instances_is_called_so(sign, tmp_path):
    path = network(tmp_path / "n.onnx", spare=True)
    if sign == "task":
        by_ultralytics(path, {0: "road"}, task="segment")
    elif sign == "their lengths":
        model = onnx.load(path)
        net = helper.make_tensor_value_info("found", TensorProto.FLOAT, (1, 2, 48))
        length = helper.make_node("Constant", [], ["lengths"], value_ints=[1, 2, 48])
        model.graph.node.extend([length, helper.make_node("Reshape", [ROAD, "lengths"], ["found"])])
        model.graph.output.append(net)
        onnx.save(model, path)
    else:
        model = onnx.load(path)
        model.graph.node[-1].output[0] = model.graph.output[0].name = f"pred_{sign}"
        onnx.save(model, path)
    with pytest.raises(NetworkError, match=r"finds instances.*semantic"):
        Network.of(NetSettings(file=str(path)))

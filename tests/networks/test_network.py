"""A network's mask, the one that NumPy computes; what is read of its file, and asked for."""

import hashlib
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper
from onnx.external_data_helper import set_external_data

from roadeval.data import CERTAIN
from roadeval.networks import NetSettings, Network, NetworkError
from roadeval.networks.onnx_file import weight_files
from tests.networks.making import IMAGE as MADE
from tests.networks.making import ROAD, SIZE, balanced, network, scores, without_end, written

pytestmark = pytest.mark.usefixtures("opened_here_alone")

IMAGE = np.random.default_rng(5).integers(0, 256, (12, 16, 3), np.uint8)
"""An image of the input's size."""
FRAME = cv2.resize(IMAGE, (48, 30), interpolation=cv2.INTER_CUBIC)


def opened(path, **settings) -> Network:
    return Network.of(NetSettings(file=str(path), **settings))


def framed(values, size=SIZE):
    """Each plane, brought to a frame's size."""
    return np.stack([cv2.resize(plane.astype(np.float32), size) for plane in values])


def softmax(values):
    powers = np.exp(values - values.max(axis=0))
    return powers / powers.sum(axis=0)


def test_the_mask_is_the_one_that_numpy_computes(tmp_path):
    values = balanced(IMAGE)
    road = opened(network(tmp_path / "n.onnx", values=values)).road(IMAGE)
    expected = softmax(framed(scores(values, IMAGE.transpose(2, 0, 1) / 255)))[1]
    assert np.abs(road.probability / CERTAIN - expected).max() < 1e-4
    assert np.array_equal(road.mask.pixels(), expected > 0.5)
    assert 0.2 < road.mask.pixels().mean() < 0.8


@pytest.mark.parametrize("classes", [1, 2, 3])
@pytest.mark.parametrize("decide", [None, "threshold", "argmax"])
def test_a_threshold_is_heeded_whatever_decides(classes, decide, tmp_path):
    path = network(tmp_path / "n.onnx", classes=classes, values=balanced(IMAGE, classes))
    if classes == 1 and decide == "argmax":
        return
    reader = opened(path, threshold=0.7, decide=decide, road=(classes - 1,))
    road = reader.road(FRAME)
    assert reader.settings.decide == (decide or "threshold")
    assert np.array_equal(road.mask.pixels(), road.probability > round(0.7 * CERTAIN))


def test_a_threshold_on_classes_alone_is_refused(tmp_path):
    with pytest.raises(NetworkError, match=r"`net\.threshold`"):
        opened(network(tmp_path / "n.onnx", last="ArgMax"), road=(1,), threshold=0.7)


def test_of_three_classes_road_is_where_it_beats_the_others(tmp_path):
    values = balanced(IMAGE, 3)
    path = network(tmp_path / "n.onnx", classes=3, values=values)
    road = opened(path, road=(2,)).road(IMAGE)
    logits = framed(scores(values, IMAGE.transpose(2, 0, 1) / 255))
    assert np.array_equal(road.mask.pixels(), logits.argmax(axis=0) == 2)


@pytest.mark.parametrize("last", [None, "Softmax"])
def test_the_probability_of_road_is_the_sum_over_its_classes(last, tmp_path):
    values = balanced(IMAGE, 3)
    path = network(tmp_path / "n.onnx", classes=3, values=values, last=last)
    road = opened(path, road=(0, 2), decide="threshold").road(IMAGE)
    logits = scores(values, IMAGE.transpose(2, 0, 1) / 255)
    # Logits are interpolated where there are any.
    shares = framed(softmax(logits)) if last else softmax(framed(logits))
    assert np.abs(road.probability / CERTAIN - shares[0] - shares[2]).max() < 1e-4
    for codes, number in zip(road.by_class, (0, 2), strict=True):
        assert np.abs(codes / CERTAIN - shares[number]).max() < 1e-4


def test_classes_are_brought_to_the_frame_by_the_nearest_pixel(tmp_path):
    values = balanced(IMAGE)
    path = network(tmp_path / "n.onnx", values=values, last="ArgMax")
    road = opened(path, road=(1,)).road(IMAGE)
    expected = scores(values, IMAGE.transpose(2, 0, 1) / 255).argmax(axis=0).astype(np.uint8)
    assert np.array_equal(road.mask.pixels(), expected.repeat(2, axis=0).repeat(2, axis=1))
    assert road.probability is None


def test_channels_scale_mean_and_deviation_are_applied_in_this_order(tmp_path):
    values = balanced(IMAGE)
    mean, deviation = (0.4, 0.5, 0.6), (0.2, 0.25, 0.3)
    road = opened(
        network(tmp_path / "n.onnx", values=values), channels="bgr", mean=mean, deviation=deviation
    ).road(IMAGE)
    planes = ((IMAGE[..., ::-1] / 255 - mean) / deviation).transpose(2, 0, 1)
    expected = softmax(framed(scores(values, planes)))[1]
    assert np.abs(road.probability / CERTAIN - expected).max() < 1e-4


@pytest.mark.parametrize("last", [None, "Sigmoid"])
def test_channels_can_come_last(last, tmp_path):
    values = balanced(IMAGE)
    first = network(tmp_path / "first.onnx", values=values, last=last)
    tail = network(tmp_path / "last.onnx", values=values, last=last, input_shape=(1, 12, 16, 3))
    one, other = (opened(path).road(FRAME) for path in (first, tail))
    assert np.array_equal(one.mask.pixels(), other.mask.pixels())
    assert opened(tail).settings.layout == "NHWC"


def test_whole_numbers_are_handed_over_as_they_are(tmp_path):
    values = balanced(IMAGE)
    values["w1"] /= 255
    path = network(tmp_path / "n.onnx", values=values, dtype=2)
    road = opened(path).road(IMAGE)
    plain = opened(network(tmp_path / "p.onnx", values=balanced(IMAGE))).road(IMAGE)
    assert np.abs(road.probability.astype(int) - plain.probability).max() <= 2


def test_a_letterbox_shows_the_whole_frame_and_no_more(tmp_path):
    path = network(tmp_path / "n.onnx", classes=1, values=_everywhere(1))
    tall = np.zeros((64, 20, 3), np.uint8)
    assert opened(path, resize="letterbox").road(tall).mask.pixels().all()


def test_of_several_outputs_road_is_what_one_of_them_calls_road(tmp_path):
    path = network(tmp_path / "n.onnx", values=balanced(IMAGE), spare=True)
    alone, other = (opened(path, outputs=(n,), road=(1,)) for n in ("road", "r1"))
    both = opened(path, outputs=("road", "r1"), road=(1,)).road(IMAGE)
    expected = np.maximum(alone.road(IMAGE).probability, other.road(IMAGE).probability)
    assert np.array_equal(both.probability, expected)


def test_threads_disturb_each_other_in_nothing(tmp_path):
    reader = opened(network(tmp_path / "n.onnx", values=balanced(IMAGE)))
    frames = [np.roll(FRAME, shift, axis=1) for shift in range(24)]
    alone = [reader.road(frame).probability for frame in frames]
    with ThreadPoolExecutor(8) as pool:
        together = [road.probability for road in pool.map(reader.road, frames)]
    assert all(map(np.array_equal, alone, together))


def _depending(path, *nodes, **values):
    """A network of two classes whose output an image changes that is not black."""
    first = [
        helper.make_node("ReduceMax", [MADE], ["most"], keepdims=0),
        helper.make_node("Slice", [MADE, "zero", "two", "zero1"], ["scores"]),
    ]
    given = {"zero": [0], "one": [1], "zero1": [1], "two": [2], "none": np.float32(0), **values}
    return written(path, [*first, *nodes], given)


def test_numbers_that_are_none_are_an_error_of_a_network_with_a_softmax_inside(tmp_path):
    nodes = [
        helper.make_node("Greater", ["scores", "high"], ["is high"]),
        helper.make_node("Where", ["is high", "nan", "scores"], ["unclean"]),
        helper.make_node("Softmax", ["unclean"], [ROAD], axis=1),
    ]
    path = _depending(tmp_path / "n.onnx", *nodes, high=np.float32(0.9), nan=np.float32(np.nan))
    reader = opened(path)
    assert reader.settings.activation == "none"
    with pytest.raises(NetworkError, match="NaN"):
        reader.road(FRAME)


def test_a_shape_that_depends_on_the_image_is_an_error(tmp_path):
    nodes = [
        helper.make_node("Greater", ["most", "none"], ["bright"]),
        helper.make_node("Cast", ["bright"], ["more"], to=7),
        helper.make_node("Reshape", ["more", "one"], ["one more"]),
        helper.make_node("Add", ["one more", "two"], ["count"]),
        helper.make_node("Slice", [MADE, "zero", "count", "zero1"], [ROAD]),
    ]
    path = _depending(tmp_path / "n.onnx", *nodes)
    with pytest.raises(NetworkError, match="'road' depends on the image"):
        opened(path)


def test_a_loop_that_ends_on_black_images_alone_is_ended(tmp_path):
    nodes = [
        helper.make_node("ReduceMax", [MADE], ["most"], keepdims=0),
        helper.make_node("Greater", ["most", "none"], ["bright"]),
        without_end("bright"),
    ]
    path = written(tmp_path / "n.onnx", nodes, {"none": np.float32(0)})
    with pytest.raises(NetworkError, match=r"takes longer than 0\.5 s"):
        opened(path, seconds=0.5, road=(0,))


def _everywhere(classes):
    values = balanced(IMAGE, classes)
    values["w2"][:] = 0
    values["b2"][:] = 9.5
    return values


def read(path, **settings) -> NetSettings:
    return Network.of(NetSettings(file=str(path), **settings)).settings


def refusal(path, **settings) -> str:
    with pytest.raises(NetworkError) as caught:
        read(path, **settings)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message


def test_everything_is_stated_of_a_network_of_two_classes(tmp_path):
    settings = read(network(tmp_path / "n.onnx"))
    assert (settings.size, settings.layout, settings.channels) == ((16, 12), "NCHW", "rgb")
    assert (settings.scale, settings.mean, settings.deviation) == (1 / 255, (0.0,), (1.0,))
    assert (settings.outputs, settings.road, settings.decide) == (("road",), (1,), "argmax")
    assert settings.activation == "softmax"


def test_another_file_than_the_stated_one_is_refused(tmp_path):
    settings = read(network(tmp_path / "n.onnx"))
    network(tmp_path / "n.onnx", last="Softmax")
    with pytest.raises(NetworkError, match="another network than was asked for"):
        Network.of(settings)


# --- What is asked for ----------------------------------------------------------------------------

ASKED = {
    "a size that it does not take": ({}, {"size": (20, 20)}, "takes no input of 20x20"),
    "which of several outputs": (
        {"spare": True},
        {},
        "name those that show road by `net.outputs`",
    ),
    "an output that is not there": ({}, {"outputs": ("seg",)}, "has no output 'seg'"),
    "which of three classes": (
        {"classes": 3},
        {},
        "give the numbers of those that are road by `net.road`",
    ),
    "which labels": ({"last": "ArgMax"}, {}, "`net.road`"),
    "a class that is not there": ({}, {"road": (2,)}, "has no class 2, but 2 from 0"),
    "one class beats no other": ({"classes": 1}, {"decide": "argmax"}, "`net.decide`"),
    "four images at once": (
        {"input_shape": (4, 3, 12, 16)},
        {},
        "takes 4 images at once: export it with a batch of one",
    ),
    "whole numbers of a scale": ({"dtype": TensorProto.INT8}, {}, "by a scale"),
    "five channels": ({"input_shape": (1, 5, 12, 16)}, {}, "inputs: image"),
    "an operator that is not known": ({"operator": "Unheard"}, {}, "cannot run the network: "),
    "an output that is no map": ({"last": "GlobalAveragePool"}, {}, "is no map of the image"),
    "numbers that no image has": ({"dtype": TensorProto.INT64}, {}, "takes no image"),
}


@pytest.mark.parametrize("what", ASKED)
def test_what_a_network_leaves_open_or_cannot_take_is_said(what, tmp_path):
    made, settings, message = ASKED[what]
    assert message in refusal(network(tmp_path / "n.onnx", **made), **settings)


def test_a_size_that_is_left_open(tmp_path):
    path = network(tmp_path / "n.onnx", input_shape=("n", 3, "h", "w"))
    message = refusal(path)
    assert "`net.size`" in message
    assert "image float32 (?, 3, ?, ?)" in message
    assert read(path, size=(32, 24)).size == (32, 24)


def test_no_file(tmp_path):
    with pytest.raises(NetworkError, match=r"net\.file"):
        Network.of(NetSettings())


# --- Facts read from an ONNX file, and files that cannot be used ----------------------------------


def file_of(path):
    return Network.of(NetSettings(file=str(path), outputs=("road",))).file


def refused(path) -> str:
    with pytest.raises(NetworkError) as caught:
        file_of(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message


def with_weights_beside(folder):
    model = onnx.load(network(folder / "whole.onnx"))
    path = folder / "n.onnx"
    onnx.save(model, path, save_as_external_data=True, location="n.data", size_threshold=0)
    return path


def test_weights_beside_the_file_are_part_of_the_digest(tmp_path):
    path = with_weights_beside(tmp_path)
    both = path.read_bytes() + (tmp_path / "n.data").read_bytes()
    assert file_of(path).sha256 == hashlib.sha256(both).hexdigest()


def _beside(value: float = 1.0) -> onnx.TensorProto:
    """A weight that lies in n.data."""
    tensor = numpy_helper.from_array(np.float32([value]), "w")
    set_external_data(tensor, "n.data")
    tensor.ClearField("raw_data")
    return tensor


def _constant(output: str = "w") -> onnx.NodeProto:
    return helper.make_node("Constant", [], [output], value=_beside())


def _in_a_branch(path, deep: bool) -> None:
    result = [helper.make_tensor_value_info("made", TensorProto.FLOAT, None)]
    add = helper.make_node("Add", [MADE, "w"], ["made"])
    held = ([_constant(), add], [], result) if deep else ([add], [], result, [_beside()])
    branch = helper.make_graph(held[0], "branch", *held[1:])
    choice = helper.make_node("If", ["yes"], [ROAD], then_branch=branch, else_branch=branch)
    written(path, [choice], {"yes": True})


def _in_a_function(path) -> None:
    nodes = [_constant(), helper.make_node("Add", ["x", "w"], ["y"])]
    opset = [helper.make_opsetid("", 17)]
    function = helper.make_function("own", "plus", ["x"], ["y"], nodes, opset)
    call = helper.make_node("plus", [MADE], [ROAD], domain="own")
    written(path, [call], functions=[function])


REACHED = {
    "a constant": lambda path: written(
        path, [_constant(), helper.make_node("Add", [MADE, "w"], [ROAD])]
    ),
    "a branch": lambda path: _in_a_branch(path, deep=False),
    "a constant in a branch": lambda path: _in_a_branch(path, deep=True),
    "a function": _in_a_function,
}


@pytest.mark.parametrize("by", REACHED)
def test_weights_beside_the_file_are_part_of_the_digest_however_they_are_reached(by, tmp_path):
    path, digests = tmp_path / "n.onnx", []
    REACHED[by](path)
    for value in (1, 2):
        (tmp_path / "n.data").write_bytes(np.float32([value]).tobytes())
        path.touch()
        both = hashlib.sha256(path.read_bytes() + (tmp_path / "n.data").read_bytes())
        digests.append(both.hexdigest())
        settings = NetSettings(file=str(path), size=SIZE, road=(0,))
        assert Network.of(settings).file.sha256 == digests[-1]
    assert len(set(digests)) == 2


def test_sparse_weights_beside_the_file_are_found():
    sparse = helper.make_sparse_tensor(
        _beside(), helper.make_tensor("i", TensorProto.INT64, [1], [0]), [4]
    )
    model = helper.make_model(helper.make_graph([], "g", [], [], sparse_initializer=[sparse]))
    assert [*weight_files(memoryview(model.SerializeToString()))] == ["n.data"]


@pytest.mark.parametrize("where", ["here", "in a branch"])
def test_a_loop_without_end_is_ended(where, tmp_path):
    nodes = [without_end("yes")]
    if where == "in a branch":
        result = [helper.make_tensor_value_info(ROAD, TensorProto.FLOAT, None)]
        branch = helper.make_graph(nodes, "branch", [], result)
        nodes = [helper.make_node("If", ["yes"], [ROAD], then_branch=branch, else_branch=branch)]
    path = written(tmp_path / "n.onnx", nodes, {"yes": True})
    with pytest.raises(NetworkError, match=r"takes longer than 0\.5 s or .* to run.*net\.seconds"):
        Network.of(NetSettings(file=str(path), seconds=0.5))


def test_a_loop_that_takes_ever_more_memory_is_ended(tmp_path):
    loop = without_end("yes")
    loop.output[:] = ["last", ROAD]
    loop.attribute[0].g.node.append(helper.make_node("Tile", ["was", "many"], ["kept"]))
    many = helper.make_tensor_value_info("kept", TensorProto.FLOAT, None)
    loop.attribute[0].g.output.append(many)
    values = {"yes": True, "many": np.int64([1, 1, 20, 20])}
    path = written(tmp_path / "n.onnx", [loop], values)
    with pytest.raises(NetworkError, match="or more than 64 MiB to run"):
        Network.of(NetSettings(file=str(path), megabytes=8))


def test_a_network_that_takes_too_long_to_open_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("roadeval.networks.onnx_file.LEAST_OPENING_S", 0.001)
    path = network(tmp_path / "n.onnx")
    with pytest.raises(NetworkError, match=r"takes longer than 0\.001 s to open.*net\.seconds"):
        Network.of(NetSettings(file=str(path), seconds=0.001))


SIZES = {
    "rows and columns, stated": ((12000, 16000), True, "takes 732 MiB"),
    "rows and columns": ((12000, 16000), False, "takes 732 MiB"),
    "classes, stated": ((9999, 120, 160), True, "takes 732 MiB"),
    "nothing": ((0, 12, 16), False, "no map of the image, but (1, 0, 12, 16)"),
    "five lengths": ((2, 3, 12, 16), False, "no map of the image, but (1, 2, 3, 12, 16)"),
}


@pytest.mark.parametrize("what", SIZES)
def test_an_output_that_is_too_large_or_no_map_is_refused(what, tmp_path):
    shape, stated, message = SIZES[what]
    node = helper.make_node("ConstantOfShape", ["shape"], ["zeros"])
    keep = helper.make_node("ReduceMax", [MADE], ["most"], keepdims=0)
    nodes = [node, keep, helper.make_node("Add", ["zeros", "most"], [ROAD])]
    values = {"shape": np.int64([1, *shape])}
    path = written(tmp_path / "n.onnx", nodes, values, shape=[1, *shape] if stated else None)
    assert message in refused(path)


@pytest.mark.parametrize("operator", ["SequenceConstruct", "ArgMax to text"])
def test_an_output_without_numbers_is_refused(operator, tmp_path):
    node = helper.make_node("Cast", [MADE], [ROAD], to=TensorProto.STRING)
    path = tmp_path / "n.onnx"
    written(path, [node], kind=TensorProto.STRING)
    if operator == "SequenceConstruct":
        model = onnx.load(path)
        model.graph.node[0].CopyFrom(helper.make_node(operator, [MADE], [ROAD]))
        kind = helper.make_tensor_type_proto(TensorProto.FLOAT, None)
        sequence = helper.make_sequence_type_proto(kind)
        model.graph.output[0].CopyFrom(helper.make_value_info(ROAD, sequence))
        onnx.save(model, path)
    assert "no array of numbers" in refused(path)


def test_a_missing_file(tmp_path):
    assert "cannot read the network: No such file" in refused(tmp_path / "n.onnx")


@pytest.mark.parametrize("content", [b"hello", b"\x89PNG\r\n\x1a\n", bytes(1000)])
def test_a_file_that_is_no_onnx(content, tmp_path):
    path = tmp_path / "n.onnx"
    path.write_bytes(content)
    assert "not an ONNX file" in refused(path)


@pytest.mark.parametrize(
    ("there", "other", "message"),
    [
        (b"Relu", b"Rel\xb4", "a damaged one"),
        (b"strides", b"strid\xffs", "a damaged one"),
        (b"road", b"ro\xffd", "(road) does not exist in the graph"),
        (b"c1", b"c7", "'c1' is not a graph input"),
        (b"B\x02w1J", b"B\x02w1\n", "cannot run the network"),
        (b"strides@\x02", b"strides@\x00", "strides must only contain positive values"),
    ],
    ids=[
        *("operator", "attribute", "output", "a tensor that nothing makes", "no numbers"),
        "a stride of 0",
    ],
)
def test_a_file_that_is_damaged_inside(there, other, message, tmp_path):
    path = network(tmp_path / "n.onnx")
    content = path.read_bytes()
    assert there in content
    path.write_bytes(content.replace(there, other, 1))
    assert message in refused(path)


def test_a_file_that_ends_the_process_which_opens_it(tmp_path):
    """A kernel larger than its input, cut by a slice: onnxruntime 1.32 aborts."""
    numbers = {
        "w": np.ones((1, 3, 1, 1), np.float32),
        **{name: np.array([n]) for name, n in (("start", 0), ("end", 9), ("axis", 2))},
    }
    graph = helper.make_graph(
        [
            helper.make_node("Conv", ["image", "w"], ["c"], kernel_shape=[99, 1]),
            helper.make_node("Slice", ["c", "start", "end", "axis"], ["road"]),
        ],
        "ending",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, (1, 3, 12, 16))],
        [helper.make_tensor_value_info("road", TensorProto.FLOAT, None)],
        [numpy_helper.from_array(array, name) for name, array in numbers.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    onnx.save(model, tmp_path / "n.onnx")
    assert "onnxruntime ends its process" in refused(tmp_path / "n.onnx")


def test_missing_weights_beside_the_file(tmp_path):
    path = with_weights_beside(tmp_path)
    (tmp_path / "n.data").unlink()
    assert "its weights lie in n.data beside it, which cannot be read" in refused(path)


@pytest.mark.parametrize("location", ["../n.data", "/etc/passwd", "a/../../n.data"])
def test_weights_outside_the_folder_are_not_read(location, tmp_path):
    path = with_weights_beside(tmp_path)
    model = onnx.load(path, load_external_data=False)
    for tensor in model.graph.initializer:
        tensor.external_data[0].value = location
    path.write_bytes(model.SerializeToString())
    assert "asks for weights outside its folder" in refused(path)

"""A network's mask, the one that NumPy computes; what is read of its file, and asked for."""

from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import pytest
from onnx import TensorProto, helper

from roadeval import data, networks
from tests.networks.making import IMAGE as MADE
from tests.networks.making import ROAD, SIZE, balanced, network, scores, without_end, written

pytestmark = pytest.mark.usefixtures("opened_here_alone")

IMAGE = np.random.default_rng(5).integers(0, 256, (12, 16, 3), np.uint8)
"""An image of the input's size."""
FRAME = cv2.resize(IMAGE, (48, 30), interpolation=cv2.INTER_CUBIC)


def opened(path, **settings) -> networks.Network:
    return networks.Network.of(networks.NetSettings(file=str(path), **settings))


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
    assert np.abs(road.probability / data.CERTAIN - expected).max() < 1e-4
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
    assert np.array_equal(road.mask.pixels(), road.probability > round(0.7 * data.CERTAIN))


@pytest.mark.parametrize("last", [None, "Softmax"])
def test_road_is_where_it_beats_the_others_and_as_probable_as_its_classes(last, tmp_path):
    values = balanced(IMAGE, 3)
    path = network(tmp_path / "n.onnx", classes=3, values=values, last=last)
    road = opened(path, road=(0, 2), decide="threshold").road(IMAGE)
    logits = scores(values, IMAGE.transpose(2, 0, 1) / 255)
    if last is None:
        best = opened(path, road=(2,)).road(IMAGE).mask.pixels()
        assert np.array_equal(best, framed(logits).argmax(axis=0) == 2)
    # Logits are interpolated where there are any.
    shares = framed(softmax(logits)) if last else softmax(framed(logits))
    assert np.abs(road.probability / data.CERTAIN - shares[0] - shares[2]).max() < 1e-4
    for codes, number in zip(road.by_class, (0, 2), strict=True):
        assert np.abs(codes / data.CERTAIN - shares[number]).max() < 1e-4


def test_grey_levels_of_one_class_are_not_taken_for_logits(tmp_path):
    values = balanced(IMAGE, 1)
    values["w2"], values["b2"] = 40 * np.abs(values["w2"]), np.float32([0.5])
    path = network(tmp_path / "n.onnx", classes=1, values=values)
    with pytest.raises(networks.NetworkError, match="call every pixel road") as asked:
        opened(path)
    assert 'activation = ?  # "sigmoid"' in asked.value.draft
    assert opened(path, activation="sigmoid").road(IMAGE).mask.pixels().all()


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
    assert np.abs(road.probability / data.CERTAIN - expected).max() < 1e-4


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
    with pytest.raises(networks.NetworkError, match="NaN"):
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
    with pytest.raises(networks.NetworkError, match="'road' depends on the image"):
        opened(path)


def test_a_loop_that_ends_on_black_images_alone_is_ended(tmp_path):
    nodes = [
        helper.make_node("ReduceMax", [MADE], ["most"], keepdims=0),
        helper.make_node("Greater", ["most", "none"], ["bright"]),
        without_end("bright"),
    ]
    path = written(tmp_path / "n.onnx", nodes, {"none": np.float32(0)})
    with pytest.raises(networks.NetworkError, match=r"takes longer than 0\.5 s"):
        opened(path, seconds=0.5, road=(0,))


def _everywhere(classes):
    values = balanced(IMAGE, classes)
    values["w2"][:] = 0
    values["b2"][:] = 9.5
    return values


def read(path, **settings) -> networks.NetSettings:
    return networks.Network.of(networks.NetSettings(file=str(path), **settings)).settings


def refusal(path, **settings) -> str:
    with pytest.raises(networks.NetworkError) as caught:
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
    with pytest.raises(networks.NetworkError, match="another network than was asked for"):
        networks.Network.of(settings)


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
    "a threshold on classes alone": (
        {"last": "ArgMax"},
        {"road": (1,), "threshold": 0.7},
        "`net.threshold`",
    ),
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
    "an output that is not a map": ({"last": "GlobalAveragePool"}, {}, "is not a map of the image"),
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
    with pytest.raises(networks.NetworkError, match=r"net\.file"):
        networks.Network.of(networks.NetSettings())

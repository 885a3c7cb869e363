"""Settings read from a network's file, and errors that ask for settings."""

import pytest
from onnx import TensorProto

from roadeval.networks import NetSettings, Network, NetworkError
from tests.networks.making import network


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
    "which of several outputs": ({"spare": True}, {}, "`net.outputs`"),
    "an output that is not there": ({}, {"outputs": ("seg",)}, "has no output 'seg'"),
    "which of three classes": (
        {"classes": 3},
        {},
        "the classes of its 3 that are road by `net.road`",
    ),
    "which labels": ({"last": "ArgMax"}, {}, "`net.road`"),
    "a class that is not there": ({}, {"road": (2,)}, "has no class 2, but 2 from 0"),
    "one class beats no other": ({"classes": 1}, {"decide": "argmax"}, "`net.decide`"),
    "four images at once": ({"input_shape": (4, 3, 12, 16)}, {}, "inputs: image"),
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

"""What an ONNX file tells of itself, and files that cannot be used."""

import hashlib

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from roadeval.networks import NetSettings, Network, NetworkError
from tests.networks.making import network


def read(path):
    return Network.of(NetSettings(file=str(path), outputs=("road",))).file


def refused(path) -> str:
    with pytest.raises(NetworkError) as caught:
        read(path)
    said = str(caught.value)
    assert said.startswith(f"{path}: ")
    assert "\n" not in said
    return said


def with_weights_beside(folder):
    model = onnx.load(network(folder / "whole.onnx"))
    path = folder / "n.onnx"
    onnx.save(model, path, save_as_external_data=True, location="n.data", size_threshold=0)
    return path


@pytest.mark.parametrize("last", ["Softmax", "Sigmoid", None])
def test_the_operator_that_makes_an_output_is_found_behind_those_that_move_it(last, tmp_path):
    path = network(tmp_path / "n.onnx", last=last, input_shape=(1, 12, 16, 3))
    assert read(path).makers == {"road": last or "Conv"}


def test_weights_beside_the_file_are_part_of_the_digest(tmp_path):
    path = with_weights_beside(tmp_path)
    both = path.read_bytes() + (tmp_path / "n.data").read_bytes()
    assert read(path).sha256 == hashlib.sha256(both).hexdigest()


def test_a_missing_file(tmp_path):
    assert "cannot read the network: No such file" in refused(tmp_path / "n.onnx")


@pytest.mark.parametrize("content", [b"hello", b"\x89PNG\r\n\x1a\n", bytes(1000)])
def test_a_file_that_is_no_onnx(content, tmp_path):
    path = tmp_path / "n.onnx"
    path.write_bytes(content)
    assert "not an ONNX file" in refused(path)


@pytest.mark.parametrize(
    ("there", "other", "said"),
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
def test_a_file_that_is_damaged_inside(there, other, said, tmp_path):
    path = network(tmp_path / "n.onnx")
    content = path.read_bytes()
    assert there in content
    path.write_bytes(content.replace(there, other, 1))
    assert said in refused(path)


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

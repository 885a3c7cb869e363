"""Facts read from an ONNX file, and files that cannot be used."""

import hashlib
import re

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper
from onnx.external_data_helper import set_external_data

from roadeval.networks.onnx_file import weight_files
from tests.networks.making import IMAGE, ROAD, SIZE, network, without_end, written
from tests.networks.test_network import opened, refusal


def refused(path) -> str:
    return refusal(path, outputs=("road",))


def with_weights_beside(folder):
    model = onnx.load(network(folder / "whole.onnx"))
    path = folder / "n.onnx"
    onnx.save(model, path, save_as_external_data=True, location="n.data", size_threshold=0)
    return path


def test_weights_beside_the_file_are_part_of_the_digest(tmp_path):
    path = with_weights_beside(tmp_path)
    both = path.read_bytes() + (tmp_path / "n.data").read_bytes()
    assert opened(path).file.sha256 == hashlib.sha256(both).hexdigest()


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
    add = helper.make_node("Add", [IMAGE, "w"], ["made"])
    held = ([_constant(), add], [], result) if deep else ([add], [], result, [_beside()])
    branch = helper.make_graph(held[0], "branch", *held[1:])
    choice = helper.make_node("If", ["yes"], [ROAD], then_branch=branch, else_branch=branch)
    written(path, [choice], {"yes": True})


def _in_a_function(path) -> None:
    nodes = [_constant(), helper.make_node("Add", ["x", "w"], ["y"])]
    opset = [helper.make_opsetid("", 17)]
    function = helper.make_function("own", "plus", ["x"], ["y"], nodes, opset)
    call = helper.make_node("plus", [IMAGE], [ROAD], domain="own")
    written(path, [call], functions=[function])


REACHED = {
    "a constant": lambda path: written(
        path, [_constant(), helper.make_node("Add", [IMAGE, "w"], [ROAD])]
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
        assert opened(path, size=SIZE, road=(0,)).file.sha256 == digests[-1]
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
    assert re.search(
        r"takes longer than 0\.5 s or .* to run.*net\.seconds", refusal(path, seconds=0.5)
    )


def test_a_loop_that_takes_ever_more_memory_is_ended(tmp_path):
    loop = without_end("yes")
    loop.output[:] = ["last", ROAD]
    loop.attribute[0].g.node.append(helper.make_node("Tile", ["was", "many"], ["kept"]))
    many = helper.make_tensor_value_info("kept", TensorProto.FLOAT, None)
    loop.attribute[0].g.output.append(many)
    values = {"yes": True, "many": np.int64([1, 1, 20, 20])}
    path = written(tmp_path / "n.onnx", [loop], values)
    assert re.search("or more than 64 MiB to run", refusal(path, megabytes=8))


def test_a_network_that_takes_too_long_to_open_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("roadeval.networks.onnx_file.LEAST_OPENING_S", 0.001)
    path = network(tmp_path / "n.onnx")
    assert re.search(
        r"takes longer than 0\.001 s to open.*net\.seconds", refusal(path, seconds=0.001)
    )


SIZES = {
    "rows and columns, stated": ((12000, 16000), True, "takes 732 MiB"),
    "rows and columns": ((12000, 16000), False, "takes 732 MiB"),
    "classes, stated": ((9999, 120, 160), True, "takes 732 MiB"),
    "nothing": ((0, 12, 16), False, "not a map of the image, but (1, 0, 12, 16)"),
    "five lengths": ((2, 3, 12, 16), False, "not a map of the image, but (1, 2, 3, 12, 16)"),
}


@pytest.mark.parametrize("what", SIZES)
def test_an_output_that_is_too_large_or_no_map_is_refused(what, tmp_path):
    shape, stated, message = SIZES[what]
    node = helper.make_node("ConstantOfShape", ["shape"], ["zeros"])
    keep = helper.make_node("ReduceMax", [IMAGE], ["most"], keepdims=0)
    nodes = [node, keep, helper.make_node("Add", ["zeros", "most"], [ROAD])]
    values = {"shape": np.int64([1, *shape])}
    path = written(tmp_path / "n.onnx", nodes, values, shape=[1, *shape] if stated else None)
    assert message in refused(path)


@pytest.mark.parametrize("operator", ["SequenceConstruct", "ArgMax to text"])
def test_an_output_without_numbers_is_refused(operator, tmp_path):
    node = helper.make_node("Cast", [IMAGE], [ROAD], to=TensorProto.STRING)
    path = tmp_path / "n.onnx"
    written(path, [node], kind=TensorProto.STRING)
    if operator == "SequenceConstruct":
        model = onnx.load(path)
        model.graph.node[0].CopyFrom(helper.make_node(operator, [IMAGE], [ROAD]))
        kind = helper.make_tensor_type_proto(TensorProto.FLOAT, None)
        sequence = helper.make_sequence_type_proto(kind)
        model.graph.output[0].CopyFrom(helper.make_value_info(ROAD, sequence))
        onnx.save(model, path)
    assert "not an array of numbers" in refused(path)


@pytest.mark.parametrize("content", [None, b"hello", b"\x89PNG\r\n\x1a\n", bytes(1000)])
def test_a_missing_file_and_one_that_is_no_onnx(content, tmp_path):
    path = tmp_path / "n.onnx"
    if content is not None:
        path.write_bytes(content)
    reason = "cannot read the network: No such file" if content is None else "not an ONNX file"
    assert reason in refused(path)


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
    assert "it crashes onnxruntime" in refused(tmp_path / "n.onnx")


@pytest.mark.parametrize("location", ["../n.data", "/etc/passwd", "a/../../n.data"])
def test_weights_that_are_missing_or_outside_the_folder_are_not_read(location, tmp_path):
    path = with_weights_beside(tmp_path)
    (tmp_path / "n.data").rename(tmp_path.parent / "n.data")
    assert "its weights lie in n.data beside it, which cannot be read" in refused(path)
    model = onnx.load(path, load_external_data=False)
    for tensor in model.graph.initializer:
        tensor.external_data[0].value = location
    path.write_bytes(model.SerializeToString())
    assert "asks for weights outside its folder" in refused(path)

"""What an ONNX file tells of itself, and files that cannot be used."""

import hashlib

import onnx
import pytest

from roadeval.networks.errors import NetworkError
from roadeval.networks.onnx_file import read_onnx
from tests.networks.making import network


def refused(path) -> str:
    with pytest.raises(NetworkError) as caught:
        read_onnx(path)
    said = str(caught.value)
    assert said.startswith(f"{path}: ")
    assert "\n" not in said
    return said


def with_weights_beside(folder):
    model = onnx.load(network(folder / "whole.onnx"))
    path = folder / "n.onnx"
    onnx.save(model, path, save_as_external_data=True, location="n.data", size_threshold=0)
    return path


def test_inputs_and_outputs_are_listed_without_the_weights(tmp_path):
    file = read_onnx(network(tmp_path / "n.onnx", spare=True))
    assert file.described() == (
        "inputs: image float32 (1, 3, 12, 16); "
        "outputs: road float32 (?, ?, ?, ?), r1 float32 (1, 4, ?, ?)"
    )


def test_metadata_are_texts_by_name(tmp_path):
    file = read_onnx(network(tmp_path / "n.onnx", metadata={"license": "MIT", "names": "{}"}))
    assert file.metadata == {"license": "MIT", "names": "{}"}


def test_the_operator_that_makes_an_output_is_found_behind_those_that_move_it(tmp_path):
    path = network(tmp_path / "n.onnx", last="Softmax", input_shape=(1, 12, 16, 3))
    assert read_onnx(path).makers == {"road": "Softmax"}


def test_the_digest_is_that_of_the_bytes(tmp_path):
    path = network(tmp_path / "n.onnx")
    assert read_onnx(path).sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


def test_weights_beside_the_file_are_part_of_the_digest(tmp_path):
    path = with_weights_beside(tmp_path)
    both = path.read_bytes() + (tmp_path / "n.data").read_bytes()
    assert read_onnx(path).sha256 == hashlib.sha256(both).hexdigest()


def test_a_missing_file(tmp_path):
    assert "there is no such network" in refused(tmp_path / "n.onnx")


def test_a_folder(tmp_path):
    assert "is a folder" in refused(tmp_path)


@pytest.mark.parametrize("content", [b"", b"hello", b"\x89PNG\r\n\x1a\n", bytes(1000)])
def test_a_file_that_is_no_onnx(content, tmp_path):
    path = tmp_path / "n.onnx"
    path.write_bytes(content)
    assert "not an ONNX file" in refused(path)


def test_a_file_that_was_cut(tmp_path):
    path = network(tmp_path / "n.onnx")
    path.write_bytes(path.read_bytes()[:300])
    assert "not an ONNX file" in refused(path)


@pytest.mark.parametrize(
    ("there", "other"),
    [
        (b"Relu", b"Rel\xb4"),
        (b"strides", b"strid\xffs"),
        (b"w1", b"w\xb1"),
        (b"c1", b"c7"),
        (b"B\x02w1J", b"B\x02w1\n"),
        (b"strides@\x02", b"strides@\x00"),
    ],
    ids=[
        "operator",
        "attribute",
        "weights",
        "a tensor that nothing makes",
        "no numbers",
        "a stride of 0",
    ],
)
def test_a_file_that_is_damaged_inside(there, other, tmp_path):
    path = network(tmp_path / "n.onnx")
    content = path.read_bytes()
    assert there in content
    path.write_bytes(content.replace(there, other, 1))
    assert "not an ONNX file, or a damaged one" in refused(path)


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

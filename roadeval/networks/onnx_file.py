"""What an ONNX file tells of itself: inputs, outputs, metadata, and the digest of its bytes."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, Final

from roadeval.networks.errors import NetworkError
from roadeval.networks.onnx_schema import TYPES, model_class
from roadeval.networks.wholeness import is_whole, weights_of
from roadeval.runtime.files import check_input
from roadeval.runtime.text import visible

LARGEST: Final = (1 << 31) - 1
"""Bytes that a protobuf file can have; larger weights lie in files beside it."""
PASSING: Final = frozenset(
    {"Cast", "Identity", "Reshape", "Resize", "Slice", "Squeeze", "Transpose", "Unsqueeze"}
)
"""Operators that leave a probability one."""
_SHOWN: Final = 12
"""Inputs and outputs that a message lists."""


@dataclass(frozen=True, slots=True)
class Tensor:
    """An input or an output: its name, its type, and its shape, None where that is left open."""

    name: str
    dtype: str
    shape: tuple[int | None, ...]

    def __str__(self) -> str:
        sizes = ", ".join("?" if size is None else str(size) for size in self.shape)
        return f"{visible(self.name)} {self.dtype} ({sizes})"


@dataclass(frozen=True, slots=True, eq=False)
class OnnxFile:
    """An ONNX file that was read.

    Parameters
    ----------
    path
        Where it lies.
    sha256
        Of its bytes; where weights lie in files beside it, of its bytes and theirs, in the order
        of those files' names.
    content
        The bytes; None where weights lie beside it.
    inputs, outputs
        What it takes, without its weights, and what it gives.
    metadata
        Texts by name.
    makers
        By output: the operator that makes its numbers, those passed over that only move them.
    """

    path: Path
    sha256: str
    content: bytes | None
    inputs: tuple[Tensor, ...]
    outputs: tuple[Tensor, ...]
    metadata: Mapping[str, str]
    makers: Mapping[str, str]

    def error(self, problem: str) -> NetworkError:
        """Return an error about the file."""
        return NetworkError(f"{self.path}: {problem}")

    def question(self, what: str) -> NetworkError:
        """Return an error that asks for what the file leaves open, and lists what it has."""
        return self.error(f"{what} ({self.described()})")

    def described(self) -> str:
        """List inputs and outputs in one line."""
        return f"inputs: {_listed(self.inputs)}; outputs: {_listed(self.outputs)}"


def read_onnx(path: Path) -> OnnxFile:
    """Read an ONNX file, without its weights.

    Raises
    ------
    NetworkError
        If it is missing, no ONNX file, or lacks a file with weights.
    """
    content = _bytes(path)
    model = model_class()()
    try:
        model.ParseFromString(content)
    except Exception as error:  # the parser's own, which is of another class in each version
        raise _no_onnx(path) from error
    if not model.ir_version or not is_whole(model.graph):
        raise _no_onnx(path)
    beside = sorted({_text(name) for name in _external(model.graph)})
    digest = hashlib.sha256(content)
    for name in beside:
        _add(digest, path, name)
    weights = set(weights_of(model.graph))
    return OnnxFile(
        path,
        digest.hexdigest(),
        None if beside else content,
        tuple(_tensor(each) for each in model.graph.input if each.name not in weights),
        tuple(_tensor(each) for each in model.graph.output),
        {_text(each.key): _text(each.value) for each in model.metadata_props},
        {_text(each.name): _maker(model.graph, each.name) for each in model.graph.output},
    )


def _bytes(path: Path) -> bytes:
    try:
        check_input(path)
        if path.stat().st_size > LARGEST:
            raise NetworkError(f"{path}: larger than 2 GiB, which no ONNX file is")
        return path.read_bytes()
    except FileNotFoundError as error:
        raise NetworkError(f"{path}: there is no such network") from error
    except OSError as error:
        raise NetworkError(f"{path}: cannot read the network: {error.strerror}") from error


def _no_onnx(path: Path) -> NetworkError:
    return NetworkError(f"{path}: not an ONNX file, or a damaged one; export the network as ONNX")


def _external(graph: Any) -> Iterator[bytes]:
    """Yield the names of the files that hold weights."""
    for tensor in graph.initializer:
        for entry in tensor.external_data:
            if entry.key == b"location":
                yield entry.value


def _add(digest: Any, path: Path, name: str) -> None:
    """Add a file with weights to a digest; it must lie in the folder of the network or below."""
    inner = PurePosixPath(name)
    if inner.is_absolute() or ".." in inner.parts or "\\" in name or ":" in name:
        raise NetworkError(f"{path}: asks for weights outside its folder: {visible(name)}")
    beside = path.parent / inner
    try:
        check_input(beside)
        with beside.open("rb") as file:
            while block := file.read(1 << 20):
                digest.update(block)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise NetworkError(
            f"{path}: its weights lie in {visible(name)} beside it, which cannot be read: {reason}"
        ) from error


def _tensor(value: Any) -> Tensor:
    tensor = value.type.tensor_type
    shape = tuple(each.dim_value if each.dim_value > 0 else None for each in tensor.shape.dim)
    return Tensor(_text(value.name), TYPES.get(tensor.elem_type, "unknown"), shape)


def _maker(graph: Any, name: bytes) -> str:
    """Return the operator that makes the numbers of a tensor."""
    made_by = {output: node for node in graph.node for output in node.output}
    for _ in range(len(graph.node)):
        node = made_by.get(name)
        if node is None or _text(node.op_type) not in PASSING or not node.input:
            break
        name = node.input[0]
    return _text(made_by[name].op_type) if name in made_by else ""


def _text(value: bytes) -> str:
    return value.decode(errors="replace")


def _listed(tensors: tuple[Tensor, ...]) -> str:
    more = f", and {len(tensors) - _SHOWN} more" if len(tensors) > _SHOWN else ""
    return ", ".join(map(str, tensors[:_SHOWN])) + more

"""An ONNX file run by onnxruntime: its inputs, outputs and digest."""

from __future__ import annotations

import hashlib
import json
import math
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from functools import lru_cache, partial
from pathlib import Path, PurePosixPath
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data.words import first_of
from roadeval.networks import makers
from roadeval.networks.makers import reading
from roadeval.networks.settings import MIB, NetSettings, NetworkError
from roadeval.runtime.documents import protobuf_fields
from roadeval.runtime.files import check_input
from roadeval.runtime.sentence import Sentence
from roadeval.runtime.text import visible
from roadeval.runtime.threads import time_limit

Array = npt.NDArray[Any]

LEAST_OPENING_S: Final = 30.0
"""Seconds that a file may take to open, even if an image may take fewer."""
QUOTED: Final = 240
"""Letters of onnxruntime's error that a message quotes."""
LARGEST: Final = (1 << 31) - 1
"""Bytes that a protobuf file can have; larger weights lie in files beside it."""
SHOWN: Final = 12
"""Inputs and outputs that a message lists."""
_LATE: Final = "takes longer than {:g} s{} to {}, or has no end"
_MORE_TIME: Final = Sentence("export it again, or allow more time by {net.seconds}")
_DAMAGED: Final = "not an ONNX file, or a damaged one; export the network as ONNX"
_PREAMBLE: Final = re.compile(r"^\[ONNXRuntimeError\] : \d+ : \w+ : (Load model from .*? failed:)?")
_PROBE: Final = """
import onnxruntime, sys
options = onnxruntime.SessionOptions()
options.log_severity_level = 4
options.intra_op_num_threads = 1
onnxruntime.InferenceSession(sys.argv[1], options, providers=["CPUExecutionProvider"])
"""


@dataclass(frozen=True)
class Tensor:
    """An input or an output."""

    name: str
    dtype: str
    """NumPy's name of its type; onnxruntime's if NumPy lacks the type."""
    shape: tuple[int | None, ...]
    """The sizes of its dimensions; None for a variable one."""

    @classmethod
    def of(cls, described: Any) -> Tensor:
        """Convert onnxruntime's description."""
        kind = described.type.removeprefix("tensor(").removesuffix(")")
        sizes = tuple(n if isinstance(n, int) and n > 0 else None for n in described.shape)
        return cls(described.name, {"float": "float32", "double": "float64"}.get(kind, kind), sizes)

    def __str__(self) -> str:
        sizes = ", ".join("?" if size is None else str(size) for size in self.shape)
        return f"{visible(self.name)} {self.dtype} ({sizes})"


@dataclass(frozen=True, eq=False)
class OnnxFile:
    """A network that onnxruntime has opened; any thread may run it, each call on one thread."""

    path: Path
    session: Any
    sha256: str
    """Digest of its bytes, followed by the bytes of weight files beside it in the order of their
    names, and of the JSON files of its Hugging Face folder."""
    inputs: tuple[Tensor, ...]
    """Its inputs, without its weights."""
    outputs: tuple[Tensor, ...]
    metadata: Mapping[str, str]
    names: Mapping[int, str]
    """Names of classes by number, in small letters, as far as its makers state them."""
    stated: NetSettings
    """Settings that its makers state; the size is for an input that takes any size."""

    def run(
        self, values: Array, outputs: tuple[str, ...], seconds: float, grown: float = math.inf
    ) -> list[Array]:
        """Compute some outputs for the values of the one input, within some seconds.

        The process may grow by ``grown`` bytes meanwhile. A `NetworkError` if that fails, or an
        output is not an array of numbers.
        """
        from onnxruntime import RunOptions

        options = RunOptions()
        options.log_severity_level = 4
        with time_limit(partial(setattr, options, "terminate", True), seconds, grown) as late:
            try:
                with explaining(self.path):
                    arrays = self.session.run(outputs, {self.inputs[0].name: values}, options)
            except NetworkError as error:
                if late.is_set():
                    more = f" or more than {grown / MIB:,.0f} MiB" if math.isfinite(grown) else ""
                    raise self.error(_LATE.format(seconds, more, "run"), _MORE_TIME) from error
                raise
        for name, array in zip(outputs, arrays, strict=True):
            if not isinstance(array, np.ndarray) or array.dtype.kind not in "biuf":
                raise self.question(f"its output {name!r} is not an array of numbers")
        return list(arrays)

    def check_size(self, tensor: Tensor, limit: int) -> None:
        """Raise a `NetworkError` if an input or an output takes more bytes than the limit."""
        with suppress(TypeError):  # NumPy lacks the type, and an array of it is refused later
            size = math.prod(n or 1 for n in tensor.shape) * np.dtype(tensor.dtype).itemsize
            if size > limit:
                problem = f"{tensor} takes {size / MIB:,.0f} MiB, more than {limit / MIB:g}"
                remedy = Sentence("export it smaller, or allow more by {net.megabytes}")
                raise self.error(problem, remedy)

    def error(self, problem: str, remedy: str = "") -> NetworkError:
        """Return an error about the file."""
        return NetworkError(problem, where=self.path, remedy=remedy)

    def question(
        self, problem: str, remedy: str = "", line: str = "", settings: NetSettings | None = None
    ) -> NetworkError:
        """Return an error that asks for a missing setting, and lists inputs and outputs.

        ``line`` is a line of TOML with a question mark for what is missing; with all that
        ``settings`` have it is the draft of a file.
        """
        inputs = first_of([*map(str, self.inputs)], SHOWN)
        outputs = first_of([*map(str, self.outputs)], SHOWN)
        listed = f" (inputs: {inputs}; outputs: {outputs})"
        error = self.error(Sentence("{}{}", problem, listed), remedy)
        if settings is not None:
            name = f"{Path(settings.file).absolute().stem}.toml"
            error.draft = f"# Save as {name} here, complete it, and give --net NAME={name}"
            usual = asdict(NetSettings()) | {"sha256": settings.sha256}
            for key, value in asdict(settings).items():
                if value != usual[key]:
                    error.draft += f"\n{key} = {json.dumps(value, ensure_ascii=False)}"
            error.draft += f"\n{line}"
        return error


def load(settings: NetSettings) -> OnnxFile:
    """Open the network of some settings; it stays open while its file does not change.

    A `NetworkError` if the file cannot be used, or the settings state another SHA-256.
    """
    if not settings.file:
        remedy = "give the path of an ONNX file"
        raise NetworkError("names no network", setting="net.file", remedy=remedy)
    path, documents = Path(settings.file), None
    with reading(path, "cannot read the network"):
        if path.is_dir():
            documents = path, *makers.read_documents(path)
            path = makers.find_network(path)
        check_input(path)
        status = path.stat()
    if status.st_size > LARGEST:
        raise NetworkError("larger than 2 GiB, which no ONNX file is", where=path)
    state = status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns
    file = _open(path, settings.seconds, documents, *state)
    if settings.sha256 not in (None, file.sha256):
        other = "is another network than was asked for: {net.sha256} is {}, but the file's is {}"
        raise file.error(Sentence(other, settings.sha256, file.sha256))
    return file


@lru_cache(maxsize=4)
def _open(
    path: Path, seconds: float, documents: tuple[Path, bytes, bytes] | None, *_state: int
) -> OnnxFile:
    import onnxruntime

    with reading(path, "cannot read the network"):
        content = path.read_bytes()
    try:
        model = memoryview(content)
        beside = sorted(set(weight_files(model)))
    except ValueError as error:
        raise NetworkError(_DAMAGED, where=path) from error
    digest = hashlib.sha256(content)
    for name in beside:
        inner = PurePosixPath(name)
        if inner.is_absolute() or ".." in inner.parts or "\\" in name or ":" in name:
            raise NetworkError(f"asks for weights outside its folder: {visible(name)}", where=path)
        with reading(path, f"its weights lie in {visible(name)} beside it, which cannot be read"):
            check_input(path.parent / inner)
            with (path.parent / inner).open("rb") as file:
                while block := file.read(1 << 20):
                    digest.update(block)
    if documents:
        folder, config, preprocessor = documents
        names, stated = (
            makers.class_names(folder, config),
            makers.input_settings(folder, preprocessor),
        )
        digest.update(config + preprocessor)
    # Some damaged files end the process that opens them, so another process opens them first.
    # With -P an onnxruntime.py beside the network is not imported.
    probe = [sys.executable, "-P", "-c", _PROBE, str(path)]
    # 1 is an exception, which is raised again below.
    seconds = max(seconds, LEAST_OPENING_S)
    try:
        ending = subprocess.run(probe, check=False, capture_output=True, timeout=seconds)
    except subprocess.TimeoutExpired as error:
        late = _LATE.format(seconds, "", "open")
        raise NetworkError(late, where=path, remedy=_MORE_TIME) from error
    if ending.returncode not in (0, 1):
        remedy = "export the network as ONNX again"
        raise NetworkError("damaged: it crashes onnxruntime", where=path, remedy=remedy)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4  # it raises what it logs
    with explaining(path):
        session = onnxruntime.InferenceSession(
            str(path), options, providers=["CPUExecutionProvider"], enable_fallback=0
        )
        inputs = tuple(map(Tensor.of, session.get_inputs()))
        outputs = tuple(map(Tensor.of, session.get_outputs()))
        metadata = session.get_modelmeta().custom_metadata_map
    if not documents:
        names, stated = makers.names_in(metadata), makers.settings_in(metadata)
    names = {number: name.lower() for number, name in names.items() if number >= 0}
    return OnnxFile(path, session, digest.hexdigest(), inputs, outputs, metadata, names, stated)


@contextmanager
def explaining(path: Path) -> Iterator[None]:
    """Turn an error of onnxruntime into one line that quotes it."""
    import onnxruntime

    try:
        yield
    except MemoryError:
        raise
    except Exception as error:  # onnxruntime's errors have no common class
        if type(error).__name__ in ("InvalidProtobuf", "UnicodeDecodeError"):
            raise NetworkError(_DAMAGED, where=path) from error
        message = visible(" ".join(_PREAMBLE.sub("", str(error)).split()))
        quoted = message if len(message) <= QUOTED else f"{message[:QUOTED]}..."
        library = f"onnxruntime {onnxruntime.__version__}"
        raise NetworkError(f"{library} cannot run the network: {quoted}", where=path) from error


# An ONNX file is a protobuf message; fields have the numbers of ``onnx.proto``. Any other file
# raises a ValueError.

HOLDING: Final[Mapping[str, Mapping[int, str]]] = {
    "model": {7: "graph", 20: "training", 25: "function"},
    "graph": {1: "node", 5: "tensor", 15: "sparse"},
    "function": {7: "node", 11: "attribute"},
    "training": {1: "graph", 2: "graph"},
    "node": {5: "attribute"},
    "attribute": {**dict.fromkeys((5, 10), "tensor"), **dict.fromkeys((6, 11), "graph")}
    | dict.fromkeys((22, 23), "sparse"),
    "sparse": {1: "tensor", 2: "tensor"},
    "tensor": {13: "entry"},
}
"""Messages that lead to tensors, and the messages in their fields."""


def weight_files(model: memoryview) -> Iterator[str]:
    """Yield the names of the weight files of a model, which lie beside it.

    The graph, nodes and their inner graphs, and functions may name such files.
    """
    waiting = [("model", model)]
    while waiting:
        kind, message = waiting.pop()
        if kind == "entry":
            fields = [*protobuf_fields(message)]
            if (1, b"location") in fields:
                names = (value for number, value in fields if number == 2)
                yield from (str(n, errors="replace") for n in names if isinstance(n, memoryview))
            continue
        for number, value in protobuf_fields(message):
            if (inner := HOLDING[kind].get(number)) and isinstance(value, memoryview):
                waiting.append((inner, value))

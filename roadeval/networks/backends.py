"""Who runs a network: onnxruntime or OpenCV, each on one thread a call.

A call may come from any thread. onnxruntime's sessions allow that; of OpenCV's networks each thread
gets one of its own while it computes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from threading import Lock
from typing import Any, Final, Literal, Protocol

import cv2
import numpy as np
import numpy.typing as npt

from roadeval.networks.errors import NetworkError
from roadeval.networks.onnx_file import OnnxFile
from roadeval.runtime.text import visible

Array = npt.NDArray[Any]

BackendName = Literal["onnxruntime", "opencv"]
EXTRA: Final = "pip install 'roadeval[onnx]'"
_ONE_AT_A_TIME: Final = Lock()
QUOTED: Final = 240
"""Letters of a library's complaint that a message quotes."""


class Backend(Protocol):
    """A network, ready to run."""

    @property
    def version(self) -> str:
        """Of the library that runs it."""

    def run(self, values: Array, outputs: Sequence[str]) -> list[Array]:
        """Return the outputs of these names for the values of the one input, as new arrays.

        A `NetworkError` if the library cannot compute them.
        """


def default_backend() -> BackendName:
    """Return the backend that runs a network unless another one is asked for."""
    return "onnxruntime" if find_spec("onnxruntime") else "opencv"


def opened(file: OnnxFile, backend: BackendName) -> Backend:
    """Make a network ready to run.

    Raises
    ------
    NetworkError
        If the backend is not installed, or cannot run the network.
    """
    return OnnxRuntime(file) if backend == "onnxruntime" else OpenCv(file)


class OnnxRuntime:
    """A network that onnxruntime runs."""

    def __init__(self, file: OnnxFile) -> None:
        try:
            import onnxruntime
        except ImportError as error:
            raise NetworkError(f"`net.backend`: onnxruntime is not installed: {EXTRA}") from error
        self._file: Final = file
        self.version: Final = str(onnxruntime.__version__)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 4  # it throws what it logs
        source = str(file.path) if file.content is None else file.content
        with _explained(file, f"onnxruntime {self.version}"):
            self._session = onnxruntime.InferenceSession(
                source, options, providers=["CPUExecutionProvider"], enable_fallback=0
            )

    def run(self, values: Array, outputs: Sequence[str]) -> list[Array]:
        """Return outputs by their names."""
        with _explained(self._file, f"onnxruntime {self.version}"):
            found = self._session.run(list(outputs), {self._file.inputs[0].name: values})
        return [np.asarray(each) for each in found]


class OpenCv:
    """A network that ``cv2.dnn`` runs."""

    def __init__(self, file: OnnxFile) -> None:
        self._file: Final = file
        self.version: Final = str(cv2.__version__)
        self._idle: Final = [self._read()]

    def run(self, values: Array, outputs: Sequence[str]) -> list[Array]:
        """Return outputs by their names."""
        try:
            network = self._idle.pop()
        except IndexError:
            network = self._read()
        with self._explained():
            network.setInput(values)
            known = network.getUnconnectedOutLayersNames()
            # Copies, for the network's next run may write over what it gave.
            found = [np.array(each) for each in network.forward(known)]
        self._idle.append(network)
        return [found[self._place(name, known)] for name in outputs]

    def _read(self) -> Any:
        with _quiet(), self._explained():
            if self._file.content is None:
                return cv2.dnn.readNetFromONNX(str(self._file.path))
            return cv2.dnn.readNetFromONNX(np.frombuffer(self._file.content, np.uint8))

    def _place(self, name: str, known: Sequence[str]) -> int:
        """Return the place of an output among OpenCV's; some versions name them by their layers."""
        own = [output.name for output in self._file.outputs]
        if name not in known and len(known) != len(own):
            raise self._file.error(f"OpenCV {self.version} does not give its output {name!r}")
        return list(known).index(name) if name in known else own.index(name)

    @contextmanager
    def _explained(self) -> Iterator[None]:
        hint = "" if find_spec("onnxruntime") else f"; onnxruntime may, {EXTRA}"
        with _explained(self._file, f"OpenCV {self.version}", hint):
            yield


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep OpenCV from writing to the process's streams what it throws as well."""
    log = cv2.utils.logging
    with _ONE_AT_A_TIME:
        before = log.getLogLevel()
        log.setLogLevel(log.LOG_LEVEL_SILENT)
        try:
            yield
        finally:
            log.setLogLevel(before)


@contextmanager
def _explained(file: OnnxFile, library: str, hint: str = "") -> Iterator[None]:
    """Turn an error of a library into one line that quotes it."""
    try:
        yield
    except MemoryError:
        raise
    except Exception as error:  # onnxruntime's errors have no class of their own in common
        said = visible(" ".join(str(getattr(error, "err", None) or error).split()))
        quoted = said if len(said) <= QUOTED else f"{said[:QUOTED]}..."
        raise file.error(f"{library} cannot run the network: {quoted}{hint}") from error

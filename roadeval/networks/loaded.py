"""A network that was read and made ready, kept as long as its file stays the same."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from roadeval.networks.backends import Backend, BackendName, default_backend, opened
from roadeval.networks.errors import NetworkError
from roadeval.networks.onnx_file import OnnxFile, read_onnx
from roadeval.networks.settings import NetSettings


@dataclass(frozen=True, slots=True, eq=False)
class Loaded:
    """A network's file, who runs it, and what it gave when it was tried."""

    file: OnnxFile
    backend_name: BackendName
    backend: Backend
    _tried: dict[Any, dict[str, npt.NDArray[Any]]] = field(default_factory=dict)

    def tried(self, shape: tuple[int, ...], outputs: tuple[str, ...]) -> list[npt.NDArray[Any]]:
        """Return some outputs for an input of zeros: their shapes and types are those of any.

        A `NetworkError` if it cannot be run on an input of this shape.
        """
        key = (shape, outputs)
        if key not in self._tried:
            blank = np.zeros(shape, np.dtype(self.file.inputs[0].dtype))
            found = self.backend.run(blank, outputs)
            self._tried[key] = dict(zip(outputs, found, strict=True))
        return [self._tried[key][name] for name in outputs]


def load(settings: NetSettings) -> Loaded:
    """Read the network of some settings and make it ready, or return the one made before.

    Raises
    ------
    NetworkError
        If the file cannot be used, or is another one than the settings state.
    """
    if not settings.file:
        raise NetworkError("`net.file` names no network: give the path of an ONNX file")
    path = Path(settings.file)
    try:
        there = path.stat()
    except (OSError, ValueError):
        read_onnx(path)  # which says what is wrong
        raise
    loaded = _kept(
        path,
        settings.backend or default_backend(),
        (there.st_dev, there.st_ino, there.st_size, there.st_mtime_ns),
    )
    if settings.sha256 not in (None, loaded.file.sha256):
        raise loaded.file.error(
            f"is another network than was asked for: its SHA-256 is {loaded.file.sha256}, and "
            f"`net.sha256` {settings.sha256}"
        )
    return loaded


@lru_cache(maxsize=4)
def _kept(path: Path, backend: BackendName, _state: tuple[int, ...]) -> Loaded:
    file = read_onnx(path)
    return Loaded(file, backend, opened(file, backend))

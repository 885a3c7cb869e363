"""The recorder of a run without a recording, which needs no Rerun."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, Self

from roadeval.data import FrameResult

Texts = Mapping[str, Mapping[str, str]]
"""Results by their names, by camera."""
NO_TEXTS: Final[Texts] = {}
NO_LINES: Final[Mapping[str, str]] = {}


class NullRecorder:
    """A recorder of a run without a recording: it does nothing."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: Any) -> None:
        """Close nothing."""

    def encode(self, result: FrameResult, position: int) -> None:
        """Encode nothing."""

    def forecast(self, _encoded: None, _frames: int) -> str:
        """Return nothing to say."""
        return ""

    def write(self, encoded: None, lines: Mapping[str, str] = NO_LINES) -> None:
        """Write nothing."""

    def flush(self) -> None:
        """Flush nothing."""

    def finish(self, results: Mapping[str, str], *, by_camera: Texts = NO_TEXTS) -> None:
        """Keep nothing."""

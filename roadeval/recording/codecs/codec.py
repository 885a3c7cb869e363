"""The interface of a codec."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy.typing as npt

from roadeval.images import MAX_PIXELS, Limits

Array = npt.NDArray[Any]


class Codec(Protocol):
    """Encodes and decodes one kind of layer, and describes to the viewer how it looks."""

    component: str
    """Identifier of the component that carries the payload."""

    def style(self) -> Sequence[Any]:
        """Return the archetypes to log once for the entity."""

    def encode(self, array: Any) -> bytes:
        """Return the payload of a frame's array; a mask may be packed."""

    def columns(self, payloads: list[bytes]) -> Any:
        """Return the viewer's columns of the payloads of many frames."""

    def decode(self, payload: bytes) -> Array:
        """Return the array of a payload; a ValueError if it is damaged or of another kind."""


def limits_for(width: int, height: int) -> Limits:
    """Return the limits on pictures of a recording: its own size is always allowed."""
    return Limits(max(MAX_PIXELS, width * height))

"""Road by a network, from an ONNX file that somebody has trained elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np

from roadeval.data import Layer, LayerKind, LayerSpec, Packed, mask_spec
from roadeval.networks import NetSettings, Network, NetworkError
from roadeval.pipeline.stage import Output, Stage, StageError, View

NET: Final = mask_spec("net", "Road by the network")
PROBABILITY: Final = LayerSpec(
    "probability", LayerKind.SCALAR, "How probable road is, by the network", exact=False
)


def bind(settings: NetSettings, _parameters: None) -> Callable[[View], Output]:
    """Return the network as a pure function of what it sees; a `NetworkError`, see `resolve`."""
    network = Network.of(settings)

    def run(view: View) -> Output:
        try:
            road = network.road(view.image)
        except NetworkError as error:
            raise StageError(f"net: {error}") from error
        mask = Packed.of(road.mask)
        levels = (road.codes >> 8).astype(np.uint8)
        return Output(
            (Layer(PROBABILITY, levels), Layer(NET, mask)),
            mask=mask,
            probability=road.codes if road.graded else None,
            by_class=road.by_class,
        )

    return run


def resolve(settings: NetSettings) -> NetSettings:
    """Return the settings with everything stated that the network's file tells.

    A `NetworkError` if the file cannot be used, or leaves something open.
    """
    return Network.of(settings).settings


def about(settings: NetSettings) -> Mapping[str, Any]:
    """Return what results tell of the network: what runs it, its licence, inputs and outputs."""
    return Network.of(settings).facts()


STAGE: Final = Stage(
    name="net",
    title="Network",
    settings=NetSettings,
    bind=bind,
    layers=(PROBABILITY, NET),
    resolve=resolve,
    places=("file",),
    about=about,
)

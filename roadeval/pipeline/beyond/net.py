"""Road by a network, from an ONNX file that somebody has trained elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from roadeval.data import Layer, LayerKind, LayerSpec, Packed, mask_spec
from roadeval.networks import NetSettings, Network, NetworkError
from roadeval.pipeline.stage import Output, Stage, StageError, View

NET: Final = mask_spec("net", "Road by the network")
PROBABILITY: Final = LayerSpec(
    "probability", LayerKind.SCALAR, "How probable road is, by the network", exact=False
)


def bind(settings: NetSettings, _parameters: None) -> Callable[[View], Output]:
    """Return the network as a pure function of what it sees; a `NetworkError`, see `Network.of`."""
    network = Network.of(settings)

    def run(view: View) -> Output:
        try:
            road = network.road(view.image)
        except NetworkError as error:
            raise StageError.of(error, "net") from error
        mask = Packed.of(road.mask)
        levels = (road.codes >> 8).astype(np.uint8)
        return Output(
            (Layer(PROBABILITY, levels), Layer(NET, mask)),
            mask=mask,
            probability=road.codes if road.graded else None,
            by_class=road.by_class,
        )

    return run


STAGE: Final = Stage(
    name="net",
    title="Network",
    settings=NetSettings,
    bind=bind,
    layers=(PROBABILITY, NET),
    resolve=lambda settings: Network.of(settings).settings,
    places=("file",),
    about=lambda settings: Network.of(settings).facts(),
)

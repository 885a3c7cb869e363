"""Road by a network from an ONNX file, trained elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from roadeval.data import Layer, LayerKind, LayerSpec, mask_spec
from roadeval.networks import NetSettings, Network, NetworkError
from roadeval.pipeline.stage import Output, Stage, StageError, View

NET: Final = mask_spec("net", "Road by the network")
PROBABILITY: Final = LayerSpec(
    "probability", LayerKind.SCALAR, "How probable road is, by the network", exact=False
)


def bind(settings: NetSettings, _parameters: None) -> Callable[[View], Output]:
    """Return the network as a pure function of a view; a `NetworkError`, see `Network.of`."""
    network = Network.of(settings)

    def run(view: View) -> Output:
        """Return the road of a view, and its probability as a map."""
        try:
            output = network.road(view.image)
        except NetworkError as error:
            raise StageError.of(error, "net") from error
        assert output.mask is not None
        codes = output.probability
        levels = 255 * output.mask.pixels() if codes is None else (codes >> 8).astype(np.uint8)
        return replace(output, layers=(Layer(PROBABILITY, levels), Layer(NET, output.mask)))

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

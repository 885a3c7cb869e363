"""Networks: whatever the bytes, a mask of the frame's size, or a refusal in one line."""

from __future__ import annotations

import numpy as np

from roadeval.networks import NetSettings, Network
from tests.fuzz.harness import Harness, scratch
from tests.networks.making import network, red_network

IMAGE = np.tile(np.uint8([[[40, 90, 30]], [[170, 170, 175]]]), (10, 30, 1))


def check(data: bytes) -> None:
    """Run these bytes as a network."""
    path = scratch() / "network.onnx"
    path.write_bytes(data)
    road = Network.of(NetSettings(file=str(path))).road(IMAGE)
    assert road.mask.shape == IMAGE.shape[:2]


def seeds() -> list[bytes]:
    """Return small networks of each kind of output."""
    path = scratch() / "seed.onnx"
    made = [red_network(path).read_bytes()]
    for last in (None, "Softmax", "ArgMax"):
        names = {"names": "{0: 'verge', 1: 'road'}", "license": "MIT"}
        made.append(network(path, last=last, metadata=names).read_bytes())
    made.append(network(path, input_shape=(1, 12, 16, 3)).read_bytes())
    return made


HARNESS = Harness(check, seeds, quick=40)

"""Who runs a network: what is installed, and one thread at a time in each of OpenCV's networks."""

import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from roadeval.networks import backends
from roadeval.networks.errors import NetworkError
from roadeval.networks.network import Network
from roadeval.networks.onnx_file import read_onnx
from roadeval.networks.settings import NetSettings
from tests.networks.making import network


class Slow:
    """A network of OpenCV's that notices when a second thread enters it."""

    def __init__(self):
        self.entered = 0

    def setInput(self, values):
        self.entered += 1
        self.values = values

    def getUnconnectedOutLayersNames(self):
        return ("road",)

    def forward(self, _names):
        time.sleep(0.01)
        assert self.entered == 1
        self.entered = 0
        return [self.values]


def test_no_two_threads_share_one_of_opencvs_networks(monkeypatch, tmp_path):
    made = []
    monkeypatch.setattr(
        backends.cv2.dnn, "readNetFromONNX", lambda _: made.append(Slow()) or made[-1]
    )
    running = backends.opened(read_onnx(network(tmp_path / "n.onnx")), "opencv")
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda n: running.run(np.full(1, n), ["road"]), range(40)))
    assert [each[0][0] for each in found] == [*range(40)]
    assert len(made) <= 4


def test_onnxruntime_runs_a_network_where_it_is_installed(monkeypatch, tmp_path):
    path = str(network(tmp_path / "n.onnx"))
    assert Network.of(NetSettings(file=path)).settings.backend == "onnxruntime"
    monkeypatch.setattr(backends, "find_spec", lambda _name: None)
    assert Network.of(NetSettings(file=path)).settings.backend == "opencv"


def test_without_onnxruntime_its_extra_is_named(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    monkeypatch.setattr(backends, "find_spec", lambda _name: None)
    with pytest.raises(NetworkError, match=r"onnxruntime is not installed: pip install"):
        Network.of(NetSettings(file=str(network(tmp_path / "n.onnx")), backend="onnxruntime"))
    unknown = network(tmp_path / "u.onnx", operator="Unheard")
    with pytest.raises(NetworkError, match=r"onnxruntime may, pip install 'roadeval\[onnx\]'"):
        Network.of(NetSettings(file=str(unknown)))

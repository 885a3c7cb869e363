"""What the tests of networks that are sound share."""

from types import SimpleNamespace

import pytest

from roadeval.networks import onnx_file


@pytest.fixture
def opened_here_alone(monkeypatch):
    """Open no file in another process first: that takes most of the time."""
    done = SimpleNamespace(run=lambda *_, **__: SimpleNamespace(returncode=0))
    monkeypatch.setattr(onnx_file, "subprocess", done)

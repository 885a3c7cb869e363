"""The examples in docstrings."""

import doctest

import pytest

from roadeval.recording import rule
from roadeval.recording.read import recording as reading


@pytest.mark.parametrize("module", [rule, reading])
def test_examples(module, recording, monkeypatch):
    monkeypatch.chdir(recording.path.parent)
    outcome = doctest.testmod(module)
    assert outcome.attempted
    assert not outcome.failed

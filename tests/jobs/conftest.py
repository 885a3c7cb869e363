"""Replays without figures, which take most of a small run's time."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from functools import partial
from importlib import import_module
from unittest import mock

import pytest

Figures = Callable[[], AbstractContextManager[object]]
"""Within ``with figures():`` replays draw them."""


@pytest.fixture(scope="module", autouse=True)
def figures() -> Iterator[Figures]:
    replay = import_module("roadeval.jobs.replay")
    drawing = partial(mock.patch.object, replay, "write_figures", replay.write_figures)
    with mock.patch.object(replay, "write_figures", return_value=[]):
        yield drawing

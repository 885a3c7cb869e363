"""One small drive and one scene, made once for all tests of the room."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
from unittest import mock

import numpy as np
import pytest

from roadeval.synth import RenderSettings, SynthFrame, drive, render_drive
from roadeval.synth.journey import Journey
from roadeval.synth.scene import Scene, build


@pytest.fixture(scope="session")
def settings() -> RenderSettings:
    """As long as the drive that ships, but with fewer and smaller frames."""
    return RenderSettings(frames=50, width=160, height=120, rate_hz=5.0)


@pytest.fixture(scope="session")
def same_scene() -> Callable[[], AbstractContextManager[object]]:
    """Within ``with same_scene():`` drives of one seed and length have one scene, built once."""
    built: dict[Journey, Scene] = {}

    def build_once(journey: Journey, rng: np.random.Generator) -> Scene:
        if journey not in built:
            built[journey] = build(journey, rng)
        return built[journey]

    return partial(mock.patch.object, drive, "build", build_once)


@pytest.fixture(scope="session")
def frames(
    settings: RenderSettings, same_scene: Callable[[], AbstractContextManager[object]]
) -> list[SynthFrame]:
    with same_scene():
        return list(render_drive(settings))


@pytest.fixture(scope="session")
def journey() -> Journey:
    return Journey.drawn(10.0, np.random.default_rng(11))


@pytest.fixture(scope="session")
def scene(journey: Journey) -> Scene:
    return build(journey, np.random.default_rng(12))

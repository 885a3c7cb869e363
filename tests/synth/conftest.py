"""One small drive and one scene, made once for all tests of the room."""

import numpy as np
import pytest

from roadeval.synth import RenderSettings, SynthFrame, render_drive
from roadeval.synth.journey import Journey
from roadeval.synth.scene import Scene, build


@pytest.fixture(scope="session")
def settings() -> RenderSettings:
    """As long as the drive that ships, but with fewer and smaller frames."""
    return RenderSettings(frames=50, width=160, height=120, rate_hz=5.0)


@pytest.fixture(scope="session")
def frames(settings: RenderSettings) -> list[SynthFrame]:
    return list(render_drive(settings))


@pytest.fixture(scope="session")
def journey() -> Journey:
    return Journey.drawn(10.0, np.random.default_rng(11))


@pytest.fixture(scope="session")
def scene(journey: Journey) -> Scene:
    return build(journey, np.random.default_rng(12))

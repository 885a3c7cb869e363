"""Ground textures: sharp near by, averaged along the road far away."""

import cv2
import numpy as np
import pytest

from roadeval.synth.noise import Field, coloured_noise
from roadeval.synth.texture import GroundTexture

STRIPES = np.tile(np.repeat(np.float32([0, 1]), 2), 16).reshape(64, 1).repeat(8, axis=1)


def at(texture: GroundTexture, offset: float, z: float, length: float) -> float:
    point = (np.full((1, 1), value, np.float32) for value in (offset, z))
    return float(texture.sample(*point, np.full(1, length, np.float32))[0, 0])


def test_the_finest_level_is_sampled_as_it_is() -> None:
    texture = GroundTexture.averaged(STRIPES, cell=1.0, left=-4.0, start=0.0)
    assert [at(texture, 0.5, z + 0.5, 1.0) for z in range(4)] == [0.0, 0.0, 1.0, 1.0]


def test_a_long_patch_shows_the_mean() -> None:
    texture = GroundTexture.averaged(STRIPES, cell=1.0, left=-4.0, start=0.0)
    assert at(texture, 0.5, 30.3, 4.0) == pytest.approx(0.5)


def test_a_texture_wraps_around_or_ends_in_a_value() -> None:
    wrapped = GroundTexture.averaged(STRIPES, cell=1.0, left=-4.0, start=0.0)
    ended = GroundTexture.averaged(STRIPES, cell=1.0, left=-4.0, start=0.0, outside=0.25)
    assert at(wrapped, 0.5, 66.5, 1.0) == 1.0
    assert at(ended, 0.5, 80.5, 1.0) == 0.25


@pytest.mark.parametrize("slope", [0.0, 1.0])
def test_noise_is_normalised_and_periodic(slope: float) -> None:
    noise = coloured_noise(np.random.default_rng(3), (64, 64), 4, 32, slope)
    assert noise.mean() == pytest.approx(0.0, abs=1e-5)
    assert noise.std() == pytest.approx(1.0, abs=1e-5)
    assert np.abs(noise[0] - noise[-1]).max() < 1.5 * np.abs(np.diff(noise, axis=0)).max()


def test_steeper_noise_is_smoother() -> None:
    def roughness(slope: float) -> Field:
        noise = coloured_noise(np.random.default_rng(3), (64, 64), 2, 64, slope)
        return np.abs(cv2.Laplacian(noise, cv2.CV_32F)).mean()

    assert roughness(1.5) < 0.5 * roughness(0.0)

"""Exposure, noise and response of the camera."""

import numpy as np
import pytest

from roadeval.synth.light import SKY, SUN
from roadeval.synth.noise import Field
from roadeval.synth.sensor import FULL_WELL, LEVELS, MIDDLE, READ_NOISE, Sensor, response


def grey(level: float) -> Field:
    return np.full((120, 160, 3), level, np.float32)


def rng() -> np.random.Generator:
    return np.random.default_rng(5)


def test_the_response_rises_from_black_to_white() -> None:
    codes = response().astype(int)
    assert (np.diff(codes) >= 0).all()
    assert (codes[0], codes[-1]) == (0, 255)


def test_a_grey_card_in_daylight_is_grey() -> None:
    card = np.broadcast_to(0.18 * (SUN + SKY), (120, 160, 3)).astype(np.float32)
    image = Sensor(160, 120, 0.1).expose(card, rng())
    assert np.ptp(image.mean((0, 1))) < 1.0


def test_the_first_image_is_well_exposed() -> None:
    image = Sensor(160, 120, 0.1).expose(grey(0.3), rng())
    middle = response()[round(MIDDLE * LEVELS)]
    assert image[60, 70:90].mean() == pytest.approx(middle, abs=4)


def test_the_exposure_follows_a_darker_scene_with_a_delay() -> None:
    sensor = Sensor(160, 120, 0.1)
    before = sensor.expose(grey(0.4), rng()).mean()
    darker = [sensor.expose(grey(0.1), rng()).mean() for _ in range(30)]
    assert darker[0] < 0.8 * before
    assert darker[-1] == pytest.approx(before, rel=0.03)


def test_noise_is_that_of_counting_electrons_and_reading_them() -> None:
    image = Sensor(160, 120, 0.1).expose(grey(0.3), rng())
    codes = response().astype(float)
    slope = np.gradient(codes)[round(MIDDLE * LEVELS) - 40 : round(MIDDLE * LEVELS) + 40].mean()
    expected = np.sqrt(MIDDLE / FULL_WELL + (READ_NOISE / FULL_WELL) ** 2) * LEVELS * slope
    measured = image[50:70, 60:100, 1].std()
    assert measured == pytest.approx(expected, rel=0.15)


def test_corners_are_a_little_darker() -> None:
    image = Sensor(160, 120, 0.1).expose(grey(0.3), rng()).astype(float)
    assert 0.7 < image[:10, :10].mean() / image[55:65, 75:85].mean() < 0.95

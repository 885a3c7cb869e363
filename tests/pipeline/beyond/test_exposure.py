"""Exposure: the ground in front of the vehicle gets the same grey, whatever the light."""

import numpy as np
import pytest

from roadeval.pipeline.beyond import exposure
from roadeval.pipeline.reference_patch import ReferencePatch, patch_mask
from roadeval.pipeline.scene import LEVEL, expose, gains
from roadeval.pipeline.stage import View

PATCH = ReferencePatch()


def scene(road, elsewhere=(10, 200, 90), shape=(40, 60)):
    """An image with one colour in the reference patch and another one elsewhere."""
    patch = patch_mask(*shape, PATCH)
    return np.where(patch[..., None] > 0, road, elsewhere).astype(np.uint8)


def run(image):
    return exposure.bind(exposure.ExposureSettings(), None)(View.of(image))


def test_the_patch_turns_grey():
    image = scene((48, 96, 192))
    patch = patch_mask(40, 60, PATCH) > 0
    assert (run(image).image[patch] == 96).all()


def test_each_channel_is_multiplied_everywhere():
    output = run(scene((48, 96, 192)))
    assert output.image[0, 0, [0, 2]].tolist() == [20, 45]


def test_what_is_brighter_than_the_patch_is_compressed_and_keeps_its_order():
    # 96 + 159 (x - 96) / (x - 96 + 159), with x of 200, of 2 * 200, and of 1.
    colour = run(scene((48, 96, 192), elsewhere=(200, 200, 1))).image[0, 0].tolist()
    assert colour == [200, 159, 0]
    greys = np.repeat(np.arange(256, dtype=np.uint8)[:, None], 3, axis=1)[None]
    tones = expose(greys, np.full(3, 3.0), LEVEL)[0, :, 0].astype(int)
    assert (np.diff(tones[:64]) >= 1).all()
    assert (np.diff(tones) >= 0).all()
    assert tones[32] == 96
    assert tones[-1] < 255


def test_the_median_is_what_counts_not_what_stands_on_the_road():
    image = scene((48, 48, 48))
    image[:, 32:] = 255  # two fifths of the patch
    assert gains(image, PATCH)[0] == 2.0


@pytest.mark.parametrize(("grey", "gain"), [(0, 6.0), (1, 6.0), (255, LEVEL / 255)])
def test_gains_are_bounded(grey, gain):
    assert gains(scene((grey,) * 3), PATCH)[0] == gain


def test_the_same_scene_under_another_exposure_gives_nearly_the_same_image():
    rng = np.random.default_rng(0)
    light = rng.uniform(40, 100, (40, 60, 3))
    dim = run(np.rint(light).astype(np.uint8)).image.astype(int)
    bright = run(np.rint(light * [1.8, 1.5, 1.2]).astype(np.uint8)).image.astype(int)
    assert np.abs(dim - bright).max() <= 4

"""What the reference patch teaches where there is no truth."""

import numpy as np
import pytest

from roadeval.data import NON_ROAD, ROAD
from roadeval.pipeline.reference_patch import ReferencePatch, patch_mask
from roadeval.training import TrainingSettings
from roadeval.training.learning import WIDTH, patch_truth

HEIGHT = 120
SETTINGS = TrainingSettings()


def street(grey=100, kerb=112, pavement=100, shade=0.8):
    """A street with noise, a kerb and a pavement on its right, and a shadow across its middle."""
    image = np.full((2 * HEIGHT, 2 * WIDTH, 3), float(grey))
    image[:, 2 * kerb :] = pavement
    image[:, 2 * kerb : 2 * kerb + 4] = 0.5 * grey
    image[120:150] *= shade
    noise = np.random.default_rng(0).normal(0, 1, image.shape[:2])
    return (image + noise[..., None]).clip(0, 255).astype(np.uint8)


def test_what_is_reached_without_crossing_a_kerb_is_road():
    truth = patch_truth(street(), SETTINGS)
    low = truth[100:]
    assert (low[:, :216] == ROAD).mean() > 0.99
    assert (low[:, 232:] == NON_ROAD).mean() > 0.99


def test_the_pavement_is_road_where_the_kerb_is_lowered():
    lowered = street()
    lowered[200:] = street(kerb=WIDTH)[200:]
    assert (patch_truth(lowered, SETTINGS)[100:, 232:] == ROAD).mean() > 0.5


def test_the_further_one_may_reach_the_more_is_road():
    found = [
        (patch_truth(street(), TrainingSettings(far=far))[100:, 232:] == ROAD).mean()
        for far in (1.0, 20.0)
    ]
    assert found[0] < 0.01
    assert found[1] > 0.99


def test_nothing_above_the_horizon_is_road():
    grey = np.full((40, 60, 3), 120, np.uint8)
    truth = patch_truth(grey, TrainingSettings(horizon=0.4))
    assert (truth[:16] == NON_ROAD).all()
    assert (truth[16:] == ROAD).all()


@pytest.mark.parametrize("shape", [(24, 32), (240, 320), (33, 47)])
def test_the_patch_is_road_whatever_it_shows(shape):
    image = np.random.default_rng(0).integers(0, 256, (*shape, 3), dtype=np.uint8)
    truth = patch_truth(image, TrainingSettings(horizon=1.0, far=0.01))
    assert truth.dtype == np.uint8
    np.testing.assert_array_equal(truth == ROAD, patch_mask(*shape, ReferencePatch()) > 0)

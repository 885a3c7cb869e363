"""Fitting the variants."""

import numpy as np
import pytest

from roadeval.data import NON_ROAD, ROAD
from roadeval.pipeline.reference_patch import ReferencePatch, patch_mask
from roadeval.pipeline.stage import View
from roadeval.training.learning import WIDTH, TrainingError, fit, patch_truth, sample
from roadeval.training.settings import TrainingSettings
from tests.training.making import frame, pipelines

FRAMES = [frame(n) for n in range(3)]


def test_a_fitted_variant_finds_the_road_in_a_new_frame():
    pipeline = pipelines()["unfiltered"]
    model = fit(FRAMES, {"unfiltered": pipeline}, TrainingSettings())
    chain = pipeline.bind(model.parameters["unfiltered"])
    fresh = frame(9)
    masks = {
        result.stage: result.output.mask.pixels() for result in chain.run(View.of(fresh.image))
    }
    for name in ("similarity", "svm", "post"):
        wrong = (masks[name] != fresh.truth).mean()
        assert wrong < 0.06, name


def test_road_colour_is_the_mean_of_the_sampled_road_pixels():
    model = fit(FRAMES, pipelines(), TrainingSettings(pixels_per_class=10_000))
    road = np.concatenate([f.image[f.truth == 1] for f in FRAMES]).astype(float)
    colour = model.parameters["unfiltered"]["similarity"]
    # Every road pixel is drawn: there are as many as of the verge.
    np.testing.assert_allclose(colour.mean, road.mean(axis=0))
    np.testing.assert_allclose(colour.covariance, np.cov(road.T, ddof=0))


def test_training_twice_gives_the_same_model():
    first, second = (fit(FRAMES, pipelines(), TrainingSettings()) for _ in range(2))
    machines = [m.parameters["filtered"]["svm"] for m in (first, second)]
    np.testing.assert_array_equal(machines[0].vectors, machines[1].vectors)
    np.testing.assert_array_equal(machines[0].weights, machines[1].weights)


def test_one_class_alone_is_an_error_that_names_the_frames():
    sky = frame(4)
    sky.truth[:] = 0
    with pytest.raises(TrainingError, match="frames 4 to 4 do not show both road and non-"):
        fit([sky], pipelines(), TrainingSettings())


# --- Which pixels train ---------------------------------------------------------------------------

HALF = np.repeat([[1], [0]], [4, 4], axis=0).repeat(10, axis=1).astype(np.uint8)


def test_both_classes_are_drawn_equally_from_every_frame():
    pixels = sample([HALF, HALF], TrainingSettings(pixels_per_class=5))
    assert len(pixels.road) == 20
    for number in (0, 1):
        for road in (True, False):
            assert ((pixels.frame == number) & (pixels.road == road)).sum() == 5


def test_a_frame_without_road_still_gives_its_other_pixels():
    pixels = sample([np.zeros_like(HALF), HALF], TrainingSettings(pixels_per_class=4))
    assert (pixels.road.sum(), (~pixels.road).sum()) == (4, 4)
    assert set(pixels.frame[~pixels.road]) == {0, 1}


@pytest.mark.parametrize("frames", [1, 7, 60])
def test_the_sample_is_bounded_however_many_frames_there_are(frames):
    pixels = sample([HALF] * frames, TrainingSettings(max_pixels=40))
    assert len(pixels.road) <= 40


def test_the_seed_settles_the_draw():
    drawn = [sample([HALF], TrainingSettings(pixels_per_class=5, seed=s)) for s in (1, 1, 2)]
    np.testing.assert_array_equal(drawn[0].column, drawn[1].column)
    assert (drawn[0].column != drawn[2].column).any()


# --- What the reference patch teaches -------------------------------------------------------------

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
    shares = [
        (patch_truth(street(), TrainingSettings(far=far))[100:, 232:] == ROAD).mean()
        for far in (1.0, 20.0)
    ]
    assert shares[0] < 0.01
    assert shares[1] > 0.99


@pytest.mark.parametrize("shape", [(24, 32), (240, 320), (33, 47)])
def test_the_patch_is_road_whatever_it_shows(shape):
    image = np.random.default_rng(0).integers(0, 256, (*shape, 3), dtype=np.uint8)
    truth = patch_truth(image, TrainingSettings(horizon=1.0, far=0.01))
    assert truth.dtype == np.uint8
    np.testing.assert_array_equal(truth == ROAD, patch_mask(*shape, ReferencePatch()) > 0)

"""Training frames with something on the ground in front of the vehicle."""

import numpy as np
import pytest

from roadeval.config import configure
from roadeval.data import Frame
from roadeval.pipeline.reference_patch import ReferencePatch, patch_mask
from roadeval.training import fit
from roadeval.training.covering import Shown, covered, obstructed, tinted

PATCH = ReferencePatch()
HEIGHT, WIDTH = 60, 80


def frame(seed=0, ignored=False):
    """Return noise, of which the lower two thirds are road, and all else is brighter."""
    draw = np.random.default_rng(seed)
    image = draw.integers(60, 100, (HEIGHT, WIDTH, 3)).astype(np.uint8)
    truth = np.zeros((HEIGHT, WIDTH), np.uint8)
    truth[HEIGHT // 3 :, 10:-10] = 1
    image[truth == 0] += 100
    if ignored:
        truth[50:, 30:50] = 255
    return Shown(image, truth)


FRAMES = [frame(seed) for seed in range(6)]


@pytest.mark.parametrize(("share", "count"), [(0, 0), (0.5, 3), (1, 6)])
def test_a_share_of_the_frames_is_covered(share, count):
    assert len([*covered(FRAMES, share, PATCH, 0)]) == count


def test_the_same_seed_covers_the_same_and_another_seed_other_things():
    first, again, other = (
        np.stack([each.image for each in covered(FRAMES, 1, PATCH, seed)]) for seed in (0, 0, 1)
    )
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


def test_the_frames_themselves_stay_as_they_are():
    before = [(each.image.copy(), each.truth.copy()) for each in FRAMES]
    assert len([*covered(FRAMES, 1, PATCH, 0)]) == len(FRAMES)
    for (image, truth), own in zip(before, FRAMES, strict=True):
        np.testing.assert_array_equal(image, own.image)
        np.testing.assert_array_equal(truth, own.truth)


def test_one_in_five_shows_an_obstacle_and_the_others_keep_their_truth():
    shown = [*covered(FRAMES * 5, 1, PATCH, 0)]
    road = (FRAMES[0].truth == 1).sum()
    assert sum((each.truth == 1).sum() < road for each in shown) == 6


@pytest.mark.parametrize("seed", range(8))
def test_a_tint_changes_road_alone_and_most_of_the_patch(seed):
    own = frame()
    found = tinted(own, PATCH, np.random.default_rng(seed))
    changed = (found.image != own.image).any(axis=2)
    assert found.truth is own.truth
    assert not changed[own.truth != 1].any()
    assert changed[patch_mask(HEIGHT, WIDTH, PATCH) > 0].mean() > 0.5


def test_a_tint_multiplies_each_channel_by_one_gain():
    own = frame()
    found = tinted(own, PATCH, np.random.default_rng(3))
    changed = (found.image != own.image).all(axis=2) & (found.image < 255).all(axis=2)
    gains = found.image[changed] / own.image[changed]
    np.testing.assert_allclose(gains, np.broadcast_to(gains.mean(axis=0), gains.shape), atol=0.02)


@pytest.mark.parametrize("seed", range(8))
def test_an_obstacle_is_a_piece_of_non_road_on_the_patch(seed):
    own = frame(ignored=True)
    found = obstructed(own, FRAMES, PATCH, np.random.default_rng(seed))
    changed = found.truth != own.truth
    assert (found.truth[changed] == 0).all()
    assert (own.truth[changed] == 1).all()
    np.testing.assert_array_equal(found.truth == 255, own.truth == 255)
    assert (changed & (patch_mask(HEIGHT, WIDTH, PATCH) > 0)).any()
    # What is not road is brighter here, in whatever shade it stands.
    tone = found.image[changed].mean() / own.image[own.truth == 0].mean()
    assert 0.1 < tone < 1.4


def test_where_no_frame_shows_anything_but_road_nothing_stands_there():
    road = Shown(FRAMES[0].image, np.ones((HEIGHT, WIDTH), np.uint8))
    assert obstructed(road, [road], PATCH, np.random.default_rng(0)) is road


def test_covered_frames_teach_and_are_no_training_frames_of_the_model():
    frames = [
        Frame(number, 0, 0, each.image, each.image.tobytes(), truth=each.truth)
        for number, each in enumerate(FRAMES)
    ]
    models = []
    for share in (0.0, 1.0):
        config = configure({"preset": "paper", "training": {"covered": share}})
        models.append(fit(frames, config.pipelines(), config.training))
    plain, more = models
    assert more.digests == plain.digests
    assert len(more.fingerprints) == len(frames)
    assert more.pixels > plain.pixels

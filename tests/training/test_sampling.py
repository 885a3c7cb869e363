"""Which pixels train."""

import numpy as np
import pytest

from roadeval.training import TrainingSettings
from roadeval.training.learning import sample

HALF = np.repeat([[1], [0]], [4, 4], axis=0).repeat(10, axis=1).astype(np.uint8)


def test_both_classes_are_drawn_equally_from_every_frame():
    pixels = sample([HALF, HALF], TrainingSettings(pixels_per_class=5))
    assert len(pixels.road) == 20
    for frame in (0, 1):
        for road in (True, False):
            assert ((pixels.frame == frame) & (pixels.road == road)).sum() == 5


def test_drawn_pixels_bear_their_label():
    pixels = sample([HALF], TrainingSettings(pixels_per_class=7))
    np.testing.assert_array_equal(HALF[pixels.row, pixels.column] == 1, pixels.road)


def test_no_pixel_is_drawn_twice():
    pixels = sample([HALF], TrainingSettings(pixels_per_class=40))
    assert len(set(zip(pixels.row.tolist(), pixels.column.tolist(), strict=True))) == 80


def test_ignored_pixels_are_never_drawn():
    truth = HALF.copy()
    truth[:, 3:] = 255
    pixels = sample([truth], TrainingSettings(pixels_per_class=100))
    assert len(pixels.road) == 2 * 12
    assert pixels.column.max() == 2


def test_the_rarer_class_sets_the_size_of_both():
    truth = np.zeros((10, 10), np.uint8)
    truth[0, :3] = 1
    pixels = sample([truth], TrainingSettings(pixels_per_class=50))
    assert (pixels.road.sum(), (~pixels.road).sum()) == (3, 3)


def test_a_frame_without_road_still_gives_its_other_pixels():
    pixels = sample([np.zeros_like(HALF), HALF], TrainingSettings(pixels_per_class=4))
    assert (pixels.road.sum(), (~pixels.road).sum()) == (4, 4)
    assert set(pixels.frame[~pixels.road]) == {0, 1}


@pytest.mark.parametrize("frames", [1, 7, 60])
def test_the_sample_is_bounded_however_many_frames_there_are(frames):
    pixels = sample([HALF] * frames, TrainingSettings(max_pixels=40))
    assert len(pixels.road) <= 40


def test_one_class_alone_gives_no_sample():
    assert len(sample([np.ones((4, 4), np.uint8)], TrainingSettings()).road) == 0


def test_the_seed_settles_the_draw():
    drawn = [sample([HALF], TrainingSettings(pixels_per_class=5, seed=s)) for s in (1, 1, 2)]
    np.testing.assert_array_equal(drawn[0].column, drawn[1].column)
    assert (drawn[0].column != drawn[2].column).any()

"""The mask that never looks at the image."""

import numpy as np
import pytest

from roadeval.evaluation.score import BlindPrior
from tests.evaluation.making import pixels


def test_the_prior_is_the_mean_truth() -> None:
    prior = BlindPrior.of_truths([pixels("##.."), pixels("#.#."), pixels("#...")])
    assert prior.road.dtype == np.float32
    assert prior.road == pytest.approx(np.array([[1, 1 / 3, 1 / 3, 0]]))


def test_ignored_pixels_are_left_out_of_the_mean() -> None:
    prior = BlindPrior.of_truths([pixels("?#?"), pixels("##?")])
    assert prior.road.tolist() == [[1, 1, 0]]


def test_road_is_where_at_least_half_of_the_frames_had_it() -> None:
    prior = BlindPrior(np.array([[0.0, 0.49, 0.5, 1.0]], np.float32))
    assert (prior.mask((1, 4)).pixels() == pixels("..##")).all()


def test_the_mask_fits_a_frame_of_another_size() -> None:
    prior = BlindPrior.of_truths([pixels("..##", "..##")])
    assert (prior.mask((4, 8)).pixels() == pixels(*["....####"] * 4)).all()


def test_truths_of_several_sizes_make_one_prior() -> None:
    prior = BlindPrior.of_truths([pixels("..##"), pixels(*["....####"] * 2)])
    assert prior.road.tolist() == [[0, 0, 1, 1]]


def test_a_prior_needs_a_truth() -> None:
    with pytest.raises(ValueError, match="at least one"):
        BlindPrior.of_truths([])


def test_nobody_can_spoil_the_shared_mask() -> None:
    mask = BlindPrior.of_truths([pixels("#.")]).mask((1, 2))
    with pytest.raises(ValueError, match="read-only"):
        mask.bits[0, 0] = 0

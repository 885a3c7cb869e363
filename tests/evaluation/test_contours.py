"""How well a mask follows the road's edge."""

import math

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from roadeval.data import IGNORE, TruthBits, pack
from roadeval.evaluation import edges_and_flicker as contours
from roadeval.evaluation.counts import disk
from tests.evaluation.making import pixels, unpacked


def one(mask, truth, width=1):
    packed = TruthBits.of(truth)
    return contours.boundary_f({"net": pack(mask)}, packed, width)["net"]


def edge_of(labels):
    return unpacked(contours.edge_of(TruthBits.of(labels)), labels.shape[1])


def test_an_edge_is_road_that_touches_non_road_by_side_or_corner():
    labels = pixels("###.", "####", "####")
    assert edge_of(labels).tolist() == [[0, 0, 1, 0], [0, 0, 1, 1], [0, 0, 0, 0]]


def test_neither_the_border_nor_an_ignored_pixel_makes_an_edge():
    assert not edge_of(pixels("##", "##")).any()
    assert not edge_of(pixels("##?.", "##?.")).any()


def test_the_neighbourhood_is_a_disk():
    assert disk(1).tolist() == [1, 0]
    assert disk(5).tolist() == [5, 4, 4, 4, 3, 0]


def test_a_mask_whose_edge_lies_within_the_width_has_1_and_beyond_it_0():
    truth = pixels("##......", "##......")
    near, far = pixels("###.....", "###....."), pixels("####....", "####....")
    assert one(truth, truth) == 1
    assert one(near, truth) == 1
    assert one(far, truth) == 0
    assert one(far, truth, width=2) == 1


def test_by_hand():
    truth = pixels("##......", "##......")
    mask = pixels("##...##.", "##......")
    # Four edge pixels of the mask, two of them near the truth's two: P = 1/2, R = 1.
    assert one(mask, truth) == pytest.approx(2 / 3)


def test_what_the_mask_does_among_ignored_pixels_does_not_count():
    truth = pixels("##..????", "##..????")
    assert one(pixels("##....##", "##...#.#"), truth) == 1


def test_one_edge_alone_gives_0_and_none_at_all_is_undefined():
    truth, empty = pixels("##..", "##.."), pixels("....", "....")
    assert one(empty, truth) == 0
    assert one(truth, empty) == 0
    assert math.isnan(one(empty, empty))


def plain(mask, truth, width):
    """The same by SciPy's exact Euclidean distances, pixel by pixel."""

    def edge(labels):
        found = np.zeros(labels.shape, bool)
        for (row, column), value in np.ndenumerate(labels):
            around = labels[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
            found[row, column] = value == 1 and (around == 0).any()
        return found

    mine, theirs = edge(np.where(truth == IGNORE, IGNORE, mask)), edge(truth)
    precision = (distance_transform_edt(~theirs) <= width)[mine].mean()
    recall = (distance_transform_edt(~mine) <= width)[theirs].mean()
    return 2 * precision * recall / (precision + recall)


@pytest.mark.parametrize("width", [1, 2, 5])
def test_equals_distance_transforms(width):
    draw = np.random.default_rng(width)
    rows = np.arange(60)[:, None]
    truth = (rows > 20 + 6 * np.sin(np.arange(80) / 7)).astype(np.uint8)
    mask = (rows > 22 + 9 * np.sin(np.arange(80) / 6)).astype(np.uint8)
    mask[draw.random(mask.shape) < 0.01] ^= 1
    truth[30:40, 30:50] = IGNORE
    score = one(mask, truth, width)
    assert 0 < score < 1
    assert score == pytest.approx(plain(mask, truth, width), rel=1e-12)

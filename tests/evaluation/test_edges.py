"""How well masks follow the edge of the road, and what they do from frame to frame."""

import math

import cv2
import numpy as np
import pytest
from scipy.ndimage import distance_transform_cdt, distance_transform_edt
from skimage.segmentation import find_boundaries

from roadeval.data import IGNORE, FrameResult, Role, TruthBits, pack
from roadeval.evaluation.score import counts
from roadeval.evaluation.score.counts import TRIMAP, EdgesAndFlicker
from tests.evaluation.making import a_frame, a_variant, pixels, unpacked

TRUTH = pixels("##..", "##.?")


def contour(mask, truth, width=1, widths=TRIMAP):
    """Boundary F, boundary IoU and trimap of a mask."""
    return counts.contours({"net": pack(mask)}, TruthBits.of(truth), width, widths)["net"]


def one(mask, truth, width=1):
    return contour(mask, truth, width)[0]


def edge_of(labels):
    return unpacked(counts.edge_of(TruthBits.of(labels)), labels.shape[1])


def test_neither_the_border_nor_an_ignored_pixel_makes_an_edge():
    assert not edge_of(pixels("##", "##")).any()
    assert not edge_of(pixels("##?.", "##?.")).any()


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
    found = one(mask, truth, width)
    assert 0 < found < 1
    assert found == pytest.approx(plain(mask, truth, width), rel=1e-12)


# --- Boundary IoU


def rims_overlap(mask, truth):
    return contour(mask, truth)[1]


def wavy(seed, shape=(120, 160), ignored=True):
    """A truth and a mask, each with a wavy upper edge and some noise."""
    draw = np.random.default_rng(seed)
    rows, columns = np.arange(shape[0])[:, None], np.arange(shape[1])
    truth, mask = (
        (rows > shape[0] / 3 + draw.uniform(3, 9) * np.sin(columns / draw.uniform(6, 12))).astype(
            np.uint8
        )
        for _ in range(2)
    )
    mask[draw.random(shape) < 0.003] ^= 1
    if ignored:
        truth[draw.random(shape) < 0.05] = IGNORE
        truth[60:90, 40:70] = IGNORE
    return truth, mask


def authors_rim(mask, dilation_ratio=0.02):
    """The band of a mask as the authors of boundary IoU compute it."""
    height, width = mask.shape
    steps = max(1, round(dilation_ratio * np.sqrt(height**2 + width**2)))
    padded = cv2.copyMakeBorder(mask, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    kept = cv2.erode(padded, np.ones((3, 3), np.uint8), iterations=steps)
    return (mask - kept[1:-1, 1:-1]).astype(bool)


@pytest.mark.parametrize("shape", [(120, 160), (97, 65), (480, 640), (3, 200)])
def test_boundary_iou_is_the_authors_own_where_everything_is_labelled(shape):
    truth, mask = wavy(7, shape, ignored=False)
    ours, theirs = authors_rim(mask), authors_rim(truth)
    expected = (ours & theirs).sum() / (ours | theirs).sum()
    assert 0 < expected < 1
    assert rims_overlap(mask, truth) == expected


def scattered(seed):
    """A small truth and a mask without any order."""
    draw = np.random.default_rng(seed)
    values = draw.choice([[0, 1, IGNORE], [0, 0, IGNORE], [0, 1, 1]])
    return draw.choice(np.array(values, np.uint8), (8, 8)), draw.integers(0, 2, (8, 8), np.uint8)


PAIRS = [[*map(wavy, range(4))], [*map(scattered, range(200))]]
with_ignored = pytest.mark.parametrize("pairs", PAIRS, ids=["wavy", "scattered"])


def steps_to(pixels):
    """Steps of a king from each pixel to the nearest of these; many where there is none."""
    return distance_transform_cdt(~pixels, "chessboard") if pixels.any() else np.full((8, 8), 99)


@with_ignored
def test_boundary_iou_with_ignored_pixels_equals_distance_transforms(pairs):
    defined = 0
    for truth, mask in pairs:
        labelled, width = truth != IGNORE, max(1, round(0.02 * np.hypot(*truth.shape)))
        ours, theirs = (
            labelled
            & road
            & (steps_to(np.pad(labelled & ~road, 1, constant_values=True))[1:-1, 1:-1] <= width)
            for road in (mask == 1, truth == 1)
        )
        found, either = rims_overlap(mask, truth), (ours | theirs).sum()
        assert found == (ours & theirs).sum() / either if either else math.isnan(found)
        defined += either > 0
    assert defined > len(pairs) / 2


def test_boundary_iou_is_undefined_without_road():
    truth = pixels("..?.", "....")
    assert math.isnan(rims_overlap(pixels("..#.", "...."), truth))
    assert rims_overlap(pixels("#...", "...."), truth) == 0


def test_an_edge_is_scikit_images_inner_boundary():
    truth, _ = wavy(3, ignored=False)
    inner = find_boundaries(truth, connectivity=2, mode="inner", background=0)
    assert inner.any()
    np.testing.assert_array_equal(edge_of(truth), inner)


# --- Trimap


def near_edge(mask, truth, widths=TRIMAP):
    return contour(mask, truth, widths=widths)[2].tolist()


@with_ignored
def test_the_trimap_equals_distance_transforms(pairs):
    wrong, widths = 0, sorted({1, 3, 4, *TRIMAP})
    for truth, mask in pairs:
        to_road, to_other = (steps_to(truth == value) for value in (1, 0))
        expected = []
        for width in widths:
            near = (to_road <= width) & (to_other <= width) & (truth != IGNORE)
            expected.append([int((near & (mask != truth)).sum()), int(near.sum())])
        assert near_edge(mask, truth, widths) == expected
        wrong += expected[0][0]
    assert wrong > len(pairs)


# --- Over a drive


def shown(truth, mask, score=1.0, role=Role.EVALUATED, overlap=0.5):
    variant = a_variant("net", {"svm": 1 - truth % 2, "post": mask})
    bits = TruthBits.of(truth)
    contour = score, overlap, np.tile([3, 10], (len(TRIMAP), 1))
    return FrameResult(
        *(a_frame(truth), role, (variant,)), truth_bits=bits, contours={"net": contour}
    )


def told(*results):
    drive = EdgesAndFlicker(5)
    for result in results:
        drive.add(result)
    return drive.totals()["net"]


def flicker_of(*frames):
    found = told(*(shown(truth, mask) for truth, mask in frames))
    return {name: found[name] for name in ("flicker", "truth_flicker", "pairs")}


def test_equals_a_plain_loop():
    draw = np.random.default_rng(0)
    truths = draw.choice(np.array([0, 1, IGNORE], np.uint8), (4, 9, 11))
    masks = draw.integers(0, 2, (4, 9, 11), np.uint8)
    changed = moved = labelled = 0
    for t in range(1, 4):
        for pixel in np.ndindex(9, 11):
            now, before = truths[t][pixel], truths[t - 1][pixel]
            if IGNORE not in (now, before):
                labelled += 1
                moved += now != before
                changed += masks[t][pixel] != masks[t - 1][pixel]
    assert flicker_of(*zip(truths, masks, strict=True)) == {
        "flicker": changed / labelled,
        "truth_flicker": moved / labelled,
        "pairs": 3,
    }


def test_boundary_f_is_averaged_over_the_frames_that_have_one():
    found = told(*(shown(TRUTH, TRUTH % 2, score) for score in (0.5, float("nan"), 1.0)))
    assert found["boundary_F"] == pytest.approx(0.75)
    assert (found["frames"], found["width"], found["pairs"]) == (2, 5, 2)


def test_each_width_of_the_trimap_sums_up_the_pixels_of_all_frames():
    found = told(*(shown(TRUTH, TRUTH % 2, score) for score in (0.5, float("nan"))))
    assert found["trimap"] == {str(width): [6, 20] for width in TRIMAP}


@pytest.mark.parametrize("role", [Role.TRAINING, Role.GAP, Role.UNLABELLED])
def test_frames_that_are_not_evaluated_are_not_counted_and_interrupt_the_flicker(role):
    one, between = shown(TRUTH, TRUTH % 2), shown(TRUTH, TRUTH % 2, 0.0, role)
    found = told(one, between, one)
    assert (found["boundary_F"], found["pairs"]) == (1, 0)


def test_a_lost_frame_interrupts_the_flicker():
    drive = EdgesAndFlicker(5)
    drive.add(shown(TRUTH, TRUTH % 2))
    drive.interrupt()
    drive.add(shown(TRUTH, TRUTH % 2))
    assert drive.totals()["net"]["pairs"] == 0

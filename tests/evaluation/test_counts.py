"""What is counted, pixel by pixel: regions, rates by their formulas, curves over thresholds."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.ndimage import distance_transform_cdt, distance_transform_edt
from skimage.segmentation import find_boundaries
from sklearn import metrics as theirs
from sklearn.metrics import (
    average_precision_score,
    confusion_matrix,
    f1_score,
    precision_recall_curve,
)

from roadeval.data import (
    CODES,
    IGNORE,
    Counts,
    FrameResult,
    Packed,
    Role,
    TruthBits,
    histogram,
    pack,
)
from roadeval.evaluation import regions
from roadeval.evaluation.metric import Metric
from roadeval.evaluation.metrics import (
    ALL,
    UNTABLED,
    of,
    table,
)
from roadeval.evaluation.region import LabelledFrame
from roadeval.evaluation.regions.standard import boundary, row_bands
from roadeval.evaluation.score import counts
from roadeval.evaluation.score.counts import TRIMAP, EdgesAndFlicker, error_map
from roadeval.evaluation.score.thresholds import Thresholds, at_levels, calibration
from roadeval.evaluation.settings import EvaluationSettings
from tests.evaluation.making import a_frame, a_variant, pixels, unpacked

TRUTH = pixels("##..", "##.?")


def count(masks, truth, regions):
    """Count masks and regions that are not packed yet."""
    packed = TruthBits.of(truth)
    inside = packed.bits_of(map(Packed.of, regions.values()))
    counted = counts.count(packed.bits_of(map(Packed.of, masks)), packed, list(inside))
    for rows in counted.tolist():
        whole, *parts = (Counts(*row) for row in rows)
        yield whole, dict(zip(regions, parts, strict=True))


MASK = pixels("#.#.", "####")


@pytest.mark.parametrize("odd", [pixels("##", "##", "##", "##"), pixels("####")])
def test_another_shape_is_refused_even_with_as_many_pixels(odd: np.ndarray) -> None:
    with pytest.raises(ValueError, match="shape"):
        list(count([odd], TRUTH, {}))
    with pytest.raises(ValueError, match="shape"):
        list(count([MASK], TRUTH, {"odd": odd}))


images = st.tuples(st.integers(1, 9), st.integers(1, 30)).flatmap(
    lambda shape: st.tuples(
        arrays(np.uint8, shape, elements=st.sampled_from([0, 1, 255])),
        arrays(np.uint8, shape, elements=st.sampled_from([0, 1])),
        arrays(np.uint8, shape, elements=st.sampled_from([0, 1])),
    )
)


@given(images)
def test_counts_equal_scikit_learns_confusion_matrix(
    example: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    truth, mask, region = example
    ((whole, parts),) = count([mask], truth, {"region": region})
    for found, inside in ((whole, truth != 255), (parts["region"], region == 1)):
        known = inside & (truth != 255)
        if known.any():
            table = confusion_matrix(truth[known], mask[known], labels=[0, 1])
            tn, fp, fn, tp = table.ravel().tolist()
            assert found == Counts(tp, tn, fp, fn)
        else:
            assert found == Counts()


def test_the_error_map_names_each_outcome() -> None:
    layer = error_map(MASK, TRUTH)
    names = {label.value: label.name for label in layer.spec.classes}
    assert [[names[value] for value in row] for row in layer.array.tolist()] == [
        ["TP", "FN", "FP", "TN"],
        ["TP", "TP", "FP", "ignored"],
    ]


@pytest.mark.parametrize("metric", ALL.values(), ids=ALL)
def test_a_metric_that_is_better_when_higher_rises_as_pixels_come_right(metric: Metric) -> None:
    worse, better = (metric.function(Counts(10 + n, 10 + n, 5 - n, 5 - n)) for n in (0, 1))
    assert (better > worse) is metric.higher_is_better


@pytest.mark.parametrize(
    ("counts", "undefined"),
    [
        (Counts(tn=5, fp=1), {"TPR", "FNR"}),
        (Counts(tp=5, fn=1), {"TNR", "FPR"}),
        (Counts(), {"ACC", "ERR", "TPR", "FNR", "TNR", "FPR"}),
    ],
)
def test_a_rate_without_a_denominator_is_undefined(counts: Counts, undefined: set[str]) -> None:
    assert {name for name, rate in of(counts).items() if math.isnan(rate)} == undefined


def test_overlap_is_undefined_where_there_is_nothing_to_overlap() -> None:
    nothing = Counts(tn=9)
    assert all(math.isnan(metric.function(nothing)) for metric in UNTABLED.values())


@settings(max_examples=40)
@given(*[st.integers(1, 40)] * 4)
def test_rates_equal_scikit_learns(tp: int, tn: int, fp: int, fn: int) -> None:
    truth = np.repeat([1, 0, 0, 1], [tp, tn, fp, fn])
    mask = np.repeat([1, 0, 1, 0], [tp, tn, fp, fn])
    expected = {
        "ACC": theirs.accuracy_score(truth, mask),
        "ERR": theirs.zero_one_loss(truth, mask),
        "TPR": theirs.recall_score(truth, mask),
        "FNR": 1 - theirs.recall_score(truth, mask),
        "TNR": theirs.recall_score(truth, mask, pos_label=0),
        "FPR": 1 - theirs.recall_score(truth, mask, pos_label=0),
        "IoU": theirs.jaccard_score(truth, mask),
        "mIoU": theirs.jaccard_score(truth, mask, average="macro"),
        "F1": theirs.f1_score(truth, mask),
        "precision": theirs.precision_score(truth, mask),
    }
    found = {name: metric.function(Counts(tp, tn, fp, fn)) for name, metric in ALL.items()}
    assert found == pytest.approx(expected, abs=1e-12)


@given(st.lists(st.tuples(*[st.sampled_from([0, 1, 7, 2_000_000_000])] * 4), min_size=1))
def test_many_frames_rates_at_once_are_those_of_each_to_the_last_bit(
    rows: list[tuple[int, int, int, int]],
) -> None:
    single = [list(of(Counts(*row)).values()) for row in rows]
    np.testing.assert_array_equal(table(np.array(rows, np.int64)), single)


def boundary_of(truth, width):
    return unpacked(boundary(TruthBits.of(truth), width), truth.shape[1])


def bands_of(shape, bands):
    packed = row_bands(shape, bands).items()
    return {name: unpacked(bits, shape[1]) for name, bits in packed}


def of_frame(frame, bands, variants=()):
    settings = EvaluationSettings(boundary_width=1, bands=bands)
    labelled = LabelledFrame(frame, TruthBits.of(frame.truth), variants, settings)
    found = regions.of_frame(labelled).items()
    return {name: unpacked(bits, frame.truth.shape[1]) for name, bits in found}


def test_the_boundary_lies_within_its_width_on_both_sides_of_the_edge() -> None:
    truth = pixels("...####", "...####")
    assert (boundary_of(truth, 1) == pixels("..##...", "..##...")).all()
    assert (boundary_of(truth, 2) == pixels(".####..", ".####..")).all()


def test_the_boundary_turns_corners() -> None:
    truth = pixels("....", ".#..", "....", "....")
    assert (boundary_of(truth, 1) == pixels("###.", "###.", "###.", "....")).all()


def test_bands_go_from_top_to_bottom_and_share_the_rows() -> None:
    bands = bands_of((7, 2), 5)
    assert list(bands) == ["band_0", "band_1", "band_2", "band_3", "band_4"]
    assert sum(bands.values()).tolist() == [[1, 1]] * 7
    rows = [int(np.count_nonzero(band[:, 0])) for band in bands.values()]
    assert sum(rows) == 7
    assert max(rows) - min(rows) <= 1
    assert bands["band_0"][0, 0] == bands["band_4"][6, 0] == 1


def test_a_region_is_the_same_for_all_variants() -> None:
    mask, first, second = pixels("#."), pixels("##"), pixels("..")
    with_filter = a_variant("filtered", {"post": mask}, {"shadow": first})
    another = a_variant("gated", {"post": mask}, {"shadow": second, "lit": second})
    unfiltered = a_variant("unfiltered", {"post": mask})
    found = of_frame(a_frame(mask), 1, (unfiltered, with_filter, another))
    assert list(found)[:2] == ["shadow", "lit"]
    assert (found["shadow"] == first).all()
    assert (found["lit"] == second).all()


def test_a_frame_has_true_shadow_only_if_the_log_has_it() -> None:
    truth = pixels("##..")
    every = {"boundary", "interior", "band_0", "band_1"}
    found = of_frame(a_frame(truth), 2)
    assert set(found) == every
    shadowed = a_frame(truth, shadow=pixels("#.?#"))
    found = of_frame(shadowed, 2)
    assert set(found) == every | {"true_shadow"}
    assert (found["true_shadow"] == pixels("#..#")).all()


def test_regions_of_one_family_make_up_a_frame():
    found = of_frame(a_frame(pixels("##..", "#...")), 2, ())
    for family in (regions.HALVES, ("band_0", "band_1")):
        assert (sum(found[name] for name in family) == 1).all()


TOP = CODES - 1


def drawn(seed, levels=CODES, share=0.3, size=(40, 50)):
    """Codes of so many levels that tell something of the truth; some pixels are ignored."""
    rng = np.random.default_rng(seed)
    truth = (rng.random(size) < share).astype(np.uint8)
    told = 1 / (1 + np.exp(-(2 * truth - 1 + rng.normal(size=size))))
    codes = (np.rint(told * (levels - 1)) * (TOP // (levels - 1))).astype(np.uint16)
    truth[:3] = 255
    return codes, truth


def flat(codes, truth):
    known = truth != 255
    return truth[known], codes[known] / TOP


CASES = [(0, CODES), (1, CODES), (2, 256), (3, 4), (4, 2)]


@pytest.mark.parametrize(("seed", "levels"), CASES)
def test_areas_and_f_are_scikit_learns(seed, levels):
    codes, truth = drawn(seed, levels)
    found, (y, p) = Thresholds.of(histogram(codes, truth)), flat(codes, truth)
    assert found.average_precision == pytest.approx(average_precision_score(y, p), abs=1e-12)
    best = found.max_f()
    assert best["MaxF"] == pytest.approx(f1_score(y, p >= best["threshold"]), abs=1e-12)
    assert 2 / (1 / best["precision"] + 1 / best["recall"]) == pytest.approx(best["MaxF"])


@pytest.mark.parametrize(("seed", "levels"), CASES)
def test_ece_is_that_of_256_bins_of_the_pixels_themselves(seed, levels):
    """As torchmetrics 1.8 has it: BinaryCalibrationError(n_bins=256, norm="l1")."""
    codes, truth = drawn(seed, levels)
    found, (y, p) = calibration(histogram(codes, truth)), flat(codes, truth)
    place = np.minimum((p * 256 * TOP / CODES).astype(int), 255)
    bins = [place == level for level in range(256)]
    ece = sum(abs(y[own].mean() - p[own].mean()) * own.mean() for own in bins if own.any())
    assert found["ECE"] == pytest.approx(ece, abs=1e-12)
    assert found["confidence"] == pytest.approx(np.maximum(p, 1 - p).mean(), abs=1e-12)
    assert found["right"] == pytest.approx(((p > (TOP + 1) / 2 / TOP) == y).mean(), abs=1e-12)


def test_probabilities_that_come_true_have_no_calibration_error():
    counts = np.zeros((2, CODES), np.int64)
    counts[:, [0, TOP // 5, TOP]] = [[7, 80, 0], [0, 20, 9]]
    assert calibration(counts)["ECE"] == pytest.approx(0)


@pytest.mark.parametrize(("seed", "levels"), CASES)
def test_curves_are_scikit_learns(seed, levels):
    codes, truth = drawn(seed, levels)
    found, (y, p) = Thresholds.of(histogram(codes, truth)), flat(codes, truth)
    precision, recall, thresholds = precision_recall_curve(y, p)
    np.testing.assert_allclose(found.precision[::-1], precision[:-1])
    np.testing.assert_allclose(found.recall[::-1], recall[:-1])
    np.testing.assert_allclose(found.codes[::-1] / TOP, thresholds)


def test_maxf_is_the_greatest_of_all_thresholds():
    codes, truth = drawn(2, 256)
    y, p = flat(codes, truth)
    best = Thresholds.of(histogram(codes, truth)).max_f()
    assert best["MaxF"] == pytest.approx(max(f1_score(y, p >= t) for t in np.unique(p)), abs=1e-12)


def test_a_perfect_probability():
    truth = np.array([[0, 0, 1, 1, 255]], np.uint8)
    codes = np.array([[0, 0, TOP, TOP, TOP]], np.uint16)
    found = Thresholds.of(histogram(codes, truth))
    assert (found.average_precision, found.max_f()["MaxF"]) == (1, 1)


@pytest.mark.parametrize("value", [0, 1, 255])
def test_what_has_no_road_or_nothing_else_is_undefined(value):
    counts = histogram(np.full((2, 2), 30_000, np.uint16), np.full((2, 2), value, np.uint8))
    found = Thresholds.of(counts)
    assert (found.max_f()["MaxF"] is None) == (value != 1)
    assert math.isnan(found.average_precision) == (value != 1)


def test_levels_hold_256_codes_each():
    counts = np.zeros((2, CODES), np.int64)
    counts[1, [0, 255, 256, TOP]] = 1, 2, 4, 8
    levels = at_levels(counts)
    assert levels.shape == (2, 256)
    assert levels[1, [0, 1, 255]].tolist() == [3, 4, 8]


# --- How well masks follow the edge of the road, and what they do from frame to frame -------------


EDGE_TRUTH = pixels("##..", "##.?")


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
    found = told(*(shown(EDGE_TRUTH, EDGE_TRUTH % 2, score) for score in (0.5, float("nan"), 1.0)))
    assert found["boundary_F"] == pytest.approx(0.75)
    assert (found["frames"], found["width"], found["pairs"]) == (2, 5, 2)


def test_each_width_of_the_trimap_sums_up_the_pixels_of_all_frames():
    found = told(*(shown(EDGE_TRUTH, EDGE_TRUTH % 2, score) for score in (0.5, float("nan"))))
    assert found["trimap"] == {str(width): [6, 20] for width in TRIMAP}


@pytest.mark.parametrize("role", [Role.TRAINING, Role.GAP, Role.UNLABELLED])
def test_frames_that_are_not_evaluated_are_not_counted_and_interrupt_the_flicker(role):
    one, between = shown(EDGE_TRUTH, EDGE_TRUTH % 2), shown(EDGE_TRUTH, EDGE_TRUTH % 2, 0.0, role)
    found = told(one, between, one)
    assert (found["boundary_F"], found["pairs"]) == (1, 0)


def test_a_lost_frame_interrupts_the_flicker():
    drive = EdgesAndFlicker(5)
    drive.add(shown(EDGE_TRUTH, EDGE_TRUTH % 2))
    drive.interrupt()
    drive.add(shown(EDGE_TRUTH, EDGE_TRUTH % 2))
    assert drive.totals()["net"]["pairs"] == 0

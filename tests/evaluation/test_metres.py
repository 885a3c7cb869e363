"""Masks in metres: bands, ground seen from above, edges and free distance."""

from collections import Counter
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from roadeval.data import FrameMetres, Packed, TruthBits, histogram
from roadeval.evaluation.metres import ABOVE, FREE, LEFT, RIGHT, STANCES, UNPLACED, Survey, plan_of
from roadeval.evaluation.score.metre_sums import MetreSums, differences_of, kitti, measure
from roadeval.evaluation.score.thresholds import Curves
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.geometry.ground import ground_of
from roadeval.geometry.settings import GroundSettings

SIZE = 320, 240
GROUND, _ = ground_of(None, GroundSettings(height=1.3, pitch=4, focal=(280.0,)), SIZE)
assert GROUND is not None
SURVEY = Survey(GROUND, EvaluationSettings())
_columns, _rows = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
PLACES = GROUND.places(np.column_stack([_columns.ravel(), _rows.ravel()]).astype(float))
AHEAD, LEFTWARDS = PLACES.T.reshape(2, *SIZE[::-1])
Mask = npt.NDArray[np.uint8]


def road(left: float, right: float, far: float = 300) -> Mask:
    """A straight road that ends so many metres to the left, to the right, and ahead."""
    inside = (left > LEFTWARDS) & (-right < LEFTWARDS) & (far > AHEAD) & np.isfinite(AHEAD)
    return inside.astype(np.uint8)


def measured(mask: Mask, truth: Mask, survey: Survey = SURVEY) -> FrameMetres:
    bits = TruthBits.of(truth)
    return measure(survey, {"m": Packed.of(mask).bits}, bits)["m"]


def difference(found: FrameMetres, name: str, at: int) -> float:
    return float(differences_of(found)[0, found.measures.index((name, at))])


def test_every_pixel_is_in_one_band_or_not_on_the_ground():
    bands = {name: Packed(bits, SIZE[0]).pixels() for name, bits in SURVEY.regions.items()}
    assert (sum(bands.values()) == 1).all()
    for name, near, far in (("0-10m", 0, 10), ("10-20m", 10, 20), ("40-80m", 40, 80)):
        assert (bands[name] == ((near <= AHEAD) & (far > AHEAD))).all()
    assert (bands[UNPLACED] == ~(AHEAD < 80)).all()


@pytest.mark.parametrize(("near", "far", "half"), [(8, 12, 1.0), (20, 30, 2.0), (30, 45, 1.5)])
def test_a_square_metre_counts_once_wherever_it_lies(near: int, far: int, half: float):
    size = 1280, 960
    ground = GROUND.scaled(*size)
    columns, rows = np.meshgrid(*map(np.arange, size))
    places = ground.places(np.column_stack([columns.ravel(), rows.ravel()]).astype(float))
    ahead, left = places.T.reshape(2, *size[::-1])
    truth = (np.isfinite(ahead)).astype(np.uint8)
    mask = truth.copy()
    mask[(ahead >= near) & (ahead < far) & (np.abs(left) < half)] = 0
    found = measured(mask, truth, Survey(ground, EvaluationSettings())).counts[0, -1]
    (along, across), (_, at_far) = ground.pixel_at((near + far) / 2), ground.pixel_at(far)
    # Half a pixel at each of its four sides, and half a cell.
    unsure = 2 * half * (along + 0.05) + (far - near) * ((across + at_far) / 2 + 0.05)
    assert found[3] * 0.05**2 == pytest.approx(2 * half * (far - near), abs=unsure)
    assert unsure < 0.25 * 2 * half * (far - near)


def test_cells_of_ground_are_counted_as_a_loop_over_them_counts():
    rng = np.random.default_rng(1)
    truth = rng.choice(np.array([0, 1, 255], np.uint8), SIZE[::-1])
    mask = rng.integers(0, 2, SIZE[::-1], np.uint8)
    expected = Counter[tuple[int, int]]()
    for ahead in np.arange(6 + 0.025, 46, 0.05):
        lefts = np.arange(10 - 0.025, -10, -0.05)
        seen = np.rint(GROUND.pixels(np.column_stack([np.full_like(lefts, ahead), lefts])))
        for x, y in seen.astype(int).tolist():
            if 0 <= x < SIZE[0] and 0 <= y < SIZE[1]:
                expected[int(truth[y, x]), int(mask[y, x])] += 1
    found = measured(mask, truth).counts[0, -1].tolist()
    assert found == [expected[key] for key in ((1, 1), (0, 0), (0, 1), (1, 0))]


@pytest.mark.parametrize("shift", [-0.5, -0.2, 0.0, 0.25, 0.6])
def test_an_edge_that_is_shifted_is_as_far_off_as_it_was_shifted(shift: float):
    found = measured(road(3 + shift, 2.5 - shift), road(3, 2.5))
    for at in (10, 20):
        _, across = GROUND.pixel_at(at)
        assert difference(found, LEFT, at) == pytest.approx(shift, abs=across)
        assert difference(found, RIGHT, at) == pytest.approx(-shift, abs=across)


def test_a_mask_without_an_edge_is_missing_and_not_wrong_by_nothing():
    truth = road(3, 3)
    sums = MetreSums()
    sums.add({"m": measured(np.zeros_like(truth), truth)})
    (left,) = (e for e in sums.totals(Curves()) if (e["measure"], e["where"]) == (LEFT, "10m"))
    assert (left["frames"], left["missing"]) == (1, 1)
    assert np.isnan(left["value"])


def test_the_road_is_that_straight_ahead_and_holes_are_no_edges():
    truth = road(3, 3)
    beside = truth | road(9, -6)  # a second road to the left
    assert difference(measured(truth, beside), LEFT, 20) == 0
    holed = truth.copy()
    holed[np.abs(LEFTWARDS - 1) < 0.12] = 0
    assert difference(measured(holed, truth), LEFT, 10) == 0
    split = truth.copy()
    split[np.abs(LEFTWARDS - 1) < 0.5] = 0  # too wide to be a hole
    assert difference(measured(split, truth), LEFT, 10) == pytest.approx(-2.5, abs=0.1)


@pytest.mark.parametrize("far", [12, 20, 33])
def test_the_free_distance_ends_with_the_mask(far: int):
    found = measured(road(3, 3, far), road(3, 3))
    (end,) = (e for e, (name, _) in zip(found.ends[0], found.measures, strict=True) if name == FREE)
    along, _ = GROUND.pixel_at(far)
    assert end[0] == pytest.approx(far, abs=along)
    assert end[1] == pytest.approx(80, abs=0.1)


def test_a_mask_without_road_ahead_is_free_up_to_the_nearest_labelled_place():
    found = measured(road(3, 3, 0), road(3, 3))
    (end,) = (e for e, (name, _) in zip(found.ends[0], found.measures, strict=True) if name == FREE)
    assert end[0] == pytest.approx(np.nanmin(AHEAD[AHEAD > 0]), abs=0.5)


def test_what_the_truth_does_not_know_ahead_is_not_counted():
    truth = road(3, 3)
    truth[AHEAD > 25] = 255
    assert difference(measured(road(3, 3, 60), truth), FREE, 0) == 0
    assert difference(measured(road(3, 3, 15), truth), FREE, 0) < -8


def test_a_camera_that_stands_otherwise_sees_other_numbers():
    found = measured(road(3.4, 3), road(3, 3))
    assert len(found.ends) == len(found.counts) == len(STANCES)
    tilted = GROUND.moved(pitch=1)
    alone = Survey(tilted, EvaluationSettings())
    expected = measured(road(3.4, 3), road(3, 3), alone)
    assert (found.counts[2] == expected.counts[0]).all()
    assert found.ends[2] == pytest.approx(expected.ends[0], nan_ok=True)


def test_of_a_homography_alone_nothing_is_said_of_other_cameras():
    found = np.linalg.inv(np.reshape(GROUND.matrix, (3, 3)) @ np.reshape(GROUND.plane, (3, 3)))
    alone, _ = ground_of(None, GroundSettings(homography=tuple(found.ravel())), SIZE)
    assert alone is not None
    seen = measured(road(3.4, 3), road(3, 3), Survey(alone, EvaluationSettings()))
    assert len(seen.ends) == 1
    sums = MetreSums()
    sums.add({"m": seen})
    assert all(np.isnan(each["low"]) for each in sums.totals(Curves()))


def levels(counts: npt.NDArray[np.uint32]) -> npt.NDArray[np.int64]:
    """Add up the counts of each probability between KITTI's thresholds."""
    return np.add.reduceat(counts.astype(np.int64), 257 * np.arange(256), axis=1)


def devkit(truth: Mask, confidence: npt.NDArray[Any]) -> dict[str, float]:
    """The rates as defined by KITTI's benchmark, threshold by threshold."""
    points = []
    for threshold in np.arange(256) / 255:
        called = confidence >= threshold
        tp, fp = ((called & (truth == each)).sum() for each in (1, 0))
        if tp:
            points.append((tp / (tp + fp), tp / (truth == 1).sum(), fp / (truth == 0).sum()))
    f = [2 * p * r / (p + r) for p, r, _ in points]
    most = [max((p for p, r, _ in points if r >= k / 10), default=0) for k in range(11)]
    precision, recall, fpr = points[int(np.argmax(f))]
    names = "MaxF", "AP11", "precision", "recall", "FPR", "FNR"
    values = max(f), np.mean(most), precision, recall, fpr, 1 - recall
    return dict(zip(names, values, strict=True))


@pytest.mark.parametrize("seed", range(5))
def test_maxf_and_ap_are_those_of_kittis_definition(seed: int):
    rng = np.random.default_rng(seed)
    truth = rng.choice(np.array([0, 1, 255], np.uint8), (40, 50))
    codes = (257 * np.clip(rng.normal(90 + 80 * (truth == 1), 60), 0, 255).astype(int)).astype(
        np.uint16
    )
    found = kitti(np.zeros(4, np.int64), levels(histogram(codes, truth)))
    assert found == pytest.approx(devkit(truth, codes / 65535))


def test_the_histogram_from_above_is_that_of_the_picture_from_above():
    rng = np.random.default_rng(2)
    truth = rng.choice(np.array([0, 1, 255], np.uint8), SIZE[::-1])
    codes = rng.integers(0, 65536, SIZE[::-1]).astype(np.uint16)
    plan = plan_of(GROUND, EvaluationSettings())
    expected = histogram(plan.picture(codes), plan.picture(truth, 255))
    assert (SURVEY.levels(codes, truth) == levels(expected)).all()


def test_a_mask_is_measured_at_the_road_of_the_truth_and_not_at_another_ahead():
    truth = ((LEFTWARDS > 1) & (LEFTWARDS < 5)).astype(np.uint8)
    mask = truth | ((LEFTWARDS < 0.5) & (LEFTWARDS > -4)).astype(np.uint8)
    found = measured(mask, truth)
    assert difference(found, LEFT, 20) == 0
    assert difference(found, RIGHT, 20) == 0


def test_each_variant_has_its_own_curve_and_sizes_are_without_sign():
    truth, sums, curves = road(3, 3), MetreSums(), Curves()
    codes = np.where(truth == 1, 40_000, 10_000).astype(np.uint16)
    inverse = (65_535 - codes).astype(np.uint16)
    for left in (2.0, 2.5, 3.5):
        sums.add(dict.fromkeys(("sure", "lost"), measured(road(left, 3), truth)))
    curves.add(
        {
            ("sure", "post"): SURVEY.levels(codes, truth),
            ("lost", "post"): SURVEY.levels(inverse, truth),
        },
    )
    rows = {(e["variant"], e["measure"], e["where"]): e for e in sums.totals(curves)}
    assert rows["sure", "MaxF", ABOVE]["value"] == 1
    assert rows["lost", "MaxF", ABOVE]["value"] < 0.8
    assert rows["sure", LEFT, "10m"]["p95"] == pytest.approx(1, abs=0.05)


def test_sums_are_means_over_frames_and_ranges_over_stances():
    truth, sums = road(3, 3), MetreSums()
    masks = road(3.4, 3), road(3, 2.5, 30), road(2.8, 3)
    found = [measured(mask, truth) for mask in masks]
    for each in found:
        sums.add({"m": each})
    rows = {(e["measure"], e["where"]): e for e in sums.totals(Curves())}
    for place, region in enumerate(found[0].regions):
        counts = np.array([each.counts[:, place] for each in found]).astype(float)
        errors = (counts[..., 2:].sum(axis=2) / counts.sum(axis=2)).mean(axis=0)
        row = rows["ERR", region]
        assert (row["value"], row["low"], row["high"]) == pytest.approx(
            (errors[0], errors.min(), errors.max())
        )
    above = sum(each.counts[0, -1] for each in found)
    assert rows["recall", ABOVE]["value"] == pytest.approx(above[0] / (above[0] + above[3]))


def test_what_is_summed_up_is_numpys_quantile_of_all_frames_differences():
    rng, sums, found = np.random.default_rng(0), MetreSums(), []
    measures = [(LEFT, 5), (RIGHT, 5), (FREE, 0)]
    for _ in range(50):
        ends = rng.normal(0, 30, (5, 3, 2)).round(2)
        ends[rng.random(ends.shape) < 0.2] = np.nan
        found.append(FrameMetres(measures, ends, [ABOVE], np.ones((5, 1, 4), np.int64)))
        sums.add({"m": found[-1]})
    rows = {e["measure"]: e for e in sums.totals(Curves())}
    for place, (name, _) in enumerate(measures):
        every = np.array([differences_of(each)[:, place] for each in found])
        middles = np.nanquantile(every, 0.5, axis=0, method="inverted_cdf")
        row, truths = rows[name], np.array([each.ends[0, place, 1] for each in found])
        expected = middles[0], middles.min(), middles.max()
        assert (row["value"], row["low"], row["high"]) == pytest.approx(expected)
        assert row["p95"] == pytest.approx(
            np.nanquantile(np.abs(every[:, 0]), 0.95, method="inverted_cdf")
        )
        assert row["frames"] == (~np.isnan(truths)).sum()
        assert row["missing"] == row["frames"] - (~np.isnan(every[:, 0])).sum()


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"distances": (0, 20, 10)}, "distances must rise"),
        ({"plan": (46, 6)}, "plan must rise"),
        ({"plan": (0, 500), "plan_cell": 0.01}, "plan has 100,000,000 cells"),
    ],
)
def test_settings_without_sense_are_refused(settings: dict[str, Any], said: str):
    with pytest.raises(ValueError, match=said):
        EvaluationSettings(**settings)

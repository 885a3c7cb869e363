"""The machine on colour, place, the column below and texture."""

from dataclasses import replace
from unittest.mock import Mock

import cv2
import numpy as np
import pytest
from sklearn.svm import LinearSVC

from roadeval.kernels import KERNELS
from roadeval.pipeline.beyond import context
from roadeval.pipeline.beyond.context import ContextSettings
from roadeval.pipeline.beyond.context_features import at_samples, features
from roadeval.pipeline.beyond.geodesic_features import distance_of, geodesics
from roadeval.pipeline.chain import Pipeline
from roadeval.pipeline.reference_patch import patch_mask
from roadeval.pipeline.stage import TrainingSet, View
from roadeval.pipeline.stages import STAGES

PLAIN = ContextSettings(planes=32, spare=0, smoothing=1)


def grey(height=24, width=32, seed=0):
    """Grey noise: no colour tells its pixels apart."""
    noise = np.random.default_rng(seed).integers(90, 110, (height, width, 1))
    return np.broadcast_to(noise, (height, width, 3)).astype(np.uint8)


def every_pixel(images, truths, seed=0):
    frame, row, column = np.indices((len(images), *truths[0].shape)).reshape(3, -1)
    road = np.stack(truths).ravel() == 1
    return TrainingSet(tuple(images), frame, row, column, road, seed)


def decision(image, machine, settings):
    seen = features(image, settings.windows, settings.start)
    return context.decision(seen, machine, settings.smoothing)


def fit_and_run(images, truths, image, settings=PLAIN):
    machine = context.fit(every_pixel(images, truths), settings)
    return context.bind(settings, machine)(View.of(image)).mask.pixels()


# --- Features -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("columns", "fits"),
    [(8, False), (9, True), (10, False), (11, True), (12, True), (13, True), (14, True)],
)
def test_a_machine_has_nine_features_and_two_for_each_window_and_maybe_three(columns, fits):
    arrays = np.zeros((2, columns), np.float32), np.zeros(2, np.float32), np.zeros(2, np.float32)
    if fits:
        context.RectifiedMachine(*arrays, 0.0, 0.0)
    else:
        with pytest.raises(ValueError, match="nine columns and two"):
            context.RectifiedMachine(*arrays, 0.0, 0.0)


def test_colours_come_first_as_they_are():
    image = np.random.default_rng(0).integers(0, 256, (5, 7, 3), dtype=np.uint8)
    np.testing.assert_array_equal(features(image, (3,))[:3], np.moveaxis(image, 2, 0))


def test_chromaticity_does_not_depend_on_brightness():
    colour = np.array([[[52, 92, 32]], [[112, 192, 72]]], np.uint8)  # with 8 added, one is double
    chroma = features(colour, (1,))[3:5, :, 0]
    np.testing.assert_allclose(chroma[:, 0], np.log([60 / 100, 40 / 100]), atol=1e-6)
    np.testing.assert_allclose(chroma[:, 1], chroma[:, 0], atol=1e-6)


def test_place_is_the_pixels_centre_across_and_down():
    across, down = features(np.zeros((2, 4, 3), np.uint8), (1,))[5:7]
    np.testing.assert_allclose(across[0], [-0.75, -0.25, 0.25, 0.75])
    np.testing.assert_allclose(down[:, 0], [0.25, 0.75])


def test_texture_tells_upright_edges_from_level_ones():
    stripes = np.zeros((20, 20, 3), np.uint8)
    stripes[:, ::4] = stripes[:, 1::4] = 200
    upright = features(stripes, (5,))[9:, 10, 10]
    level = features(np.ascontiguousarray(stripes.transpose(1, 0, 2)), (5,))[9:, 10, 10]
    assert upright[0] > 1
    assert upright[1] == 0
    np.testing.assert_allclose(level, upright[::-1], atol=1e-6)


def test_texture_is_the_same_at_half_the_light():
    light = np.random.default_rng(0).integers(60, 120, (20, 20, 3), dtype=np.uint8)
    bright, dim = ((light * share - 8).astype(np.uint8) for share in (2, 1))
    np.testing.assert_allclose(features(bright, (5,))[9:], features(dim, (5,))[9:], rtol=1e-3)


def test_an_edge_is_known_to_all_that_lies_above_it_and_to_nothing_below():
    image = np.full((40, 12, 3), 90, np.uint8)
    image[20:22] = 220
    edge = features(image, ())[7, :, 6]
    assert edge[30:].max() < 1e-3
    np.testing.assert_array_equal(edge[:18], edge[18])
    assert edge[18] > 0.5


def test_the_steepest_edge_below_counts_wherever_it_lies():
    image = np.full((40, 12, 3), 90, np.uint8)
    image[30:32], image[10:12] = 220, 120
    edge = features(image, ())[7, :, 6]
    np.testing.assert_array_equal(edge[:28], edge[28])


def test_the_darkest_place_below_is_kept_up_the_column_alone():
    image = np.full((40, 24, 3), 90, np.uint8)
    image[18:25, :8] = 20
    dark = features(image, ())[8]
    np.testing.assert_allclose(dark[:20, 3], np.log(28), atol=1e-5)
    np.testing.assert_allclose(dark[30:, 3], np.log(98), atol=1e-5)
    np.testing.assert_allclose(dark[:, 16], np.log(98), atol=1e-5)


def test_a_kerb_tells_a_smooth_pavement_from_the_road_of_the_same_grey():
    def picture(kerb, seed):
        image = np.random.default_rng(seed).integers(95, 100, (48, 32, 1))
        image[kerb : kerb + 2] = 220
        truth = np.zeros((48, 32), np.uint8)
        truth[kerb + 2 :] = 1
        return np.broadcast_to(image, (48, 32, 3)).astype(np.uint8), truth

    images, truths = zip(*(picture(kerb, kerb) for kerb in (6, 14, 22, 30)), strict=True)
    for kerb in (10, 26):
        image, truth = picture(kerb, kerb)
        mask = fit_and_run(list(images), list(truths), image)
        inner = np.r_[: kerb - 2, kerb + 4 : 48]
        assert (mask[inner] == truth[inner]).mean() > 0.97


def test_there_are_two_textures_a_window():
    image = grey()
    assert len(features(image, (3, 9, 21))) == 9 + 6


def test_sampled_features_are_the_images_at_the_sampled_pixels_in_their_order():
    images = [grey(seed=seed) for seed in (0, 1)]
    where = {"frame": [1, 0, 1], "row": [3, 23, 0], "column": [31, 5, 0]}
    sample = TrainingSet(
        tuple(images), *(np.array(v) for v in where.values()), np.array([True, False, True])
    )
    maps = [features(image, PLAIN.windows) for image in images]
    expected = [maps[1][:, 3, 31], maps[0][:, 23, 5], maps[1][:, 0, 0]]
    np.testing.assert_array_equal(at_samples(sample, PLAIN.width, PLAIN.windows), expected)


# --- What it can tell apart -----------------------------------------------------------------------


def test_images_of_different_sizes_are_each_reduced_to_the_same_width():
    images, truth = (grey(24, 32), grey(240, 320)), np.ones((1, 1), np.uint8)
    place = np.zeros(1, np.intp)
    both = TrainingSet(images, np.array([0, 1]), *(np.zeros(2, np.intp),) * 2, np.ones(2, bool))
    alone = TrainingSet(images[1:], place, place, place, truth[0] == 1)
    values = at_samples(both, 160, PLAIN.windows)
    np.testing.assert_array_equal(values[1:], at_samples(alone, 160, PLAIN.windows))


def test_place_tells_a_grey_road_from_a_grey_wall():
    truth = np.zeros((24, 32), np.uint8)
    truth[12:] = 1
    mask = fit_and_run([grey(seed=0), grey(seed=1)], [truth, truth], grey(seed=5))
    assert mask[14:].mean() > 0.98
    assert mask[:10].mean() < 0.02


def test_texture_tells_a_smooth_road_from_a_rough_verge_of_the_same_mean():
    rng = np.random.default_rng(0)

    def picture(left):
        rough = rng.integers(40, 160, (24, 40, 1))
        smooth = rng.integers(97, 104, (24, 40, 1))
        columns = np.arange(40)[None, :, None]
        image = np.where((columns < 20) == left, smooth, rough)
        truth = np.broadcast_to((columns[..., 0] < 20) == left, (24, 40)).astype(np.uint8)
        return np.broadcast_to(image, (24, 40, 3)).astype(np.uint8), truth

    (a, truth_a), (b, truth_b), (c, truth_c) = picture(True), picture(False), picture(True)
    mask = fit_and_run([a, b], [truth_a, truth_b], c)
    inner = np.s_[:, np.r_[3:15, 25:37]]
    assert (mask[inner] == truth_c[inner]).mean() > 0.97


# --- The machine ----------------------------------------------------------------------------------


def test_every_plane_passes_through_a_training_pixel_and_reaches_one():
    values = np.random.default_rng(0).normal(size=(50, 4)).astype(np.float32) * [1, 10, 100, 0]
    planes, bias = context.draw_planes(values.astype(np.float32), 20, seed=3)
    sides = values @ planes.T + bias
    np.testing.assert_allclose(np.abs(sides).min(axis=0), 0, atol=1e-5)
    np.testing.assert_allclose(sides.max(axis=0), 1, rtol=1e-4)


def test_the_planes_that_move_decisions_most_are_kept():
    mapped = np.random.default_rng(0).random((400, 6))
    road = mapped[:, 1] + mapped[:, 4] > 1
    # Not those of the greatest weight: a plane that hardly varies has much and moves little.
    for scale in (np.ones(6), np.array([0.01, 0.1, 1, 1, 10, 100])):
        given = (mapped * scale).astype(np.float32), road
        kept, weights, _ = context.solve(*given, ContextSettings(planes=2, c=1e4))
        assert (kept.tolist(), weights.shape) == ([1, 4], (2,))


def test_spare_planes_are_drawn_but_not_kept():
    truth = np.zeros((24, 32), np.uint8)
    truth[12:] = 1
    sample = every_pixel([grey(), grey(seed=1)], [truth, truth])
    settings = ContextSettings(planes=16, spare=16)
    machine = context.fit(sample, settings)
    values = at_samples(sample, settings.width, settings.windows)
    planes, bias = context.draw_planes(values, 32, sample.seed)
    kept, *_ = context.solve(np.maximum(values @ planes.T + bias, 0), sample.road, settings)
    assert kept.tolist() != list(range(16))
    np.testing.assert_array_equal(machine.planes, planes[kept])
    np.testing.assert_array_equal(machine.bias, bias[kept])


def test_the_threshold_is_learnt_from_machines_that_chose_their_planes_without_the_frame(
    monkeypatch,
):
    solved = []
    truth = np.zeros((24, 32), np.uint8)
    truth[12:] = 1
    sample = every_pixel([grey(seed=n) for n in range(4)], [truth] * 4)
    solve = context.solve
    monkeypatch.setattr(
        context, "solve", lambda mapped, *rest: solved.append(mapped.shape) or solve(mapped, *rest)
    )
    context.fit(sample, ContextSettings(planes=16, spare=16, folds=4))
    pixels = len(sample.road)
    assert solved == [(pixels, 32)] + 4 * [(pixels * 3 // 4, 32)]


def test_the_same_seed_gives_the_same_machine():
    truth = np.zeros((24, 32), np.uint8)
    truth[12:] = 1
    first, second = (context.fit(every_pixel([grey()], [truth]), PLAIN) for _ in range(2))
    other = context.fit(every_pixel([grey()], [truth], seed=1), PLAIN)
    np.testing.assert_array_equal(first.weights, second.weights)
    assert (first.planes != other.planes).any()


def test_the_decision_is_the_linear_machines_on_the_written_out_map():
    truth = np.zeros((24, 32), np.uint8)
    truth[12:] = 1
    machine = context.fit(every_pixel([grey()], [truth]), PLAIN)
    image = grey(seed=2)
    x = features(image, PLAIN.windows).reshape(11, -1).T.astype(np.float64)
    expected = np.maximum(x @ machine.planes.T + machine.bias, 0) @ machine.weights + machine.offset
    found = decision(image, machine, PLAIN).ravel()
    np.testing.assert_allclose(found, expected, atol=1e-3)


@pytest.mark.parametrize("windows", [(), (5, 15), (5, 15, 31)])
def test_a_machine_for_other_features_is_refused_before_it_reads_beyond_its_planes(windows):
    truth = np.zeros((24, 32), np.uint8)
    truth[12:] = 1
    machine = context.fit(every_pixel([grey()], [truth]), PLAIN)
    other = ContextSettings(planes=32, spare=0, windows=windows)
    wanted = f"for 11 features, and windows = .* make {9 + 2 * len(windows)};"
    with pytest.raises(ValueError, match=wanted):
        context.bind(other, machine)


def test_a_machine_without_geodesics_is_refused_where_they_are_wanted():
    truth = np.zeros((24, 32), np.uint8)
    truth[12:] = 1
    machine = context.fit(every_pixel([grey()], [truth]), PLAIN)
    with pytest.raises(ValueError, match=r"for 11 features, and .* geodesics = true make 14;"):
        context.bind(replace(PLAIN, geodesics=True), machine)


def test_smoothing_averages_neighbours():
    truth = np.zeros((24, 32), np.uint8)
    truth[12:] = 1
    machine = context.fit(every_pixel([grey()], [truth]), PLAIN)
    rough = decision(grey(seed=2), machine, PLAIN)
    smooth = decision(grey(seed=2), machine, ContextSettings(planes=32, spare=0, smoothing=3))
    np.testing.assert_allclose(smooth[1:-1, 1:-1], cv2.blur(rough, (3, 3))[1:-1, 1:-1], atol=1e-5)


def test_a_wide_image_is_decided_at_the_working_width():
    truth = np.zeros((24, 32), np.uint8)
    truth[12:] = 1
    machine = context.fit(every_pixel([grey()], [truth]), PLAIN)
    large = cv2.resize(grey(seed=2), (128, 96))
    settings = ContextSettings(width=32, planes=32, spare=0, smoothing=1)
    small = cv2.resize(large, (32, 24), interpolation=cv2.INTER_AREA)
    expected = cv2.resize(decision(small, machine, PLAIN), (128, 96))
    values = context.bind(settings, machine)(View.of(large)).layers[0].array
    np.testing.assert_array_equal(values, expected)


def test_the_kernel_is_the_sum_over_rectified_planes():
    features = np.array([[1, 2], [10, 20]], np.float32)
    planes = np.array([[2, 0], [1, -1], [0, 1]], np.float32)
    bias, weights = np.array([1, 5, -15], np.float32), np.array([1, 100, -2], np.float32)
    found = KERNELS.rectified_sum(features, planes, bias, weights)
    assert found.tolist() == [3, 5 - 2 * 5]


# --- The threshold --------------------------------------------------------------------------------


def test_the_threshold_separates_what_can_be_separated_in_the_middle():
    values = np.array([0.1, 0.2, 0.6, 0.9], np.float32)
    road = np.array([False, False, True, True])
    assert context.threshold(values, road) == pytest.approx(0.4)


def test_the_threshold_weighs_classes_alike_however_many_pixels_they_have():
    values = np.array([0.0, 0.1, 0.2, 0.3, 0.25], np.float32)
    road = np.array([False, False, False, False, True])
    # Above 0.225 one of four non-road pixels is wrong; above all of them the only road pixel is.
    assert context.threshold(values, road) == pytest.approx(0.225)


def test_left_out_values_come_from_machines_that_have_not_seen_the_frame():
    truths = [np.zeros((24, 32), np.uint8) for _ in range(4)]
    for truth in truths[:3]:
        truth[12:] = 1
    truths[3][:12] = 1  # the last frame contradicts the others
    images = [grey(seed=seed) for seed in range(4)]
    settings = ContextSettings(planes=32, spare=0, folds=4)
    sample = every_pixel(images, truths)
    values = at_samples(sample, settings.width, settings.windows)
    planes, bias = context.draw_planes(values, 32, 0)
    found = context.left_out(np.maximum(values @ planes.T + bias, 0), sample, settings)
    right = (found > 0) == sample.road
    assert right[sample.frame == 3].mean() < 0.2
    assert right[sample.frame == 0].mean() > 0.6


def test_one_frame_alone_leaves_nothing_out_and_the_threshold_is_zero():
    truth = np.zeros((24, 32), np.uint8)
    truth[12:] = 1
    assert context.fit(every_pixel([grey()], [truth]), PLAIN).threshold == 0.0


def test_a_threshold_that_is_set_is_not_learnt():
    truths = [np.zeros((24, 32), np.uint8) for _ in range(2)]
    for truth in truths:
        truth[12:] = 1
    settings = ContextSettings(planes=32, spare=0, threshold=0.25)
    assert context.fit(every_pixel([grey(), grey()], truths), settings).threshold == 0.25


def test_the_greatest_penalty_that_is_allowed_breaks_no_bound_of_what_is_learnt():
    truths = [np.random.default_rng(n).integers(0, 2, (24, 32), dtype=np.uint8) for n in range(2)]
    machine = context.fit(
        every_pixel([grey(), grey(seed=1)], truths), ContextSettings(planes=8, c=1e6)
    )
    assert np.abs(machine.weights).max() < 1e9


def test_a_penalty_beyond_is_refused():
    with pytest.raises(ValueError, match="less than or equal to 1000000"):
        ContextSettings(c=1e7)


def test_there_are_at_most_eight_windows():
    assert len(ContextSettings(windows=(5,) * 8).windows) == 8
    with pytest.raises(ValueError, match="at most 8 items"):
        ContextSettings(windows=(5,) * 9)


# --- The stage ------------------------------------------------------------------------------------


def test_its_mask_is_tabled_as_svm():
    names = ("exposure", "similarity", "context", "post")
    settings = {name: STAGES[name].settings() for name in names}
    assert Pipeline.default(names).masks() == ("similarity", "svm", "post")
    assert [spec.name for spec in Pipeline(("context",), settings).layers()] == ["decision", "svm"]


def test_its_geodesic_map_is_a_layer_where_there_is_one():
    truth = np.zeros((24, 32), np.uint8)
    truth[12:] = 1
    settings = replace(PLAIN, geodesics=True)
    machine = context.fit(every_pixel([grey()], [truth]), settings)
    image = grey(seed=2)
    layers = context.bind(settings, machine)(View.of(image)).layers
    assert [layer.spec for layer in layers] == list(context.layers(settings))
    assert [layer.spec.name for layer in layers] == ["geodesic", "decision", "svm"]
    over_edges_and_hues = geodesics(image, patch_mask(24, 32, settings.patch))[1]
    np.testing.assert_array_equal(layers[0].array, distance_of(over_edges_and_hues))


class Another:
    """A liblinear of another version."""

    @staticmethod
    def set_verbosity_wrap(_):
        pass

    @staticmethod
    def train_wrap(*_):
        return np.zeros(3)


class Hasty(Another):
    """A liblinear that gives up."""

    @staticmethod
    def train_wrap(mapped, *_):
        return np.zeros((1, mapped.shape[1] + 1)), np.full(1, 1000)


def refuse(*_):
    raise ImportError("it is elsewhere")


@pytest.mark.parametrize(
    ("library", "asked"), [(None, 0), (refuse, 1), (object, 1), (Another, 1), (Hasty, 1)]
)
def test_the_linear_machine_is_scikit_learns_bit_for_bit(monkeypatch, library, asked):
    rng = np.random.default_rng(0)
    mapped = rng.normal(size=(500, 7)).astype(np.float32)
    road = mapped[:, 0] + rng.normal(size=500) > 0.3
    expected = LinearSVC(C=0.7, dual=False).fit(mapped, road)
    if library is not None:
        found = library if library is refuse else lambda *_: library
        monkeypatch.setattr(context, "extension", found)
    monkeypatch.setattr(context, "_by_linear_svc", svc := Mock(wraps=context._by_linear_svc))
    _, weights, offset = context.solve(mapped, road, ContextSettings(planes=7, spare=0, c=0.7))
    assert svc.call_count == asked
    np.testing.assert_array_equal(weights, expected.coef_[0], strict=True)
    assert offset == expected.intercept_[0]

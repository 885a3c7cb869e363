"""The gated filter, on roads painted by hand: one picture for each gate."""

import cv2
import numpy as np
import pytest

from roadeval.pipeline.beyond import gated, road_light
from roadeval.pipeline.beyond.road_light import RoadLight
from roadeval.pipeline.beyond.shadow_gates import VERDICTS, GatedSettings, components, judge, look
from roadeval.pipeline.chain import Pipeline
from roadeval.pipeline.stage import TrainingSet, View
from roadeval.pipeline.stages import STAGES

HEIGHT, WIDTH = 120, 160
ROAD = np.array([120, 120, 120])
SHADE = np.array([0.38, 0.40, 0.44])
"""What is left of red, green and blue where the sky alone gives light."""
GREY = RoadLight(np.zeros(2), np.diag([4e-4, 4e-4]), np.array([-0.055, 0.085]))
PATCH = np.s_[85:105, 60:100]
"""Where the pictures have their dark spot: on the road before the vehicle."""


def road(spot=None, where=PATCH, noise=2.0):
    """An image of road, with a ``spot`` of another colour, and a little texture all over it."""
    image = np.tile(ROAD.astype(float), (HEIGHT, WIDTH, 1))
    if spot is not None:
        image[where] = spot
    texture = np.random.default_rng(0).normal(0, noise / ROAD[0], (HEIGHT, WIDTH, 1))
    return np.clip(np.rint(image * (1 + texture)), 0, 255).astype(np.uint8)


def run(image, model=GREY, **settings):
    output = gated.bind(GatedSettings(**settings), model)(View.of(image))
    return output, {layer.spec.name: layer.array for layer in output.layers}


def verdict(image, **settings):
    """What the component in the middle of `PATCH` was taken for; ``none`` if it is no candidate."""
    _, layers = run(image, **settings)
    return VERDICTS[layers["components"][95, 80]].name


# --- Gates ----------------------------------------------------------------------------------------


def test_shade_on_the_road_is_accepted():
    assert verdict(road(ROAD * SHADE)) == "accepted"


def test_warm_darkness_is_no_candidate_for_its_colour_is_not_the_roads_under_skylight():
    assert verdict(road(ROAD * SHADE[::-1])) == "none"


def test_dark_grass_is_no_candidate():
    assert verdict(road([30, 50, 25])) == "none"


def test_grass_of_the_roads_colour_range_is_stopped_by_its_excess_green():
    meadow = RoadLight(np.zeros(2), np.diag([0.1, 0.1]), GREY.shift)
    spot = road([42, 54, 42])
    _, layers = run(spot, meadow)
    _, without = run(spot, meadow, max_green=9.0)
    assert not layers["candidates"][PATCH].any()
    assert without["candidates"][95, 80]


def test_what_is_hardly_darker_than_the_road_is_no_candidate():
    assert verdict(road(ROAD * 0.7)) == "none"


def test_black_is_no_candidate():
    assert verdict(road([2, 2, 3])) == "none"


def test_nothing_above_the_horizon_is_a_candidate():
    high = road(ROAD * SHADE, np.s_[10:30, 60:100])
    assert not run(high)[1]["candidates"].any()
    assert run(high, horizon=0.0)[1]["candidates"].any()


def test_a_component_without_a_core_is_too_small():
    assert verdict(road(ROAD * SHADE, np.s_[94:98, 60:100])) == "too small"


def test_a_component_that_ends_far_away_is_rejected():
    far = road(ROAD * SHADE, np.s_[46:60, 60:100])
    assert VERDICTS[run(far)[1]["components"][53, 80]].name == "too far away"
    assert VERDICTS[run(far, reach=0.4)[1]["components"][53, 80]].name == "accepted"


def test_a_component_that_no_lit_road_surrounds_is_rejected():
    image = road()
    image[75:115, 50:110] = [200, 60, 60]  # a red lorry on the road, with a dark window
    image[PATCH] = np.rint(ROAD * SHADE)
    assert verdict(image) == "no lit road around it"


def test_a_white_car_is_no_lit_road():
    image = road()
    image[75:115, 50:110] = 250
    image[PATCH] = np.rint(ROAD * SHADE)
    assert verdict(image) == "no lit road around it"
    assert verdict(image, max_level=255) == "accepted"


def test_a_component_darker_than_shade_is_rejected():
    assert verdict(road(ROAD * 0.08)) == "too dark for shade"


def test_a_component_brighter_than_shade_is_rejected():
    assert verdict(road(ROAD * SHADE), ratio=(0.12, 0.3)) == "too bright for shade"


def test_a_component_rougher_than_road_is_rejected():
    image = road(ROAD * SHADE)
    rough = np.random.default_rng(1).uniform(0.6, 1.4, (20, 40, 1))
    image[PATCH] = np.rint(image[PATCH] * rough)
    assert verdict(image) == "rougher than road"
    assert verdict(image, max_texture=1.0) == "accepted"


def test_a_little_darkness_in_a_frame_without_other_shade_is_no_shadow():
    contact = road(ROAD * SHADE, np.s_[90:100, 70:90])  # as beneath a car under a clouded sky
    assert verdict(contact) == "too little in the frame"
    contact[70:110, 5:45] = np.rint(ROAD * SHADE)
    assert verdict(contact) == "accepted"


def test_the_texture_of_a_component_is_the_deviation_of_its_log_brightness():
    settings, image = GatedSettings(), road(ROAD * SHADE, noise=0)
    board = np.indices((20, 40)).sum(axis=0)[..., None] % 2
    image[PATCH] = np.where(board, 44, 56)
    found = components(look(image, GREY, settings), settings)
    assert judge(found, settings)[1:].tolist() == [1]
    # Half the step between the two levels' logarithms, to which four is added first. 13 of a
    # window's 25 pixels are of the level in its middle, so its mean leans that way by 1/25.
    assert found.texture[1] == pytest.approx(24 / 25 * np.log(60 / 48) / 2, rel=1e-3)


# --- Rings ----------------------------------------------------------------------------------------


def test_the_ring_is_lit_road_beyond_the_penumbra():
    _, layers = run(road(ROAD * SHADE), gap=3, ring_width=4)
    column = layers["rings"][:, 80]
    assert np.flatnonzero(column == 1).tolist() == list(range(85, 105))
    assert np.flatnonzero(column == 2).tolist() == [*range(78, 82), *range(108, 112)]


def test_a_pixel_between_two_components_is_in_the_ring_of_the_nearer_one():
    image = road(ROAD * SHADE, np.s_[85:105, 40:60], noise=0)
    image[85:105, 70:90] = np.rint(ROAD * SHADE)
    settings = GatedSettings()
    found = components(look(image, GREY, settings), settings)
    row = found.rings[95]
    assert row[62:68].tolist() == [1, 1, 1, 2, 2, 2]
    assert found.lowest[1:].tolist() == [104 / HEIGHT] * 2


# --- Compensation ---------------------------------------------------------------------------------


def test_accepted_shade_gets_the_colour_of_its_ring_each_channel_apart():
    output, layers = run(road(ROAD * SHADE, noise=0))
    np.testing.assert_allclose(output.image[90:100, 65:95], 120, atol=1)
    assert layers["gain"][95, 80] == pytest.approx(120 / round(120 * 0.38), rel=0.01)


def test_the_gain_rises_softly_over_the_edge():
    _, layers = run(road(ROAD * SHADE, noise=0))
    edge = layers["gain"][95, 55:66]
    assert (np.diff(edge) >= -1e-6).all()
    assert ((edge > 1.01) & (edge < edge[-1] - 0.01)).sum() == 4


def test_the_outermost_pixel_of_the_shade_gets_no_more_than_half_of_what_is_missing():
    _, layers = run(road(ROAD * SHADE, noise=0))
    gain = layers["gain"][95]
    assert gain[60] - 1 < 0.5 * (gain[80] - 1)
    assert gain[58] == 1


def test_no_gain_is_larger_than_the_least_ratio_allows():
    image = road([21, 30, 60])
    wide = RoadLight(np.zeros(2), np.eye(2), GREY.shift)
    output, layers = run(image, wide, ratio=(0.25, 0.75))
    assert VERDICTS[layers["components"][95, 80]].name == "accepted"
    assert layers["gain"].max() == pytest.approx(4.0)
    assert output.facts["max_gain"] == pytest.approx(4.0)


def test_far_from_accepted_shade_nothing_changes():
    image = road(ROAD * SHADE)
    output, layers = run(image)
    untouched = layers["gain"] == 1
    assert untouched.mean() > 0.9
    np.testing.assert_array_equal(output.image[untouched], image[untouched])


@pytest.mark.parametrize(
    "image",
    [
        road(),
        road(ROAD * SHADE, np.s_[94:98, 60:100]),
        road(ROAD * SHADE, np.s_[90:100, 70:90]),
        np.zeros((9, 11, 3), np.uint8),
        np.full((1, 1, 3), 255, np.uint8),
        np.random.default_rng(0).integers(0, 256, (60, 400, 3), dtype=np.uint8),
    ],
    ids=["road alone", "a component too small", "too little", "black", "one pixel", "noise"],
)
def test_a_frame_without_accepted_shade_passes_bit_for_bit(image):
    output, layers = run(image)
    assert output.image is image
    assert not layers["shadow"].any()
    assert (layers["gain"] == 1).all()
    assert output.regions["lit"].pixels().all()


# --- The stage ------------------------------------------------------------------------------------


def test_a_wide_image_is_judged_as_the_reduced_one_and_compensated_at_its_own_size():
    small = road(ROAD * SHADE, noise=0)
    large = np.repeat(np.repeat(small, 3, axis=0), 3, axis=1)
    _, expected = run(small, width=WIDTH)
    output, layers = run(large, width=WIDTH)
    assert output.image.shape == large.shape
    for name in ("candidates", "components", "shadow", "rings"):
        np.testing.assert_array_equal(layers[name][1::3, 1::3], expected[name], err_msg=name)
    np.testing.assert_allclose(output.image[270:300, 195:285], 120, atol=1)


def test_layers_are_the_ones_announced():
    settings = GatedSettings()
    output, _ = run(road(ROAD * SHADE))
    assert tuple(layer.spec for layer in output.layers) == gated.layers(settings)
    for layer in output.layers:
        kinds = {"scalar": np.float32}
        assert layer.array.dtype == kinds.get(layer.spec.kind, np.uint8)


def test_every_pixel_is_in_one_region():
    output, _ = run(road(ROAD * SHADE))
    assert set(output.regions) == {"shadow", "shadow_edge", "lit"}
    np.testing.assert_array_equal(sum(m.pixels() for m in output.regions.values()), 1)


def test_facts_count_components_by_what_became_of_them():
    image = road(ROAD * SHADE)
    image[92:96, 20:40] = np.rint(ROAD * SHADE)
    facts = run(image)[0].facts
    assert (facts["components"], facts["compensated"], facts["too_small"]) == (2, 1, 1)


def test_the_ratio_must_be_two_shares_in_order():
    with pytest.raises(ValueError, match="lower one first"):
        GatedSettings(ratio=(0.7, 0.2))


# --- Its oracle -----------------------------------------------------------------------------------


def told(image, shadow, **settings):
    """What the filter makes of an image once it knows what is shadow."""
    return gated.oracle(GatedSettings(**settings), GREY)(View.of(image), shadow).image


def truth(*spots):
    shadow = np.zeros((HEIGHT, WIDTH), np.uint8)
    for spot in spots:
        shadow[spot] = 1
    return shadow


def by_hand(image):
    """Brighten `PATCH` by the plain words of the filter: mean of the ring over mean of the core."""
    core = image[87:103, 62:98].reshape(-1, 3)
    y, x = np.indices((HEIGHT, WIDTH))
    away = np.max([85 - y, y - 104, 60 - x, x - 99], axis=0)
    ring = image[(away > 2) & (away <= 8)]
    gain = np.ones((HEIGHT, WIDTH, 3), np.float32)
    gain[86:104, 61:99] = np.clip(ring.mean(axis=0) / core.mean(axis=0), 1, 1 / 0.12)
    return np.clip(np.rint(image * cv2.blur(gain, (5, 5))), 0, 255)


@pytest.mark.parametrize(
    ("spot", "verdict_without"),
    [(ROAD * SHADE, "accepted"), (ROAD * SHADE[::-1], "none"), (ROAD * 0.09, "too dark for shade")],
    ids=["shade", "warm darkness", "near black"],
)
def test_true_shadow_gets_the_gain_of_its_ring_whatever_the_gates_say(spot, verdict_without):
    image = road(spot)
    assert verdict(image) == verdict_without
    given = told(image, truth(PATCH))
    assert (given != image).any()
    np.testing.assert_allclose(given, by_hand(image), atol=1)


def test_what_is_no_true_shadow_is_left_alone_though_the_gates_accept_it():
    elsewhere = np.s_[70:78, 10:30]
    image = road(ROAD * SHADE)
    image[elsewhere] = np.rint(image[elsewhere] * SHADE)
    assert verdict(image) == "accepted"
    given = told(image, truth(elsewhere))
    assert (given[elsewhere] > image[elsewhere]).all()
    np.testing.assert_array_equal(given[PATCH], image[PATCH])


def test_a_filter_that_is_told_what_it_found_gives_what_it_gave():
    image = road(ROAD * SHADE)
    output, layers = run(image)
    assert layers["shadow"].any()
    np.testing.assert_array_equal(told(image, layers["shadow"]), output.image)


@pytest.mark.parametrize("nothing", np.uint8([0, 255]), ids=["no shadow", "nobody knows"])
def test_without_true_shadow_the_image_passes_bit_for_bit(nothing):
    image = road(ROAD * SHADE)
    assert told(image, nothing * truth(PATCH)) is image


def test_true_shadow_without_lit_road_around_it_stays_as_it_is():
    image = road()
    image[75:115, 50:110] = [200, 60, 60]
    image[PATCH] = np.rint(ROAD * SHADE)
    alone = told(image, truth(PATCH))
    np.testing.assert_array_equal(alone, image)
    image[95:105, 10:30] = np.rint(ROAD * SHADE)
    beside_another = told(image, truth(PATCH, np.s_[95:105, 10:30]))
    np.testing.assert_array_equal(beside_another[PATCH], image[PATCH])
    assert (beside_another[95:105, 10:30] > image[95:105, 10:30]).any()


@pytest.mark.parametrize("where", [np.s_[:], np.s_[50:53, 20:100]], ids=["all of it", "a line"])
def test_true_shadow_that_cannot_be_measured_stays_as_it_is(where):
    image = road(ROAD * SHADE)
    np.testing.assert_array_equal(told(image, truth(where)), image)


def test_true_shadow_of_a_wide_image_is_measured_on_the_reduced_one():
    small = road(ROAD * SHADE[::-1], noise=0)
    large, shadow = (
        np.repeat(np.repeat(array, 3, axis=0), 3, axis=1) for array in (small, truth(PATCH))
    )
    given = told(large, shadow, width=WIDTH)
    np.testing.assert_allclose(given[270:300, 195:285], 120, atol=1)
    np.testing.assert_array_equal(given[:200], large[:200])


# --- What it learns -------------------------------------------------------------------------------


def training_set(*frames):
    """Road pixels alone, one row a frame."""
    images = tuple(np.array([frame], np.uint8) for frame in frames)
    frame = np.repeat(np.arange(len(frames)), [len(f) for f in frames])
    column = np.concatenate([np.arange(len(f)) for f in frames])
    return TrainingSet(images, frame, np.zeros_like(frame), column, np.ones(len(frame), bool))


def test_lit_and_shaded_road_are_told_apart_within_a_frame():
    bright, dull = [200, 190, 180], [100, 95, 90]
    sample = training_set([bright] * 900 + [[60, 60, 60]] * 900, [dull] * 900)
    model = road_light.fit(sample)
    logs = np.log(np.array([bright, dull]) + 8.0)
    lit = (logs[:, [0, 2]] - logs[:, [1]]).mean(axis=0)
    np.testing.assert_allclose(model.mean, lit, atol=1e-6)
    # 900 grey pixels, against what 100 pixels of skylight would say.
    expected = (900 * (0 - lit) + road_light.SKYLIGHT_WEIGHT * road_light.SKYLIGHT) / 1000
    np.testing.assert_allclose(model.shift, expected, atol=1e-6)


def test_without_shaded_road_the_shift_is_skylights():
    model = road_light.fit(training_set([[120, 120, 120]] * 50))
    np.testing.assert_array_equal(model.shift, road_light.SKYLIGHT)


def test_the_distance_to_lit_road_is_mahalanobis():
    model = RoadLight(np.array([0.1, -0.2]), np.array([[0.02, 0.01], [0.01, 0.03]]), GREY.shift)
    image = np.random.default_rng(0).integers(0, 256, (4, 5, 3), dtype=np.uint8)
    logs = np.log(image + 8.0)
    away = logs[..., [0, 2]] - logs[..., [1]] - model.mean
    expected = np.einsum("hwi,ij,hwj->hw", away, np.linalg.inv(model.covariance), away)
    np.testing.assert_allclose(
        road_light.likeness(image, model).lit, expected, rtol=1e-3, atol=1e-4
    )


def test_the_distance_to_shaded_road_is_the_least_along_the_segment():
    model = RoadLight(np.array([0.1, -0.2]), np.array([[0.02, 0.01], [0.01, 0.03]]), GREY.shift)
    image = np.random.default_rng(0).integers(0, 256, (4, 5, 3), dtype=np.uint8)
    along = [
        road_light.likeness(
            image, RoadLight(model.mean + share * model.shift, model.covariance, GREY.shift)
        ).lit
        for share in np.linspace(0, 1, 201)
    ]
    found = road_light.likeness(image, model).shaded
    np.testing.assert_allclose(found, np.min(along, axis=0), rtol=0.02, atol=2e-3)


def test_excess_green_and_brightness_by_hand():
    image = np.array([[[10, 40, 30], [0, 0, 0]]], np.uint8)
    total = road_light.brightness(image)
    assert total.tolist() == [[80, 0]]
    np.testing.assert_allclose(road_light.excess_green(image, total), [[0.5, 0.0]])


def test_quantiles_are_taken_of_the_masked_pixels_alone():
    values, mask = np.array([[1, 2, 3, 4, 700]], np.uint16), np.array([[1, 1, 1, 1, 0]], np.uint8)
    assert [road_light.quantile(values, mask, share) for share in (0.25, 0.5, 1.0)] == [1, 2, 4]
    assert road_light.quantile(values, 0 * mask, 0.5) == 0


def test_the_stage_learns_and_runs_in_a_chain():
    settings = {"gated": GatedSettings()}
    sample = training_set([[120, 120, 120]] * 90 + [[46, 48, 53]] * 10)
    parameters = {"gated": STAGES["gated"].fit(sample, settings["gated"])}
    image = road(ROAD * SHADE)
    assert (Pipeline(("gated",), settings).bind(parameters).filtered(image) != image).any()

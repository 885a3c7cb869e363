"""Each group of features, held against SciPy, scikit-image or a plain loop; and exposure."""

import cv2
import numpy as np
import pytest
from scipy import ndimage
from skimage.graph import MCP_Geometric
from skimage.measure import block_reduce
from skimage.transform import downscale_local_mean

from roadeval.pipeline.beyond import exposure
from roadeval.pipeline.beyond.features import GROUPS, beyond, features, greatest_outwards, names_of
from roadeval.pipeline.reference_patch import ReferencePatch, patch_mask
from roadeval.pipeline.scene import (
    LEVEL,
    expose,
    from_patch,
    gains,
    reach,
    scene_of,
    steepness,
    tones_of,
)
from roadeval.pipeline.stage import View

PATCH = ReferencePatch()
ALL = tuple(GROUPS)
WIDTH, HEIGHT = 64, 48
INNER = np.s_[24:-24, 30:-30]
"""Clear of the borders, where libraries differ."""


def picture(width=2 * WIDTH, height=2 * HEIGHT, seed=0):
    """Smooth colours at random."""
    noise = np.random.default_rng(seed).integers(0, 256, (height, width, 3)).astype(np.uint8)
    return cv2.GaussianBlur(noise, (0, 0), 2)


@pytest.fixture(scope="module")
def scene():
    return scene_of(picture(), WIDTH, PATCH)


def planes(group, scene):
    return [*GROUPS[group](scene).values()]


def close(values, expected, tolerance=1e-4):
    np.testing.assert_allclose(values, expected, rtol=tolerance, atol=tolerance)


def slopes(plane):
    """Sobel's slopes, as SciPy computes them."""
    wide = plane.astype(float)
    return [ndimage.sobel(wide, axis=axis, mode="mirror") / 8 for axis in (1, 0)]


def averaged(plane, rows, columns=None):
    size = rows, columns or rows
    return ndimage.uniform_filter(plane.astype(float), size, mode="mirror")


# --- Scene ----------------------------------------------------------------------------------------


def test_the_working_image_is_the_mean_of_four_pixels_of_the_fine_one(scene):
    np.testing.assert_array_equal(scene.fine, picture())
    means = downscale_local_mean(picture().astype(float), (2, 2, 1))
    assert np.abs(scene.image - means).max() <= 0.5


def test_tones_are_logarithms_and_their_differences(scene):
    red, green, blue = np.moveaxis(np.log(scene.image + 8.0), 2, 0)
    for values, expected in zip(
        scene.tones, ((red + green + blue) / 3, red - green, blue - green), strict=True
    ):
        close(values, expected)


def test_distance_to_the_patch_is_in_its_own_deviations_from_its_medians():
    patch = np.array([[1, 1, 1, 1, 1, 0]], np.uint8)
    tone = np.array([[1.0, 2.0, 3.0, 4.0, 50.0, 9.0]], np.float32)
    flat = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.04]], np.float32)
    middle, hue, distance = from_patch((tone, flat, flat), patch)
    assert middle == (3.0, 0.0, 0.0)
    close(hue[0, 5], np.hypot(2, 2))
    close(distance[0, 5], np.sqrt(((9 - 3) / (1.48 * 1 + 0.06)) ** 2 + 8))


# --- Groups ---------------------------------------------------------------------------------------


def test_every_group_gives_the_features_that_it_names(scene):
    for name, group in GROUPS.items():
        assert names_of((name,)) == tuple(f"{name}.{feature}" for feature in group(scene))
    values = features(scene, ALL)
    assert values.shape == (len(names_of(ALL)), HEIGHT, WIDTH)
    assert np.isfinite(values).all()
    assert len(set(names_of(ALL))) == len(values)


def test_an_image_of_one_colour_has_no_feature_that_is_not_finite():
    for grey in (0, 255):
        flat = np.full((24, 32, 3), grey, np.uint8)
        assert np.isfinite(features(scene_of(flat, 32, PATCH), ALL)).all()


def test_colour_is_projected_relative_to_the_patch(scene):
    *channels, _, red, blue = planes("colour", scene)[:6]
    np.testing.assert_array_equal(np.stack(channels, axis=2), scene.image)
    inside = scene.patch > 0
    for angle, values in zip((30, 45, 60), planes("colour", scene)[6:9], strict=True):
        way = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        light = way[0] * np.median(red[inside]) + way[1] * np.median(blue[inside])
        close(values, way[0] * red + way[1] * blue - light)


def test_light_is_held_against_the_lower_half_and_the_row(scene):
    light = scene.tones[0].astype(float)
    half, bright, row, far = planes("light", scene)
    lower = np.sort(light[HEIGHT // 2 :].ravel())
    close(light - half, lower[[len(lower) // 2 - 1, len(lower) // 2]].mean())
    assert np.mean(light[HEIGHT // 2 :] < (light - bright)[0, 0]) == pytest.approx(0.8, abs=0.01)
    close(row[5], light[5] - np.mean(light[5]))
    close(far[5], np.median(scene.colour[5]))


def test_place_is_the_pixels_centre(scene):
    across, outer, down = planes("place", scene)
    close(across[0, [0, 31, 32, 63]], [-63 / 64, -1 / 64, 1 / 64, 63 / 64])
    np.testing.assert_array_equal(outer, np.abs(across))
    close(down[[0, 47], 0], [0.5 / 48, 47.5 / 48])


def test_texture_is_the_root_of_the_mean_slope(scene):
    values = planes("texture", scene)
    for place_, (side, way) in enumerate((side, way) for side in (3, 9, 21) for way in (0, 1)):
        mean = averaged(np.abs(slopes(scene.tones[0])[way]), side)
        close(values[place_][INNER], np.sqrt(mean)[INNER], 1e-3)
    deviation = ndimage.generic_filter(scene.tones[0].astype(float), np.std, 9)
    close(values[6][INNER], deviation[INNER], 1e-3)


def test_surroundings_are_means_and_their_changes(scene):
    values = planes("surroundings", scene)
    for place_, (side, tone) in enumerate((s, t) for s in (7, 19, 41) for t in scene.tones):
        close(values[place_][INNER], averaged(tone, side)[INNER], 1e-3)
    mean = values[0]
    close(values[9][:, 14:], mean[:, 14:] - mean[:, :-14])  # 14 columns to the left
    close(values[13][:-20], mean[:-20] - mean[20:])  # 20 rows down
    close(values[9][:, :14], mean[:, :14] - mean[:, :1])  # beyond the border lies the border


def test_a_column_is_walked_from_below_and_from_above(scene):
    values = planes("scans", scene)
    steep = np.sqrt(averaged(np.abs(slopes(scene.tones[0])[1]), 3, 5))
    bright, colours = averaged(scene.tones[0], 5), averaged(scene.colour, 3)
    hue, edge = averaged(scene.hue, 3), averaged(np.hypot(*slopes(scene.tones[0])), 3, 5)
    x = WIDTH // 2
    for y in (3, 20, 40):
        for first, rows in ((0, np.s_[y:]), (6, np.s_[: y + 1])):
            expected = [
                steep[rows, x].max(),
                bright[rows, x].min(),
                bright[rows, x].max(),
                colours[rows, x].mean(),
                hue[rows, x].max(),
                edge[rows, x].sum(),
            ]
            close([plane[y, x] for plane in values[first : first + 6]], expected, 1e-3)


@pytest.mark.parametrize("width", [1, 2, 7, 8])
def test_a_row_is_walked_from_the_middle_outwards(width):
    plane = np.random.default_rng(width).random((3, width)).astype(np.float32)
    values, half = greatest_outwards(plane), width // 2
    for y, x in np.ndindex(plane.shape):
        met = plane[y, half : x + 1] if x >= half else plane[y, x:half]
        assert values[y, x] == met.max()


def test_paths_are_the_integrals_of_their_costs_along_the_cheapest_path(scene):
    edge = np.hypot(*slopes(scene.tones[0]))
    hue, distance = np.minimum(scene.hue, 10), np.minimum(scene.colour, 15)
    costs = edge, edge / 2 + hue / 20, 0.03 * distance
    for cost, values in zip(costs, planes("paths", scene), strict=True):
        expected, _ = MCP_Geometric(0.005 + cost).find_costs(np.argwhere(scene.patch))
        # A step aslant is 1 % shorter than the root of 2, and a cost is rounded to 1e-4.
        close(values, expected, 0.02)


def test_barriers_are_the_greatest_of_four_pixels(scene):
    tones = tones_of(scene.fine)
    edge = np.hypot(*slopes(tones[0]))
    hues = sum(np.hypot(*slopes(tone)) for tone in tones[1:])
    yellow = tones[1] / 2 - tones[2]
    expected = [
        edge,
        edge / (averaged(edge, 31) + 0.02),
        hues,
        np.maximum(averaged(yellow, 3) - averaged(yellow, 15), 0),
        np.maximum(averaged(tones[0], 15) - averaged(tones[0], 3), 0),
    ]
    values = planes("barriers", scene)
    for mine, plane in zip(values, expected, strict=False):
        close(mine[INNER], block_reduce(plane, (2, 2), np.max)[INNER], 1e-3)
    for mine, plane in zip(values[10:15], values[:5], strict=True):
        np.testing.assert_array_equal(mine, greatest_outwards(plane))


def test_squared_barriers_are_costs_of_a_path(scene):
    edge, relative, *_, around, relative_around = planes("barriers", scene)
    for cost, values in ((20 * edge**2, around), (0.05 * relative**2, relative_around)):
        expected, _ = MCP_Geometric(0.005 + np.minimum(cost, 6.5)).find_costs(
            np.argwhere(scene.patch)
        )
        close(values, expected, 0.02)


def test_reach_is_the_mean_of_two_distances_over_their_thresholds(scene):
    values = features(scene, ALL)
    names = names_of(ALL)
    over, around = (values[names.index(n)] for n in ("paths.over_edges", "barriers.around_edge"))
    close(reach(scene), (over / 1.0 + around / 1.5) / 2)


def test_only_lit_ground_lies_beyond_the_end_of_the_road():
    far, light = np.meshgrid(np.float32([0, 1, 1.5, 3]), np.float32([-2, -0.8, -0.55, -0.3, 1]))
    expected = np.outer([0, 0, 0.5, 1, 1], [0, 0, 0.5, 2])
    close(beyond(far, light), expected)


def test_steepness_does_not_depend_on_where_arrays_lie_in_memory():
    """Vector instructions may round otherwise at the ends of an array, and these move."""
    across, down = np.random.default_rng(0).normal(size=(2, 1000)).astype(np.float32)
    first = steepness((across, down))
    for offset in range(16):
        room = np.empty((2, 1016), np.float32)
        moved = room[0, offset : offset + 1000], room[1, offset : offset + 1000]
        for place_, values in zip(moved, (across, down), strict=True):
            place_[:] = values
        np.testing.assert_array_equal(steepness(moved), first)


def street(road, elsewhere=(10, 200, 90), shape=(40, 60)):
    """An image with one colour in the reference patch and another one elsewhere."""
    patch = patch_mask(*shape, PATCH)
    return np.where(patch[..., None] > 0, road, elsewhere).astype(np.uint8)


def run(image):
    return exposure.bind(exposure.NoSettings(), None)(View.of(image))


def test_the_patch_turns_grey():
    image = street((48, 96, 192))
    patch = patch_mask(40, 60, PATCH) > 0
    assert (run(image).image[patch] == 96).all()


def test_each_channel_is_multiplied_everywhere():
    output = run(street((48, 96, 192)))
    assert output.image[0, 0, [0, 2]].tolist() == [20, 45]


def test_what_is_brighter_than_the_patch_is_compressed_and_keeps_its_order():
    # 96 + 159 (x - 96) / (x - 96 + 159), with x of 200, of 2 * 200, and of 1.
    found = run(street((48, 96, 192), elsewhere=(200, 200, 1))).image[0, 0].tolist()
    assert found == [200, 159, 0]
    greys = np.repeat(np.arange(256, dtype=np.uint8)[:, None], 3, axis=1)[None]
    tones = expose(greys, np.full(3, 3.0), LEVEL)[0, :, 0].astype(int)
    assert (np.diff(tones[:64]) >= 1).all()
    assert (np.diff(tones) >= 0).all()
    assert tones[32] == 96
    assert tones[-1] < 255


def test_the_median_is_what_counts_not_what_stands_on_the_road():
    image = street((48, 48, 48))
    image[:, 32:] = 255  # two fifths of the patch
    assert gains(image, PATCH)[0] == 2.0


@pytest.mark.parametrize(("grey", "gain"), [(0, 6.0), (1, 6.0), (255, LEVEL / 255)])
def test_gains_are_bounded(grey, gain):
    assert gains(street((grey,) * 3), PATCH)[0] == gain


def test_the_same_scene_under_another_exposure_gives_nearly_the_same_image():
    rng = np.random.default_rng(0)
    light = rng.uniform(40, 100, (40, 60, 3))
    dim = run(np.rint(light).astype(np.uint8)).image.astype(int)
    bright = run(np.rint(light * [1.8, 1.5, 1.2]).astype(np.uint8)).image.astype(int)
    assert np.abs(dim - bright).max() <= 4

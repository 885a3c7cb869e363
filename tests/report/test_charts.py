"""Which charts are made of which rows, where their parts lie, and how layers are painted."""

import io
import math

import av
import cv2
import numpy as np
import pandas as pd
import pytest

from roadeval.data import ERRORS, LayerKind, LayerSpec
from roadeval.data.colours import MOST_ERRORS, NEVER_LABELLED, VERMILLION
from roadeval.evaluation.stats.difference import Difference
from roadeval.report.chart import Chart, ChartKind, Level, Look, Series, looks_of_results, thin
from roadeval.report.charts import standard as charts
from roadeval.report.charts.standard import DRAWN, MEAN
from roadeval.report.drawing import AxisRange, place_chart, range_of_frames, ticks, values
from roadeval.report.film import CAMERA, TRUTH_PANEL, clip_picture, encode, make_film
from roadeval.report.images import DARKEN, LayerImage, heat_map, jpeg, paint

# --- Looks ----------------------------------------------------------------------------------------


def test_of_several_results_a_variant_keeps_its_hue_and_a_result_its_dash():
    masks = {f"{r}: {v}": (r, v) for v in ("filtered", "robust") for r in ("old", "new")}
    found = looks_of_results(masks)
    assert len({look.colour for look in found.values()}) == 2
    assert found["old: robust"].colour == found["new: robust"].colour
    assert found["old: robust"].dash == found["old: filtered"].dash == "solid"
    assert found["new: robust"].dash == found["new: filtered"].dash == "dashed"


# --- Drive by drive -------------------------------------------------------------------------------

OVER = Difference(0.01, -0.01, 0.03, 0.2, 0.95, "drives", 3)


def drives(count):
    rows = [(f"drive_{n}", None, n / 1000, (n - 1) / 1000, None) for n in range(count)]
    return pd.DataFrame(rows, columns=["name", "group", "mean", "low", "high"])


def test_few_drives_have_a_row_each_and_below_them_the_mean():
    (chart,) = charts.forest(drives(3), OVER, "change").charts
    assert chart.kind is ChartKind.MARKS
    assert chart.names == ["drive_2", "drive_1", "drive_0", MEAN]
    assert chart.sums == 1
    *_, mean = chart.series
    assert (mean.x, mean.y, mean.low, mean.high) == ([3], [1], [-1], [3])


def test_of_many_drives_the_worst_and_the_best_have_a_row():
    figure = charts.forest(drives(DRAWN + 4), OVER, "change")
    (chart,) = figure.charts
    half = DRAWN // 2
    assert len(chart.names) == DRAWN + 1
    assert chart.names[half - 1 : half + 1] == [f"drive_{half + 4}", f"drive_{half - 1}"]
    assert "The 20 worst and the 20 best of all drives." in figure.caption


def series(x, y, look=None, **more):
    return Series("a", look or Look("#0072B2"), x, y, **more)


def lines(*drawn_series, **more):
    return Chart("ERR", ChartKind.LINES, drawn_series, **more)


def test_a_line_goes_through_its_points_from_the_top_down():
    made = place_chart(lines(series([0, 10], [0.0, 100.0])), AxisRange(0, 10))
    (shape,) = made.shapes
    assert shape.runs == [[(0, 100), (100, pytest.approx(5.66, abs=0.001))]]
    assert shape.path == "M0 100L100 5.66"
    assert shape.marks == shape.runs[0]


def test_a_line_breaks_where_a_value_is_undefined():
    chart = lines(series([0, 1, 2], [1.0, math.nan, 1.0]))
    made = place_chart(chart)
    assert len(made.shapes[0].runs) == made.shapes[0].path.count("M") == 2
    assert values(chart, made)["series"][0]["y"] == [1.0, None, 1.0]


def test_charts_along_the_drive_share_one_range_and_others_have_none():
    windows, frames = lines(series([14.5, 84.5], [1, 1])), lines(series([10, 100], [1, 1]))
    named = lines(series([0, 900], [1, 1]), names=["svm", "post"])
    span = range_of_frames([windows, frames, named])
    assert 5 < span.low < 10
    assert 100 < span.high < 105
    assert place_chart(windows, span).x == place_chart(frames, span).x == span
    assert place_chart(named, span).x == AxisRange(-0.3, 1.3)


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [(0, 9, [0, 2.5, 5, 7.5]), (-1, 1, [-1, -0.5, 0, 0.5, 1]), (0, 0.03, [0, 0.01, 0.02, 0.03])],
)
def test_ticks_are_round_numbers_inside_the_range(low, high, expected):
    assert ticks(AxisRange(low, high), 4) == pytest.approx(expected)


@pytest.mark.parametrize("more", [{"across": "recall", "x_range": (0, 101)}, {"names": ["a", "b"]}])
def test_the_last_number_below_a_chart_has_room(more):
    kind = ChartKind.MARKS if "names" in more else ChartKind.LINES
    placed = place_chart(
        Chart("ERR", kind, [Series("a", Look("#000000"), [0, 1], [0, 99])], **more)
    )
    place, number = placed.x_ticks[-1]
    assert number == "100"
    assert place <= 95


def test_marks_have_their_value_and_interval_and_leave_out_what_is_undefined():
    own = series([0, 1], [2.0, math.nan], low=[1.0, math.nan], high=[4.0, math.nan])
    made = place_chart(Chart("ERR", ChartKind.MARKS, [own], names=["lit", "shadow"]))
    first, second = made.rows
    assert [mark.text for mark in first.marks] == ["a: 2.00 % (1.00 to 4.00)"]
    assert second.marks == []


def test_a_level_lies_across_with_its_interval_and_belongs_to_the_values():
    chart = Chart("change", ChartKind.LINES, [series([0], [2.0])], level=Level("mean", 2, 1, 4))
    made = place_chart(chart)
    high = 4 * 1.06
    assert made.level == pytest.approx(100 * (1 - 2 / high), abs=0.001)
    assert made.band == pytest.approx((100 * (1 - 4 / high), 300 / high), abs=0.002)
    assert values(chart, made)["level"] == {"name": "mean", "value": 2, "low": 1, "high": 4}
    plain = Chart("change", ChartKind.LINES, [series([0], [2.0])], level=Level("mean", 1))
    assert place_chart(plain).band is None
    assert values(plain, place_chart(plain))["level"]["low"] is None


def test_of_a_long_drive_neighbours_are_averaged():
    long = thin(series(list(range(10)), [float(n) for n in range(10)]), most=5)
    assert long.x == [0, 2, 4, 6, 8]
    assert long.y == [0.5, 2.5, 4.5, 6.5, 8.5]
    assert thin(long, most=5) is long


GREY = np.full((2, 4, 3), 100, np.uint8)


def test_a_class_has_its_colour_over_the_darkened_image_and_a_clear_one_none():
    labels = np.array([[0, 1, 2, 3], [4, 0, 0, 0]], np.uint8)
    colours = paint(LayerImage("", GREY, ERRORS, labels))
    assert colours[0, 0].tolist() == [100 * DARKEN] * 3
    red, green, blue, alpha = ERRORS.classes[2].rgba
    over = [np.rint(100 * DARKEN * (1 - alpha / 255) + c * alpha / 255) for c in (red, green, blue)]
    assert colours[0, 2].tolist() == over


def test_a_map_of_numbers_spans_its_range_and_is_clipped_to_it():
    spec = LayerSpec("ndi", LayerKind.SCALAR, "NDI", value_range=(-1.0, 1.0))
    colours = paint(LayerImage("", GREY, spec, np.array([[-9.0, -1.0, 1.0, 9.0]], np.float32)))
    low, _, high, _ = colours[0].tolist()
    assert colours[0].tolist() == [low, low, high, high]
    assert sum(high) > sum(low)


@pytest.mark.parametrize(("width", "wanted"), [(3, (3, 2)), (400, (4, 2))])
def test_a_picture_is_brought_down_but_never_up(width, wanted):
    decoded = cv2.imdecode(np.frombuffer(jpeg(LayerImage("", GREY), width).content, np.uint8), 1)
    assert (decoded.shape[1], decoded.shape[0]) == wanted


def test_a_heat_map_goes_from_white_to_the_darkest_shade():
    made = heat_map(np.array([[0.0, 0.2], [np.nan, 0.1]]), 0.2, VERMILLION)
    picture = cv2.imdecode(np.frombuffer(made.content, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    side = len(picture) // 2
    inner = picture[side // 2 :: side, side // 2 :: side].reshape(-1, 3)
    white, dark, unknown, middle = map(tuple, inner.tolist())
    assert (white, dark, unknown) == ((255, 255, 255), MOST_ERRORS, NEVER_LABELLED)
    assert np.allclose(middle, VERMILLION, atol=2)


# --- The video of a page --------------------------------------------------------------------------


@pytest.mark.parametrize("size", [(1, 1), (17, 33), (1, 3000)])
def test_images_of_any_size_make_a_video(size):
    images = {CAMERA: np.full((*size, 3), 90, np.uint8), TRUTH_PANEL: np.zeros(size, np.uint8)}
    film = make_film([4, 7], [*images], lambda _: images, 60_000)
    with av.open(io.BytesIO(film.content)) as video:
        pictures = [frame.to_ndarray(format="gray") for frame in video.decode(video=0)]
    assert len(pictures) == 2
    assert all(picture.shape == (film.height, 2 * film.width) for picture in pictures)


def test_edges_of_the_truth_do_not_turn_into_ignored_pixels():
    truth = np.kron(np.indices((31, 31)).sum(axis=0) % 2, np.ones((25, 25))).astype(np.uint8) * 255
    images = {CAMERA: np.full((*truth.shape, 3), 90, np.uint8), TRUTH_PANEL: truth}
    film = make_film([0], [*images], lambda _: images, 10**6)
    with av.open(io.BytesIO(film.content)) as video:
        (picture,) = (frame.to_ndarray(format="rgb24") for frame in video.decode(video=0))
    shades = picture[:, film.width :, 0]
    assert np.mean((shades > 63) & (shades < 192)) < 0.01


@pytest.mark.parametrize("panels", [1, 2])
@pytest.mark.parametrize(("height", "width"), [(9, 17), (240, 320), (241, 961), (1200, 1920)])
def test_clips_of_images_of_any_size_are_960_to_1920_pixels_across(height, width, panels):
    image, name = np.full((height, width, 3), 90, np.uint8), "a name that is far too long " * 9
    truth = np.ones((height, width), np.uint8)
    picture = clip_picture([LayerImage(name, image)] * panels, truth, "drive")
    content = encode([picture], "mp4", 2, {})
    with av.open(io.BytesIO(content)) as video:
        (frame,) = video.decode(video=0)
    assert 960 <= frame.width <= 1920
    assert frame.height == pytest.approx(48 + height * frame.width / (width * panels), abs=1)


def test_a_clip_of_a_high_narrow_image_can_be_encoded():
    image = LayerImage("a", np.full((400, 6, 3), 90, np.uint8))
    picture = clip_picture([image, image], None, "drive")
    assert picture.shape[0] <= 4096 + 48
    assert encode([picture], "mp4", 2, {})


def test_equal_pictures_give_equal_films():
    images = {CAMERA: np.full((8, 8, 3), 90, np.uint8)}
    one, other = (make_film([0, 1], [CAMERA], lambda _: images, 60_000) for _ in range(2))
    assert one.content == other.content

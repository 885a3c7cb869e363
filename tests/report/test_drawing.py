"""Where the parts of a chart lie, for a page and for paper."""

import json
import math

import cv2
import numpy as np
import pytest

from roadeval.data.colours import MOST_ERRORS, NEVER_LABELLED, VERMILLION
from roadeval.report.chart import Chart, ChartKind, HeatMap, Level, Look, Series, thinned
from roadeval.report.drawing import Span, drawn, span_of_frames, ticks


def series(x, y, look=None, **more):
    return Series("a", look or Look("#0072B2"), x, y, **more)


def lines(*drawn_series, **more):
    return Chart("ERR", ChartKind.LINES, drawn_series, **more)


def test_a_line_goes_through_its_points_from_the_top_down():
    made = drawn(lines(series([0, 10], [0.0, 100.0])), Span(0, 10))
    (shape,) = made.shapes
    assert made.y == Span(0.0, 106.0)
    assert shape.path == "M0 100L10 5.66"


def test_a_line_breaks_where_a_value_is_undefined():
    made = drawn(lines(series([0, 1, 2], [1.0, math.nan, 1.0])))
    assert made.shapes[0].path.count("M") == 2
    assert made.values()["series"][0]["y"] == [1.0, None, 1.0]


def test_charts_along_the_drive_share_one_range_and_others_have_none():
    windows, frames = lines(series([14.5, 84.5], [1, 1])), lines(series([10, 100], [1, 1]))
    named = lines(series([0, 900], [1, 1]), names=["svm", "post"])
    span = span_of_frames([windows, frames, named])
    assert 5 < span.low < 10
    assert 100 < span.high < 105
    assert drawn(windows, span).x == drawn(frames, span).x == span
    assert drawn(named, span).x == Span(-0.3, 1.3)


def test_without_a_frame_there_still_is_a_range():
    assert span_of_frames([]).size > 0
    assert drawn(lines()).x.size > 0


def test_bars_stand_on_zero():
    chart = Chart("change", ChartKind.BARS, [series([0, 1], [10.0, -10.0])], unit="pp")
    made = drawn(chart)
    assert made.zero == 50
    upper, lower = made.shapes[0].bars
    assert upper == (-0.43, 0.86, pytest.approx(5.36), pytest.approx(44.64))
    assert lower == (0.57, 0.86, 50, pytest.approx(44.64))
    assert made.shapes[0].path.startswith("M-0.43 5.36h0.86v44.64h-0.86z")


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [(0, 9, [0, 2.5, 5, 7.5]), (-1, 1, [-1, -0.5, 0, 0.5, 1]), (0, 0.03, [0, 0.01, 0.02, 0.03])],
)
def test_ticks_are_round_numbers_inside_the_range(low, high, expected):
    assert ticks(Span(low, high), 4) == pytest.approx(expected)


def test_marks_tell_their_value_and_interval_and_leave_out_what_is_undefined():
    own = series([0, 1], [2.0, math.nan], low=[1.0, math.nan], high=[4.0, math.nan])
    made = drawn(Chart("ERR", ChartKind.MARKS, [own], names=["lit", "shadow"]))
    first, second = made.rows
    assert [mark.text for mark in first.marks] == ["a: 2.00 % (1.00 to 4.00)"]
    assert second.marks == []


def test_a_level_lies_across_with_its_interval_and_belongs_to_the_values():
    chart = Chart("change", ChartKind.BARS, [series([0], [2.0])], level=Level("mean", 1, 0.5, 3))
    made = drawn(chart)
    assert made.y.high > 3
    top, height = made.band
    assert made.level == pytest.approx(100 * (1 - 1 / made.y.high), abs=0.01)
    assert height == pytest.approx(100 * 2.5 / made.y.high, abs=0.02)
    assert top + height > made.level > top
    assert made.values()["level"] == {"name": "mean", "value": 1, "low": 0.5, "high": 3}
    plain = drawn(Chart("change", ChartKind.BARS, [series([0], [2.0])], level=Level("mean", 1)))
    assert plain.band is None
    assert plain.values()["level"]["low"] is None


def test_points_have_intervals_and_names_without_room_for_them():
    own = series([0, 1], [2.0, 1.0], low=[1.0, math.nan], high=[3.0, math.nan])
    made = drawn(Chart("change", ChartKind.POINTS, [own], names=["a", "b"], y_range=(0, 4)))
    (shape,) = made.shapes
    assert shape.intervals == "M0 75V25"
    assert shape.dots == "M0 50h0M1 75h0"
    assert made.x_ticks == []
    assert made.values()["series"][0]["high"] == [3.0, None]


def test_positions_of_their_own_have_a_range_of_their_own():
    made = drawn(lines(series([40.0, 90.0], [1, 1]), across="recall", x_range=(40, 101)))
    assert made.x == Span(40, 101)
    assert [tick.text for tick in made.x_ticks] == ["40", "60", "80", "100"]
    assert span_of_frames([made.chart]) == Span(0, 1)


def test_of_a_long_drive_neighbours_are_averaged():
    long = thinned(series(list(range(10)), [float(n) for n in range(10)]), most=5)
    assert long.x == [0, 2, 4, 6, 8]
    assert long.y == [0.5, 2.5, 4.5, 6.5, 8.5]
    assert thinned(long, most=5) is long


# --- Intervals that are cut -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("low", "high", "cut", "ends"),
    [
        (1.0, 3.0, "", (25.0, 75.0)),
        (-9.0, 3.0, "left", (0.0, 75.0)),
        (1.0, 9.0, "right", (25.0, 100.0)),
        (-9.0, 9.0, "both", (0.0, 100.0)),
    ],
)
def test_an_interval_beyond_the_chart_ends_in_an_arrow_at_its_edge(low, high, cut, ends):
    own = series([0], [2.0], low=[low], high=[high])
    made = drawn(Chart("change", ChartKind.MARKS, [own], names=["a"], y_range=(0.0, 4.0)))
    (mark,) = made.rows[0].marks
    assert (mark.cut, (mark.low, mark.high)) == (cut, ends)
    assert f"({low:.2f} to {high:.2f})" in mark.text


# --- Paper ----------------------------------------------------------------------------------------


def on_paper(chart):
    """What Typst is given, as JSON has it."""
    return json.loads(json.dumps(drawn(chart).on_paper(), allow_nan=False))


def test_on_paper_places_are_percent_from_the_left_and_the_top():
    look = Look("#0072B2", "dashed", "square", hollow=True)
    made = on_paper(lines(series([0, 10], [0.0, 50.0], look), across="recall", y_range=(0, 100)))
    (shape,) = made["shapes"]
    assert shape["runs"] == [[[0, 100], [100, 50]]]
    assert shape["marks"] == [[0, 100], [100, 50]]
    assert shape["look"] == {
        "colour": "#0072B2",
        "dash": "dashed",
        "mark": "square",
        "hollow": True,
    }
    assert made["across"] == "recall, %"


def test_a_mark_outside_of_the_axes_is_not_on_paper():
    made = on_paper(lines(series([0, 10], [5.0, 50.0]), across="recall", y_range=(40, 60)))
    assert made["shapes"][0]["marks"] == [[100, 50]]


def test_bars_and_intervals_are_on_paper():
    bars = Chart("change", ChartKind.BARS, [series([0, 1], [10.0, -10.0])], unit="pp")
    assert len(on_paper(bars)["shapes"][0]["bars"]) == 2
    own = series([0], [2.0], low=[1.0], high=[3.0])
    points = Chart("change", ChartKind.POINTS, [own], names=["a"], y_range=(0, 4))
    assert on_paper(points)["shapes"][0]["ends"] == [[50, 75, 25]]


# --- Heat maps ------------------------------------------------------------------------------------


def heat(values):
    return drawn(HeatMap("FP of a", np.array(values), 20.0, VERMILLION))


def cells(values):
    """The numbers as a script reads them."""
    runs = heat(values).values()["runs"]
    return [each for n, value in zip(runs[::2], runs[1::2], strict=True) for each in [value] * n]


def test_every_cell_is_told_in_tenths_and_what_is_not_known_as_none():
    values = [[0.0, 0.0, 12.34], [np.nan, 0.04, 20.0]]
    assert heat(values).values()["size"] == [3, 2]
    assert cells(values) == [0, 0, 123, -1, 0, 200]


def test_equal_numbers_in_a_row_are_told_once():
    assert heat(np.zeros((120, 160))).values()["runs"] == [120 * 160, 0]


def test_the_picture_goes_from_white_to_the_darkest_shade():
    content = heat([[0.0, 20.0], [np.nan, 10.0]]).chart.picture()
    picture = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    white, dark, unknown, middle = (tuple(each.tolist()) for each in picture.reshape(-1, 3))
    assert (white, dark, unknown) == ((255, 255, 255), MOST_ERRORS, NEVER_LABELLED)
    assert np.allclose(middle, VERMILLION, atol=2)

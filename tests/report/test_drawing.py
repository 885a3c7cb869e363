"""Where the parts of a chart lie, for a page and for paper."""

import math

import pytest

from roadeval.report.chart import Chart, ChartKind, Level, Look, Series, thin
from roadeval.report.drawing import AxisRange, place_chart, range_of_frames, ticks, values


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

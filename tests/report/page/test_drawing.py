"""Charts as plain SVG."""

import math

import pytest

from roadeval.report.chart import Chart, ChartKind, Level, Series, thinned
from roadeval.report.page.drawing import drawn, span_of_frames
from roadeval.report.page.scales import Span, ticks


def series(x, y, **more):
    return Series("a", "#0072B2", x, y, **more)


def lines(*drawn_series, **more):
    return Chart("ERR", ChartKind.LINES, drawn_series, **more)


def test_a_line_goes_through_its_points_from_the_top_down():
    made = drawn(lines(series([0, 10], [0.0, 100.0])), Span(0, 10))
    (shape,) = made.shapes
    assert made.y == Span(0.0, 106.0)
    assert shape.path == "M0 1000L10 56.6"


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
    assert drawn(lines()).view


def test_bars_stand_on_zero():
    chart = Chart("change", ChartKind.BARS, [series([0, 1], [10.0, -10.0])], unit="pp")
    made = drawn(chart)
    assert made.zero == "50"
    first, second = made.shapes[0].path.split("z")[:2]
    assert "M-0.43 500V" in first
    assert "500V" in second


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
    top, height = map(float, made.band)
    assert float(made.level) == pytest.approx(1000 * (1 - 1 / made.y.high), abs=0.01)
    assert height == pytest.approx(1000 * 2.5 / made.y.high, abs=0.02)
    assert top + height > float(made.level) > top
    assert made.values()["level"] == {"name": "mean", "value": 1, "low": 0.5, "high": 3}
    plain = drawn(Chart("change", ChartKind.BARS, [series([0], [2.0])], level=Level("mean", 1)))
    assert plain.band is None
    assert plain.values()["level"]["low"] is None


def test_points_have_intervals_and_names_without_room_for_them():
    own = series([0, 1], [2.0, 1.0], low=[1.0, math.nan], high=[3.0, math.nan])
    made = drawn(Chart("change", ChartKind.POINTS, [own], names=["a", "b"], y_range=(0, 4)))
    (shape,) = made.shapes
    assert shape.intervals == "M0 750V250"
    assert shape.marks == "M0 500h0M1 750h0"
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


def test_only_what_is_said_to_be_is_dashed_or_hollow():
    plain, other = series([0, 1], [1, 2]), series([0, 1], [1, 2], dashed=True, hollow=True)
    assert (plain.dashed, plain.hollow) == (False, False)
    shapes = drawn(lines(plain, other)).shapes
    assert [(shape.series.dashed, shape.series.hollow) for shape in shapes] == [
        (False, False),
        (True, True),
    ]

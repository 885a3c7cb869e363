"""The numbers of figures with a row a drive."""

from roadeval.report.chart import ChartKind
from roadeval.report.figures.forest import NAMED, ForestMean, ForestRow
from roadeval.report.figures.row_values import MEAN, forest

OVER = ForestMean(0.01, -0.01, 0.03)


def drives(count):
    return [ForestRow(f"drive_{n}", None, n / 1000, (n - 1) / 1000, None) for n in range(count)]


def test_few_drives_have_a_row_each_and_the_mean_the_last():
    (chart,) = forest(drives(3), OVER, "change")
    assert chart.kind is ChartKind.MARKS
    assert chart.names == ["drive_2", "drive_1", "drive_0", MEAN]


def test_many_drives_are_points_from_the_worst_on_and_the_mean_lies_across():
    (chart,) = forest(drives(NAMED + 1), OVER, "change")
    assert chart.kind is ChartKind.POINTS
    assert len(chart.names) == NAMED + 1
    assert chart.names[0] == f"drive_{NAMED}"
    assert (chart.level.value, chart.level.low, chart.level.high) == (1.0, -1.0, 3.0)
    worse, better = chart.series
    assert (worse.x[0], worse.y[0], better.x) == (0, NAMED / 10, [NAMED])

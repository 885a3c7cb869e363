"""Which charts are made of which rows: each number where it belongs, in its own look."""

import pandas as pd

from roadeval.evaluation.stats.difference import Difference
from roadeval.report.chart import ChartKind, looks_of_results
from roadeval.report.charts import standard as charts
from roadeval.report.charts.standard import DRAWN, MEAN

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

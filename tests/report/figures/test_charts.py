"""Charts of the PDF: each number where it belongs, in its own colour."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex

from roadeval.data import colours
from roadeval.evaluation.comparison_result import MaskComparison
from roadeval.evaluation.metrics import METRICS, SHORT
from roadeval.evaluation.uncertainty import Difference
from roadeval.report.figures import charts, values
from roadeval.report.figures.heatmaps import heatmap
from roadeval.report.findings import ErrorHeatmap

FILTERED, UNFILTERED = (colours.hex_of(c).lower() for c in (colours.FILTERED, colours.UNFILTERED))


def bars(figure):
    """Height and colour of each bar."""
    return [
        (round(bar.get_height(), 6), to_hex(bar.get_facecolor())) for bar in figure.axes[0].patches
    ]


def test_a_frame_that_got_worse_has_the_colour_of_the_other_variant():
    frames = pd.DataFrame({"ERR": [0.1, -0.2]}, index=[7, 9])
    mean = {"mean": -0.05, "low": None}
    figure = charts.difference(frames, "filtered", "unfiltered", mean)
    assert bars(figure) == [(10.0, UNFILTERED), (-20.0, FILTERED)]
    upper, lower = sorted(figure.axes[0].texts, key=lambda text: -text.get_position()[1])
    assert (upper.get_text(), lower.get_text()) == ("filtered worse", "filtered better")


def test_many_frames_are_drawn_as_means_of_neighbours():
    changes = np.tile([0.1, np.nan, 0.3, np.nan], charts.BARS)
    frames = pd.DataFrame({"ERR": changes})
    mean = {"mean": 0.2, "low": 0.1, "high": 0.3}
    figure = charts.difference(frames, "filtered", "unfiltered", mean)
    # The last patch is the interval.
    assert bars(figure)[:-1] == [(20.0, UNFILTERED)] * charts.BARS
    # A bar of four frames stands over the middle of them.
    first, last = figure.axes[0].patches[0], figure.axes[0].patches[-2]
    middles = [bar.get_x() + bar.get_width() / 2 for bar in (first, last)]
    assert middles == pytest.approx([1.5, len(frames) - 2.5])


def test_a_region_has_its_error_rate_left_and_its_share_of_the_errors_right():
    row = {"variant": "filtered", "region": "lit", "pixels": 0.5, "ERR": 0.1, "errors": 0.3}
    figure = charts.regions(pd.DataFrame([row]), ["filtered"], {"lit": "in light"})
    left, right = figure.axes
    assert left.lines[0].get_xdata() == pytest.approx([10])
    assert right.lines[0].get_xdata() == pytest.approx([30])
    assert right.patches[0].get_width() == pytest.approx(50)
    assert left.get_xlim()[0] == right.get_xlim()[0] == 0


def test_each_rate_of_the_stages_has_its_own_axes_and_the_baseline_is_a_level():
    rates = {"ERR": 0.1, "FPR": 0.2, "FNR": None}
    totals = {"filtered": {"svm": rates, "post": rates}, "blind": {"post": rates}}
    figure = charts.stages(totals)
    for ax, value in zip(figure.axes, (10, 20, np.nan), strict=True):
        line, _, level = ax.lines
        np.testing.assert_allclose(line.get_ydata(), [value, value])
        np.testing.assert_allclose(level.get_ydata(), [value, value])


def test_a_fourth_rate_stands_in_a_row_of_its_own_and_need_not_begin_at_zero(monkeypatch):
    monkeypatch.setattr(charts, "SHORT", SHORT | {"ACC": METRICS["ACC"]})
    rates = {"ERR": 0.1, "FPR": 0.2, "FNR": 0.3, "ACC": 0.9}
    figure = charts.stages({"filtered": {"svm": rates, "post": rates | {"ACC": 0.95}}})
    *above, below = figure.axes
    assert [ax.get_title(loc="left") for ax in figure.axes] == [f"{rate}, %" for rate in rates]
    assert {ax.get_gridspec().nrows for ax in figure.axes} == {2}
    assert [ax.get_ylim()[0] for ax in above] == [0, 0, 0]
    assert 80 < below.get_ylim()[0] < 90


def test_false_positives_are_left_and_false_negatives_right_in_their_colours():
    heat = ErrorHeatmap("filtered", np.array([[0.1, np.nan]]), np.array([[0.2, 0.4]]))
    left, right, *_ = heatmap([heat]).axes
    for ax, share, colour in ((left, heat.fp, colours.FP), (right, heat.fn, colours.FN)):
        (image,) = ax.images
        np.testing.assert_allclose(np.ma.filled(image.get_array(), np.nan), 100 * share)
        assert image.get_cmap()(0.5)[:3] == pytest.approx(np.array(colour) / 255, abs=0.01)
    assert left.get_title(loc="left").startswith("FP")


def test_equal_shades_are_equal_shares_in_every_map_of_a_report_and_of_a_page():
    low, high = (
        ErrorHeatmap(n, np.array([[e]]), np.array([[e]])) for n, e in (("a", 0.1), ("b", 0.4))
    )
    left, *_ = heatmap([low], [low, high]).axes
    assert left.images[0].get_clim() == pytest.approx((0, 40))
    maps = [*values.heat([low], [low, high])]
    assert [each.title for each in maps] == ["FP of a", "FN of a"]
    assert [each.top for each in maps] == pytest.approx([40, 40])
    assert maps[0].most == 10


def test_the_covered_share_is_in_percent():
    figure = charts.coverage(pd.DataFrame({"filtered": [0.25, 0.5]}, index=[3, 8]))
    (line,) = figure.axes[0].lines
    assert line.get_ydata().tolist() == [25, 50]
    assert line.get_xdata().tolist() == [3, 8]


def test_a_comparison_shows_changes_with_their_intervals_and_levels_without():
    change = Difference(0.01, -0.02, 0.04, 0.95, 0.5, 12, None)
    unsure = replace(change, low=None, high=None)
    new = {"ERR": 0.1, "FPR": 0.2, "FNR": 0.3}
    changes = {"ERR": change, "FPR": unsure, "FNR": change}
    row = MaskComparison("new", "filtered", "post", True, 12, {}, new, changes)
    first, second, _ = charts.forest([row]).axes
    mean, interval, _ = first.lines
    assert mean.get_xdata() == pytest.approx([1])
    assert interval.get_xdata() == pytest.approx([-2, 4])
    assert len(second.lines) == 2
    levels = [ax.lines[0] for ax in charts.levels([row]).axes]
    assert [line.get_xdata()[0] for line in levels] == pytest.approx([10, 20, 30])
    # The mark of a rate of 0 lies on the edge of its axes, which must not cut it in two.
    assert not any(line.get_clip_on() for line in levels)


def test_each_result_has_a_line_of_its_own_from_top_to_bottom():
    rates = {"ERR": 0.1, "FPR": 0.2, "FNR": 0.3}
    rows = [MaskComparison(n, "filtered", "post", True, 12, {}, rates, {}) for n in ("old", "new")]
    first = charts.levels(rows).axes[0]
    assert first.get_ylim() == (1.5, -0.5)
    assert [label.get_text() for label in first.get_yticklabels()] == ["old", "new"]


def test_a_filter_without_effect_has_an_axis_with_numbers_that_differ():
    table, none = pd.DataFrame({"ERR": np.zeros(12)}), dict.fromkeys(("mean", "low", "high"), 0.0)
    (ax,) = charts.difference(table, "filtered", "unfiltered", none).axes
    assert ax.get_ylim() == (-charts.LEAST, charts.LEAST)
    names = [label.get_text() for label in ax.get_yticklabels()]
    assert len(set(names)) == len(names)


def test_stages_of_variants_stand_in_the_order_of_their_chains():
    rates = dict.fromkeys(SHORT, 0.1)
    chains = {"filtered": ("svm", "post"), "robust": ("trees", "post")}
    totals = {variant: dict.fromkeys(chain, rates) for variant, chain in chains.items()}
    names = [label.get_text() for label in charts.stages(totals).axes[0].get_xticklabels()]
    assert names == ["svm", "trees", "post"]
    assert values.stages(totals)[0].names == names

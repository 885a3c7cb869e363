"""Layout of charts: every word has its place, however long the names are and however many."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pandas as pd
import pytest
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg

from roadeval.evaluation.comparison_result import MaskComparison
from roadeval.evaluation.metrics import METRICS, SHORT
from roadeval.evaluation.uncertainty import Difference
from roadeval.report.figures import charts, layout
from roadeval.report.figures.fig2_masks import road_masks
from roadeval.report.figures.fig3b_fp_fn_rate import fp_fn_rate
from roadeval.report.figures.figure import ExampleFrame, FigureData
from roadeval.report.figures.heatmaps import heatmap
from roadeval.report.figures.legend import LegendStyle
from roadeval.report.figures.style import RC
from roadeval.report.figures.thresholds import curves
from roadeval.report.findings import ErrorHeatmap
from tests.report.making import NO_WINDOWS, figure_data
from tests.report.sections.test_thresholds import findings as curves_of

LONG = "trained_on_every_drive_of_the_summer_and_adapted_to_this_one_a"
VARIANTS = (
    ("filtered",),
    ("filtered", "unfiltered", LONG, f"{LONG}b", "blind"),
    ("filtered", "unfiltered", "robust", "gated_by_confidence", "net", "net_at_half_size", "blind"),
)
RATES = {"ERR": 0.1, "FPR": 0.02, "FNR": 0.3, "ACC": 0.99999}
CHANGE = Difference(0.01, -0.02, 0.04, 0.95, 0.5, 12, None)


@pytest.fixture(autouse=True)
def as_in_a_report():
    with rc_context(RC):
        yield


def words(figure):
    """What is written in a figure, each with its box."""
    FigureCanvasAgg(figure).draw()
    texts = [*figure.texts, *(text for each in figure.legends for text in each.get_texts())]
    for ax in figure.axes:
        texts += [*ax.texts, ax.title, ax._left_title, ax.xaxis.label, ax.yaxis.label]
        for axis in (ax.xaxis, ax.yaxis):
            low, high = sorted(axis.get_view_interval())
            texts += [
                tick.label1 for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high
            ]
            texts += [axis.get_offset_text()]
    shown = [text for text in texts if text.get_text() and text.get_visible()]
    return [(text, text.get_window_extent()) for text in shown]


def assert_readable(figure):
    """No word leaves the figure, touches another one, or is covered by the legend."""
    found = words(figure)
    assert found
    inside = figure.bbox.padded(0.5)
    for text, box in found:
        assert inside.containsx(box.x0), text
        assert inside.containsx(box.x1), text
        assert inside.containsy(box.y0), text
        assert inside.containsy(box.y1), text
    for (one, here), (other, there) in combinations(found, 2):
        turned = one.get_rotation() == other.get_rotation() == layout.TILT
        if turned and here.overlaps(there):
            # Boxes of turned names do; their lines of text are this far from each other.
            apart = abs(here.x1 - there.x1) * np.sin(np.deg2rad(layout.TILT))
            assert apart >= layout.SMALL * figure.dpi / layout.INCH, (one, other)
        else:
            assert not here.overlaps(there), (one, other)
    for legend, ax in ((each, ax) for each in figure.legends for ax in figure.axes):
        assert not legend.get_window_extent().overlaps(ax.get_window_extent())


def totals(variants, stages=("similarity", "svm", "post")):
    return {v: dict.fromkeys(stages[-1:] if v == "blind" else stages, RATES) for v in variants}


def heat(variant, rows, columns):
    return ErrorHeatmap(variant, np.full((rows, columns), 0.1), np.full((rows, columns), 0.2))


def region_rows(variants, titles):
    return pd.DataFrame(
        [
            {"variant": name, "region": region, "pixels": 0.5, "ERR": 0.1, "errors": 0.9}
            for name in variants
            for region in titles
        ]
    )


def compared(names, variants, change=CHANGE):
    changes = dict.fromkeys(RATES, change)
    return [
        MaskComparison(name, variant, "post", True, 12, {}, RATES, changes)
        for name in names
        for variant in variants
    ]


@pytest.mark.parametrize("variants", VARIANTS)
def test_the_rates_of_the_stages_are_readable(variants):
    assert_readable(charts.stages(totals(variants)))


@pytest.mark.parametrize("count", [1, 3, 9])
def test_the_names_of_stages_are_readable(count):
    stages = [f"{name}_of_the_stage" for name in "abcdefghi"[:count]]
    assert_readable(charts.stages(totals(["filtered", "blind"], stages)))


def test_a_fourth_rate_in_a_row_of_its_own_is_readable(monkeypatch):
    monkeypatch.setattr(charts, "SHORT", SHORT | {"ACC": METRICS["ACC"]})
    stages = ["a_long_name", "another_long_name", "the_longest_name_of_them_all"]
    assert_readable(charts.stages(totals(["filtered"], stages)))
    assert_readable(charts.levels(compared(["old", "new"], ["filtered"])))
    assert_readable(charts.forest(compared(["new"], ["filtered"])))


@pytest.mark.parametrize("variants", VARIANTS)
def test_regions_are_readable(variants):
    titles = ["lit", "dark", f"where the sun is low, {LONG}"]
    names = {title: title for title in titles}
    assert_readable(charts.regions(region_rows(variants, titles), variants, names))


@pytest.mark.parametrize(("scale", "frames"), [(1e-7, 12), (0.001, 1), (1, 100_000)])
def test_a_difference_is_readable(scale, frames):
    changes = scale * np.sin(np.arange(1.0, frames + 1))
    table = pd.DataFrame({"ERR": changes}, index=range(frames))
    mean = dict.fromkeys(("mean", "low", "high"), changes.mean())
    assert_readable(charts.difference(table, "filtered", "unfiltered", mean))


@pytest.mark.parametrize("variants", VARIANTS)
def test_the_coverage_of_a_drive_without_truth_is_readable(variants):
    table = pd.DataFrame({name: [0.2, 0.9, 0.4] for name in variants}, index=[0, 70, 100_000])
    assert_readable(charts.coverage(table))


@pytest.mark.parametrize("variants", VARIANTS)
@pytest.mark.parametrize("size", [(20, 64), (64, 36)])
def test_heat_maps_are_readable_and_have_the_shape_of_the_image(variants, size):
    figure = heatmap([heat(name, *size) for name in variants])
    assert_readable(figure)
    for ax in figure.axes[: 2 * len(variants)]:
        box = ax.get_window_extent()
        assert box.height / box.width == pytest.approx(size[0] / size[1])


@pytest.mark.parametrize("variants", VARIANTS)
def test_a_comparison_is_readable(variants):
    names = ["new", f"2026-07-14_{LONG}"]
    assert_readable(charts.levels(compared(names, variants)))
    assert_readable(charts.forest(compared(names, variants)))
    wide = replace(CHANGE, low=-0.9, high=0.95)
    assert_readable(charts.forest(compared(names, variants, wide)))


@pytest.mark.parametrize("variants", VARIANTS)
def test_the_legend_of_the_paper_s_figures_is_readable(variants):
    rows = [
        {"window": row, "first_frame": 10 * row, "last_frame": 10 * row + 9, "frames": 10}
        | {"variant": name, "stage": "post"}
        | RATES
        for row in range(9)
        for name in variants
    ]
    assert_readable(fp_fn_rate(figure_data("drive", pd.DataFrame(rows))))


@pytest.mark.parametrize("variants", VARIANTS)
def test_the_legend_of_the_curves_over_thresholds_is_readable(variants):
    found = curves_of().figure_data.thresholds
    (mask,) = found.totals["blind"].values()
    totals = {name: {"post": mask} for name in variants}
    assert_readable(curves(FigureData("drive", NO_WINDOWS, (), replace(found, totals=totals))))


@pytest.mark.parametrize("variants", VARIANTS)
@pytest.mark.parametrize("size", [(20, 64), (64, 36)])
def test_the_pictures_of_figure_2_have_names_and_the_shape_of_the_image(variants, size):
    image, mask = np.full((*size, 3), 90, np.uint8), np.ones(size, np.uint8)
    example = ExampleFrame(999, image, mask, dict.fromkeys(variants, mask))
    figure = road_masks(FigureData("drive", NO_WINDOWS, [example]))
    assert_readable(figure)
    for picture in figure.artists:
        assert picture.box.height / picture.box.width == pytest.approx(size[0] / size[1])


def test_a_width_is_that_of_the_letters():
    assert layout.width_of("") == 0
    assert layout.width_of("mm", 8) == pytest.approx(2 * layout.width_of("m", 8), abs=0.1)
    assert layout.width_of("m", 16) == pytest.approx(2 * layout.width_of("m", 8), abs=0.5)
    assert layout.width_of("$_1$") > layout.width_of("1")


@pytest.mark.parametrize(
    ("letters", "expected"), [(9, "abcdefghi"), (8, "abcd…ghi"), (7, "abc…ghi"), (3, "a…i")]
)
def test_a_long_name_keeps_both_ends(letters, expected):
    assert layout.short("abcdefghi", letters) == expected


def test_a_name_is_shortened_as_far_as_it_must_be():
    name, cut = "m" * 12, "mmmm…mmm"
    assert layout.fitting(name, layout.width_of(name)) == name
    assert layout.fitting(name, layout.width_of(cut)) == cut
    assert layout.fitting(name, 1) == "m…m"


def test_a_legend_has_as_many_columns_as_have_room():
    style = LegendStyle(columns=3)
    labels = ["one", "two", "three", "four"]
    assert style.arguments(labels, 500)["ncols"] == 3
    assert style.lines(labels, 500) == 2
    assert style.lines(labels, 150) == 2
    assert style.lines(labels, 100) == 4
    assert style.lines(["m" * 90, "two"], 500) == 2


def test_names_of_stages_are_turned_where_they_have_no_room():
    names = ["similarity", "svm", "post"]
    (ax, *_) = charts.stages(totals(["filtered"], names)).axes
    assert {label.get_rotation() for label in ax.get_xticklabels()} == {0}
    (ax, *_) = charts.stages(totals(["filtered"], [f"{name}_as_printed" for name in names])).axes
    assert {label.get_rotation() for label in ax.get_xticklabels()} == {layout.TILT}

"""The forest plot."""

import numpy as np
import pytest

from roadeval.report.figures.files import svg
from roadeval.report.figures.forest import (
    EXTREMES,
    NAMED,
    ForestMean,
    ForestRow,
    cut,
    forest,
    limits,
)
from tests.golden.drawings import described

MEAN = ForestMean(0.01, 0.005, 0.015)


def rows(count, group=None):
    return [
        ForestRow(f"drive_{i:04}", group, 0.02 * (i / count - 0.4), -0.01, 0.015)
        for i in range(count)
    ]


def drawn(figure):
    (ax,) = figure.axes
    return ax, [label.get_text() for label in ax.get_yticklabels()]


def test_the_worst_drive_is_above_and_the_mean_below_all():
    ax, names = drawn(forest(rows(3), MEAN, "pp"))
    assert names == ["drive_0002", "drive_0001", "drive_0000", "mean over drives"]
    assert ax.get_ylim()[0] > ax.get_ylim()[1]
    (diamond,) = (patch for patch in ax.patches if len(patch.get_xy()) == 5 and patch.zorder == 4)
    x = diamond.get_xy()[:, 0]
    assert (x.min(), x.max()) == pytest.approx((0.5, 1.5))


def test_a_drive_has_its_interval_and_one_without_has_none():
    ax, _ = drawn(forest([ForestRow("a", None, 0.01, 0.005, 0.03)], MEAN, "pp"))
    (line,) = (line for line in ax.lines if len(line.get_xdata()) == 3)
    assert line.get_xdata()[:2] == pytest.approx([0.5, 3.0])
    ax, _ = drawn(forest([ForestRow("a", None, 0.01, None, None)], MEAN, "pp"))
    assert not [line for line in ax.lines if len(line.get_xdata()) == 3]


def test_a_drives_mark_stands_at_its_mean_in_percent():
    ax, _ = drawn(forest([ForestRow("a", None, 0.01, -0.01, 0.03)], MEAN, "pp"))
    marks = [line.get_xdata() for line in ax.lines if line.get_marker() == "o"]
    assert np.concatenate(marks) == pytest.approx([1.0])


@pytest.mark.parametrize("count", [3, NAMED + 1])
def test_a_drives_mark_has_no_edge_that_would_make_it_larger(count):
    ax, _ = drawn(forest(rows(count), MEAN, "pp"))
    marks = [line for line in ax.lines if line.get_marker() == "o"]
    assert {line.get_markeredgewidth() for line in marks} == {0}


def test_groups_stand_at_the_edge():
    ax, _ = drawn(forest(rows(2, "monday"), MEAN, "pp"))
    assert [text.get_text() for text in ax.texts[:2]] == ["monday", "monday"]


DRAWN = """\
x from -1.1 to 1.6: \N{MINUS SIGN}1.5 | \N{MINUS SIGN}1.0 | \N{MINUS SIGN}0.5 | 0.0 | 0.5 | \
1.0 | 1.5 | 2.0
x grid: color #b0b0b0, linestyle -, linewidth 0.8, markerfacecolor #b0b0b0
y from 2.7 to -0.7: drive_0001 | drive_0000 | mean over drives
box 0 1.5 1 1.2: facecolor #e3e3e373, linestyle solid, linewidth 0.0
text 'a group of\N{HORIZONTAL ELLIPSIS}y letters' at 4 0, size 7
text 'a group of\N{HORIZONTAL ELLIPSIS}y letters' at 4 0, size 7
text 'better' at 0 1, size 8
text 'worse' at 1 1, size 8"""


def test_all_but_the_lines_is_drawn_as_it_was():
    lines = described(forest(rows(2, "a group of very many letters"), MEAN, "pp")).splitlines()
    kept = [line.strip() for line in lines if line.startswith("    ")]
    assert "\n".join(line for line in kept if not line.startswith(("line", "xlabel"))) == DRAWN


def test_of_many_drives_only_the_extremes_are_named():
    _, names = drawn(forest(rows(NAMED), MEAN, "pp"))
    assert len(names) == NAMED + 1
    ax, names = drawn(forest(rows(NAMED + 1), MEAN, "pp"))
    assert names == ["mean over drives"]
    worst, best = (text.get_text() for text in ax.texts[:2])
    assert worst.splitlines()[0].startswith(f"drive_{NAMED:04} +")
    assert best.splitlines()[-1].startswith("drive_0000")
    assert len(worst.splitlines()) == EXTREMES


def test_without_an_interval_the_mean_is_a_mark():
    ax, _ = drawn(forest(rows(3), ForestMean(0.01, None, None), "pp"))
    assert [line.get_marker() for line in ax.lines].count("D") == 1


def test_one_huge_interval_does_not_hide_the_rest_and_is_counted():
    many = [*rows(20), ForestRow("huge", None, 0.0, -0.9, 0.9)]
    low, high = limits(many, MEAN)
    assert (low, high) == pytest.approx((-1.1, 1.6))
    assert cut(many, MEAN) == 1


def test_a_cut_interval_does_not_widen_the_axes_when_it_is_drawn():
    many = [*rows(20), ForestRow("huge", None, 0.0, -0.9, 0.9)]
    ax, _ = drawn(forest(many, MEAN, "x"))
    ax.autoscale_view()
    assert ax.get_xlim() == limits(many, MEAN)


def test_thousands_of_drives_make_a_small_picture():
    rng = np.random.default_rng(0)
    many = [
        ForestRow(str(i), None, m, m - 0.01, m + 0.01) for i, m in enumerate(rng.normal(size=3000))
    ]
    assert len(svg(lambda: forest(many, MEAN, "pp")).content) < 1_500_000

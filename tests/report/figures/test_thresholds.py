"""The figure of the curves over thresholds."""

import pytest

from roadeval.report.figures.thresholds import curves
from tests.report.sections.test_thresholds import findings


@pytest.fixture(scope="module")
def axes():
    return curves(findings().figure_data).axes


def test_the_diagonal_of_reliability_is_one(axes):
    _, _, reliability = axes
    assert reliability.get_xlim() == reliability.get_ylim() == (-1, 101)
    (line,) = (line for line in reliability.lines if line.get_linestyle() == "--")
    assert [*line.get_xdata()] == [*line.get_ydata()] == [0, 100]


def test_the_panels_stand_side_by_side_and_fill_the_width(axes):
    places = [ax.get_position() for ax in axes]
    assert sum(place.width for place in places) > 0.7
    assert places[0].x1 < places[1].x0 < places[1].x1 < places[2].x0


def test_the_axes_begin_and_end_where_the_masks_lie(axes):
    recall, roc, _ = axes
    # Half of the room at least; the FPR of the mask is 25 %.
    assert (recall.get_xlim(), recall.get_ylim()) == ((50, 101), (50, 101))
    assert roc.get_xlim() == pytest.approx((-0.3, 30))
    assert roc.get_ylim() == recall.get_xlim()

"""The numbers of a drive's figures as charts."""

import numpy as np

from roadeval.report.figures.values import over_frames
from tests.evaluation.making import a_table, rows_of


def test_lines_go_along_the_drive_whatever_the_table_s_order():
    rows = rows_of(a_table({("net", "svm"): [90, 90, 90], ("net", "post"): [10, 20, 30]}))
    (chart,) = over_frames(rows.take(np.array([4, 3, 2, 5, 0, 1])), ["ERR"])
    (line,) = chart.series
    assert [*line.x] == [0, 1, 2]
    assert [*line.y] == [10, 20, 30]

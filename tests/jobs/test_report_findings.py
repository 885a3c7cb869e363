"""What a report of a long drive shows of its windows."""

from types import SimpleNamespace

import pytest

from roadeval.jobs import report_findings
from tests.evaluation.making import a_table, rows_of


@pytest.mark.parametrize(("frames", "size", "rows"), [(50, 10, 5), (301, 20, 16)])
def test_a_long_drive_has_longer_windows_instead_of_more(frames, size, rows):
    table = a_table({("filtered", "post"): [10] * frames})
    result = SimpleNamespace(summary={}, frames=table, rows=rows_of(table), windows=[])
    windows, found = report_findings._windows(result)
    assert found == size
    assert len(windows) == rows
    assert windows["frames"].sum() == frames

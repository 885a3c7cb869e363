"""The report of a comparison: what its headings name."""

import pytest

from roadeval.evaluation.comparison.compare import DriveChange
from roadeval.report.comparison import changed_drives
from tests.evaluation.making import a_change, a_comparison, a_difference

WORSE = a_difference(1.2, 0.5, 2)


@pytest.mark.parametrize(
    ("result", "title"), [("net", "net differs from base"), ("new", "net changed")]
)
def test_drives_on_which_a_mask_differs_are_headed_by_the_two(result, title):
    row = DriveChange(result, "net", "post", "street", 12, 0.1, 0.2, WORSE, 0.01, changed=True)
    heading, _ = changed_drives(a_comparison(a_change(WORSE, "net", result), drives=(row,)))
    assert heading.text == f"Drives on which {title}, the surest first"

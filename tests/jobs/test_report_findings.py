"""What a report makes of a drive's tables."""

import pandas as pd
import pytest

from roadeval.report.findings import Findings
from roadeval.results.rows import as_arrays
from tests.evaluation.making import a_table, rows_of
from tests.report.making import some_findings


def findings(**tables):
    """Findings of a drive of some tables."""

    def table(name):
        return rows_of(tables[name]) if name in tables else as_arrays(name, ())

    return Findings("drive.rrd", some_findings().facts, table)


@pytest.mark.parametrize(("frames", "size", "rows"), [(50, 10, 5), (301, 20, 16)])
def test_a_long_drive_has_longer_windows_instead_of_more(frames, size, rows):
    windows = findings(frames=a_table({("filtered", "post"): [10] * frames})).windows
    assert set(windows["frames"][:-1]) == {size}
    assert len(windows) == rows
    assert windows["frames"].sum() == frames


def test_what_a_stage_changed_is_a_share_of_the_labelled_pixels():
    row = {"from_variant": "filtered", "to_variant": "filtered", "repaired": 1, "spoiled": 0}
    stages = {"from_stage": "svm", "to_stage": "post"}
    other = {"to_variant": "unfiltered"}
    changes = pd.DataFrame(
        [row | stages | {"N": 4}, row | stages | {"N": 0}, row | stages | {"N": 5} | other]
    )
    assert findings(changes=changes).changes == {("filtered", "post"): (0.25, 0)}


@pytest.mark.parametrize(("labelled", "known"), [(9, (3, 2, 9)), (0, None)])
def test_pixels_that_the_filter_changed_are_known_where_some_are_labelled(labelled, known):
    row = {"from_variant": "unfiltered", "to_variant": "filtered", "repaired": 3, "spoiled": 2}
    assert findings(changes=pd.DataFrame([row | {"N": labelled}])).pixels == known

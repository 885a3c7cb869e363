"""What a report of a long drive shows of its windows."""

from types import SimpleNamespace

import pandas as pd
import pytest

from roadeval.evaluation.score import Effect
from roadeval.jobs.results import report
from tests.evaluation.making import a_table, rows_of
from tests.report.making import some_findings


@pytest.mark.parametrize(("frames", "size", "rows"), [(50, 10, 5), (301, 20, 16)])
def test_a_long_drive_has_longer_windows_instead_of_more(frames, size, rows):
    table = a_table({("filtered", "post"): [10] * frames})
    facts = some_findings().facts
    result = SimpleNamespace(facts=facts, rows=rows_of(table), table=lambda _name: [])
    windows = report._windows(result)
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
    found = report._stage_changes(rows_of(changes))
    assert found == {("filtered", "post"): (0.25, 0)}


def test_pixels_that_changed_between_variants_are_known_where_some_are_labelled():
    row = {"from_variant": "unfiltered", "to_variant": "filtered", "repaired": 3, "spoiled": 2}

    def pixels(labelled):
        changes = rows_of(pd.DataFrame([row | {"N": labelled}]))
        effect = Effect("unfiltered", "post", "filtered", "post", final=True, rates={})
        rows = rows_of(a_table({("filtered", "post"): [1], ("unfiltered", "post"): [2]}))
        result = SimpleNamespace(facts=SimpleNamespace(effects=[effect]), rows=rows)
        (pair,) = report._paired(result, changes)
        return pair.pixels

    assert pixels(9) == (3, 2, 9)
    assert pixels(0) is None

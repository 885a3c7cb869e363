"""Rates over the drive: which number stands where, and which figures are shown."""

import numpy as np
import pandas as pd

from roadeval.report.blocks import Figure, ImageGrid, Table
from roadeval.report.images import ExampleFrame
from roadeval.report.sections.drive import over_drive
from tests.evaluation.making import rows_of
from tests.report.making import opened, plain_rows, rates, some_findings, the


def windows():
    rows = []
    for window, (first, last) in enumerate([(3, 12), (13, 13)]):
        place = {"window": window, "first_frame": first, "last_frame": last, "frames": 10}
        for variant, err in (("filtered", 0.01), ("unfiltered", 0.02), ("blind", 0.03)):
            own = rates(err + window / 10, 0.4 + err, 0.5 + err)
            rows.append(place | {"variant": variant, "stage": "post"} | own)
            rows.append(place | {"variant": variant, "stage": "svm"} | rates(0.99, 0.98, 0.97))
    return rows_of(pd.DataFrame(rows))


def test_a_row_of_example_pictures_is_the_camera_the_truth_and_a_mask_each():
    image, mask = np.zeros((2, 3, 3), np.uint8), np.zeros((2, 3), np.uint8)
    example = ExampleFrame(7, image, mask, {"filtered": mask, "unfiltered": mask})
    grid = the(ImageGrid, opened(over_drive(some_findings(examples=[example, example]))))
    assert grid.columns == 4
    assert len(grid.pictures) == 8


def test_the_paper_s_claims_stand_with_the_windows_that_bear_them_out():
    claims = {
        "filter_ERR": {"held": 2, "windows": 9, "short_held": 1, "short": 1},
        "post_ERR": {"held": 9, "windows": 9, "short_held": 0, "short": 1},
    }
    table = the(Table, opened(over_drive(some_findings(claims=claims))))
    assert table.columns == ["claim", "borne out by", "shorter, at the end"]
    assert [row[1:] for row in plain_rows(table)] == [["2 of 9", "1 of 1"], ["9 of 9", "0 of 1"]]


def test_no_column_for_shorter_windows_where_there_are_none():
    claims = {"filter_ERR": {"held": 2, "windows": 9, "short_held": 0, "short": 0}}
    findings = some_findings(claims=claims)
    table = the(Table, opened(over_drive(findings)))
    assert table.columns == ["claim", "borne out by"]


def test_the_figures_of_rates_follow_and_none_without_rates():
    blocks = opened(over_drive(some_findings(windows=windows())))
    captions = [block.caption for block in blocks if isinstance(block, Figure)]
    assert [caption.partition(":")[0] for caption in captions] == [
        "The paper's figure 3a",
        "The paper's figure 3b",
    ]
    assert not [*over_drive(some_findings())]

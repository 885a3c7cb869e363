"""Rates over the drive: which number stands where, and which figures are shown."""

import numpy as np

from roadeval.report.blocks import ImageGrid, Table
from roadeval.report.images import ExampleFrame
from roadeval.report.sections.drive import over_drive
from tests.report.making import opened, plain_rows, some_findings, the


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

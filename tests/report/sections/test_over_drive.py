"""Rates over the drive: which number stands where, and which figures are shown."""

import numpy as np
import pandas as pd

from roadeval.report.blocks import Figure, ImageGrid, KeepTogether, Table, Text
from roadeval.report.images import ExampleFrame
from roadeval.report.sections.drive import over_drive
from tests.evaluation.making import rows_of
from tests.report.making import plain_rows, rates, some_findings, the


def windows():
    rows = []
    for window, (first, last) in enumerate([(3, 12), (13, 13)]):
        place = {"window": window, "first_frame": first, "last_frame": last, "frames": 10}
        for variant, err in (("filtered", 0.01), ("unfiltered", 0.02), ("blind", 0.03)):
            own = rates(err + window / 10, 0.4 + err, 0.5 + err)
            rows.append(place | {"variant": variant, "stage": "post"} | own)
            rows.append(place | {"variant": variant, "stage": "svm"} | rates(0.99, 0.98, 0.97))
    return rows_of(pd.DataFrame(rows))


def test_each_window_has_the_final_masks_rates_and_the_last_line_is_the_whole():
    table, *_ = (b for b in over_drive(some_findings(windows=windows())) if isinstance(b, Table))
    assert table.columns == ["frames", *(("filtered", "unfiltered", "blind") * 4)]
    assert [title for title, _ in table.groups] == ["", "ERR, %", "FPR, %", "FNR, %", "ACC, %"]
    assert plain_rows(table) == [
        [
            "3–12",  # noqa: RUF001
            *("1.00", "2.00", "3.00", "41.00", "42.00", "43.00"),
            *("51.00", "52.00", "53.00", "99.00", "98.00", "97.00"),
        ],
        [
            "13",
            *("11.00", "12.00", "13.00", "41.00", "42.00", "43.00"),
            *("51.00", "52.00", "53.00", "89.00", "88.00", "87.00"),
        ],
        [
            "all",
            *("10.00", "15.00", "12.00", "11.00", "16.00", "13.00"),
            *("12.00", "17.00", "14.00", "90.00", "85.00", "88.00"),
        ],
    ]


def test_the_table_of_all_masks_and_rates_is_small_and_ruled_off_before_the_whole():
    table = the(Table, over_drive(some_findings(windows=windows())))
    assert table.small
    assert table.breaks == [2]


def test_a_row_of_example_pictures_is_the_camera_the_truth_and_a_mask_each():
    image, mask = np.zeros((2, 3, 3), np.uint8), np.zeros((2, 3), np.uint8)
    example = ExampleFrame(7, image, mask, {"filtered": mask, "unfiltered": mask})
    grid = the(ImageGrid, over_drive(some_findings(examples=[example, example])))
    assert grid.columns == 4
    assert len(grid.pictures) == 8


def test_many_variants_have_a_table_a_rate():
    totals = {name: {"post": rates(0.1)} for name in "abcd"}
    findings = some_findings(windows=windows(), totals=totals)
    tables = [block for block in over_drive(findings) if isinstance(block, Table)]
    assert [len(table.columns) for table in tables] == [5, 5, 5, 5]


def test_rows_of_another_length_than_the_papers_are_told():
    findings = some_findings(windows=windows(), window_size=20)
    (note,) = (block.text for block in over_drive(findings) if isinstance(block, Text))
    assert "Rows of 20 evaluated frames" in note
    assert "The paper's rows are of 10." in note


def test_a_short_last_row_is_told():
    table = windows()
    table = table.replace(frames=np.where(table["window"] == 1, 1, 10))
    (note,) = (b.text for b in over_drive(some_findings(windows=table)) if isinstance(b, Text))
    assert "The last row holds 1." in note


def test_a_variant_that_lacks_frames_makes_no_short_row():
    table = windows()
    lacking = (table["window"] == 1) & (table["variant"] == "filtered")
    table = table.replace(frames=np.where(lacking, 7, 10))
    (note,) = (b.text for b in over_drive(some_findings(windows=table)) if isinstance(b, Text))
    assert "The last row holds" not in note


def test_the_paper_s_claims_stand_with_the_windows_that_bear_them_out():
    claims = {
        "filter_ERR": {"held": 2, "windows": 9, "short_held": 1, "short": 1},
        "post_ERR": {"held": 9, "windows": 9, "short_held": 0, "short": 1},
    }
    blocks = the(KeepTogether, over_drive(some_findings(claims=claims))).blocks
    table = the(Table, blocks)
    assert table.columns == ["claim", "borne out by", "shorter, at the end"]
    assert [row[1:] for row in plain_rows(table)] == [["2 of 9", "1 of 1"], ["9 of 9", "0 of 1"]]
    words = " ".join(b.text for b in blocks if isinstance(b, Text))
    assert "gives no number for its figures 3a and 3b" in words


def test_no_column_for_shorter_windows_where_there_are_none():
    claims = {"filter_ERR": {"held": 2, "windows": 9, "short_held": 0, "short": 0}}
    findings = some_findings(claims=claims)
    table = the(Table, the(KeepTogether, over_drive(findings)).blocks)
    assert table.columns == ["claim", "borne out by"]


def test_the_figures_of_rates_follow_and_none_without_rates():
    captions = [
        b.caption for b in over_drive(some_findings(windows=windows())) if isinstance(b, Figure)
    ]
    assert [caption.partition(":")[0] for caption in captions] == [
        "The paper's figure 3a",
        "The paper's figure 3b",
    ]
    assert not [block for block in over_drive(some_findings()) if isinstance(block, Figure)]

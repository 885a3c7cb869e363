"""The frames of compared results on a page."""

from dataclasses import replace

import numpy as np

from roadeval.evaluation.comparison import Side, compare
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.jobs.results.compare import Compared, browsed, over_drive
from tests.evaluation.making import a_part


def a_side(label, masks):
    return Side(label, [a_part(masks)])


def page_of(base, new):
    """What the page tells of the frames of two results without pictures."""
    sides = [a_side("base", base), a_side("new", new)]
    compared = Compared(compare(sides, EvaluationSettings()), (), tuple(sides), {})
    return browsed(compared, lambda _: 0)


def test_frames_that_both_results_have_stand_in_order_with_both_rates():
    found = page_of({("net", "svm"): [9] * 12, ("net", "post"): [1] * 12}, {("net", "post"): [3]})
    assert found.variants == ["base: net", "new: net"]
    assert [frame.frame for frame in found.rows] == [0]
    assert {name: rates["ERR"] for name, rates in found.rows[0].rates.items()} == {
        "base: net": 0.01,
        "new: net": 0.03,
    }


def test_a_variant_with_few_masks_takes_no_frame_from_the_others():
    few, post = {("net", "post"): [1] * 2}, ("filtered", "post")
    found = page_of({post: [4] * 12, **few}, {post: [5] * 12, **few})
    assert [len(frame.rates) for frame in found.rows] == [4] * 2 + [2] * 10
    assert found.rows[-1].rates.keys() == {"base: filtered", "new: filtered"}


def test_results_without_a_variant_in_common_have_no_frames_to_show():
    blind = {("blind", "post"): [5] * 12}
    assert page_of({("net", "post"): [1] * 12, **blind}, {("other", "post"): [2], **blind}) is None


def test_a_fleet_whose_rows_name_their_drives_stands_beside_a_drive():
    masks = {("net", "post"): [1] * 12}
    part = a_part(masks)

    def with_drive(table):
        rows = part.rows(table)
        return rows.replace(drive=np.full(len(rows), "street"))

    named = replace(part, rows=with_drive)
    sides = Side("fleet", [named]), Side("drive", [part])
    compared = Compared(compare(sides, EvaluationSettings()), (), sides, {})
    assert browsed(compared, lambda _: 0).variants == ["fleet: net", "drive: net"]
    assert len(over_drive(compared)) == 1

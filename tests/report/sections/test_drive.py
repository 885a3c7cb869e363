"""The parts of a drive's report: what each says where numbers lack or cannot be sure."""

import numpy as np
import pandas as pd
import pytest

from roadeval.evaluation.score.scoreboard import Effect
from roadeval.report.blocks import Figure, Table, Text
from roadeval.report.sections.drive import filter_effect, regions, thresholds
from roadeval.results.tables import read_table
from tests.report.making import (
    VARIANTS,
    a_difference,
    by_rate,
    opened,
    some_findings,
)


def texts(findings):
    return [block.text for block in filter_effect(findings) if isinstance(block, Text)]


def test_where_there_is_no_interval_the_reason_is_given():
    rates = by_rate(err=a_difference(-0.02))
    found = some_findings(effects=[Effect("unfiltered", "filtered", "post", True, rates)])
    assert any("No interval for ERR: 1,200 frames are too few" in text for text in texts(found))


# --- Over thresholds ------------------------------------------------------------------------------

QUOTED = {
    "frames": 8,
    "AP": 0.91,
    "MaxF": 0.93,
    "threshold": 0.4,
    "precision": 0.95,
    "recall": 0.96,
}
LEVELS = [("filtered", "post", 20, 2, 8), ("filtered", "post", 230, 4, 1)]

COLUMNS = ["variant", "stage", "level", "road", "other"]


def findings(**quoted):
    tables = {"probabilities": pd.DataFrame(LEVELS, columns=COLUMNS)}
    return some_findings(
        table=lambda name: tables.get(name, read_table(name, "")),
        curves={"filtered": {"post": QUOTED | quoted}},
    )


@pytest.mark.parametrize(
    ("stated", "wrong", "told"),
    [(0.02, 0.08, True), (0.02, 0.03, False), (0.002, 0.006, False), (0.1, 0.05, False)],
)
def test_a_variant_that_errs_twice_as_often_as_it_says_is_called_over_confident(
    stated, wrong, told
):
    own = {"ECE": 0.05, "confidence": 1 - stated, "right": 1 - wrong, "threshold": 0.00757}
    (table,) = (block for block in opened(thresholds(findings(**own))) if isinstance(block, Table))
    assert ("filtered is over-confident: by its probabilities" in table.caption) == told
    assert table.rows[0][4:6] == ["0.00757", "5.00"]


def test_the_curves_are_charts_with_the_masks_at_their_own_thresholds():
    (figure,) = (block for block in opened(thresholds(findings())) if isinstance(block, Figure))
    recall, reliable = figure.charts
    curve, mask, *_ = recall.series
    assert reliable.series[1].x == pytest.approx([100 * 20 / 255, 100 * 230 / 255])
    assert reliable.series[1].y == pytest.approx([100 * 2 / 10, 100 * 4 / 5])
    # Of 6 road and 9 other pixels, 4 and 1 are of the higher level.
    assert curve.x == pytest.approx([100 * 4 / 6, 100])
    assert curve.y == pytest.approx([80, 100 * 6 / 15])
    assert (mask.name, mask.x, mask.y) == (
        "filtered: the mask",
        [83.0],
        [pytest.approx(100 * 6 / 9)],
    )
    # Half of the room at least.
    assert (recall.x_range, recall.y_range) == ((50, 101), (50, 101))


# --- Regions --------------------------------------------------------------------------------------


def of_regions(*regions, variants=VARIANTS):
    """A table in which every number is another."""
    masks = pd.MultiIndex.from_product([regions, variants], names=["region", "variant"])
    places = np.arange(len(masks)) / 1000
    return pd.DataFrame(
        {"pixels": 0.1 + places, "ERR": 0.2 + places, "errors": 0.4 + places}, masks
    )


def test_the_trimap_is_a_curve_over_widths_and_has_a_hole_where_no_pixel_is_near():
    beyond = {name: {"trimap": {"1": [0, 0], "8": [3, 12]}} for name in VARIANTS[:2]}
    findings = some_findings(regions=of_regions("boundary", "interior"), beyond=beyond)
    _, figure = (block for block in regions(findings) if isinstance(block, Figure))
    (chart,) = figure.charts
    assert chart.names == ["1", "8"]
    assert [each.name for each in chart.series] == ["filtered", "unfiltered"]
    assert [*chart.series[0].points()] == [(1, 25)]

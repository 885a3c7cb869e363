"""Where the errors are: every region that was counted, with its own numbers."""

import pytest

from roadeval.report.blocks import Figure, Text
from roadeval.report.sections.drive import regions
from tests.report.making import VARIANTS, some_findings, the


def table_of(*regions, variants=VARIANTS):
    """A table in which every number is another."""
    return {
        (region, variant): {
            "pixels": (10 + place) / 100,
            "ERR": (20 + 3 * place + own) / 1000,
            "errors": (400 + 3 * place + own) / 1000,
        }
        for own, variant in enumerate(variants)
        for place, region in enumerate(regions)
    }


def charts(findings):
    return the(Figure, regions(findings)).charts


def test_each_region_has_its_own_numbers():
    within, errors = charts(some_findings(regions=table_of("lit", "boundary", "interior")))
    assert within.names == ["in light", "near the road's edge", "away from the road's edge"]
    assert [each.name for each in within.series] == [*VARIANTS]
    assert within.series[1].y == pytest.approx([2.1, 2.4, 2.7])
    assert errors.series[2].y == pytest.approx([40.2, 40.5, 40.8])
    assert errors.share == pytest.approx([10, 11, 12])


def test_a_region_that_no_one_knows_is_shown_by_its_name():
    findings = some_findings(regions=table_of("boundary", "interior", "wet_asphalt"))
    assert charts(findings)[0].names[-1] == "wet asphalt"


def test_row_bands_are_named_by_their_rows():
    names = ("shadow", "boundary", "interior", "band_0", "band_1", "band_2")
    assert charts(some_findings(regions=table_of(*names)))[0].names[3:] == [
        "image rows 0–6, the top",  # noqa: RUF001
        "image rows 7–13",  # noqa: RUF001
        "image rows 14–19, the bottom",  # noqa: RUF001
    ]


def test_the_width_of_the_edge_is_told_where_it_is_known():
    run = {"evaluation": {"boundary_width": 7}}
    findings = some_findings(regions=table_of("boundary", "interior"), run=run)
    (note,) = (block.text for block in regions(findings) if isinstance(block, Text))
    assert "within 7 pixels of the border" in note


def test_the_trimap_is_a_curve_over_widths_and_has_a_hole_where_no_pixel_is_near():
    beyond = {name: {"trimap": {"1": [0, 0], "8": [3, 12]}} for name in VARIANTS[:2]}
    findings = some_findings(regions=table_of("boundary", "interior"), beyond=beyond)
    _, figure = (block for block in regions(findings) if isinstance(block, Figure))
    (chart,) = figure.charts
    assert chart.names == ["1", "8"]
    assert [each.name for each in chart.series] == ["filtered", "unfiltered"]
    assert [*chart.series[0].points()] == [(1, 25)]


def test_shadow_is_explained_where_it_is_a_region():
    for names, told in ((("shadow", "boundary"), True), (("boundary", "interior"), False)):
        blocks = regions(some_findings(regions=table_of(*names)))
        (note,) = (block.text for block in blocks if isinstance(block, Text))
        assert ("took for shadow" in note) == told

"""Where the errors are: every region that was counted, with its own numbers."""

from roadeval.report.blocks import Figure, Table, Text
from roadeval.report.sections.drive import regions
from tests.report.making import VARIANTS, plain_rows, some_findings


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


def tables(findings):
    return [block for block in regions(findings) if isinstance(block, Table)]


def test_each_column_has_its_own_numbers():
    (table,) = tables(some_findings(regions=table_of("lit", "boundary", "interior")))
    assert [title for title, _ in table.groups] == [
        *("", "pixels", "ERR within, %", "share of its wrong pixels, %")
    ]
    assert table.columns == ["region", "of all, %", *VARIANTS, *VARIANTS]
    assert plain_rows(table) == [
        ["in light", "10.0", "2.0", "2.1", "2.2", "40.0", "40.1", "40.2"],
        ["near the road's edge", "11.0", "2.3", "2.4", "2.5", "40.3", "40.4", "40.5"],
        ["away from the road's edge", "12.0", "2.6", "2.7", "2.8", "40.6", "40.7", "40.8"],
    ]


def test_a_region_that_no_one_knows_is_shown_by_its_name():
    findings = some_findings(regions=table_of("boundary", "interior", "wet_asphalt"))
    (table,) = tables(findings)
    assert [row[0] for row in table.rows][-1] == "wet asphalt"
    (figure,) = (block for block in regions(findings) if isinstance(block, Figure))
    assert figure.charts[0].names[-1] == "wet asphalt"


def test_row_bands_are_named_by_their_rows_below_a_rule():
    names = ("shadow", "boundary", "interior", "band_0", "band_1", "band_2")
    (table,) = tables(some_findings(regions=table_of(*names)))
    assert [row[0] for row in table.rows][3:] == [
        "image rows 0–6, the top",  # noqa: RUF001
        "image rows 7–13",  # noqa: RUF001
        "image rows 14–19, the bottom",  # noqa: RUF001
    ]
    assert table.breaks == [1, 3]


def test_many_variants_have_a_table_a_number():
    variants = ("a", "b", "c", "d")
    findings = some_findings(
        regions=table_of("boundary", "interior", variants=variants),
        totals={name: {"post": {}} for name in variants},
    )
    assert [table.groups[2][0] for table in tables(findings)] == [
        *("ERR within, %", "share of its wrong pixels, %")
    ]


def test_the_width_of_the_edge_is_told_where_it_is_known():
    run = {"evaluation": {"boundary_width": 7}}
    findings = some_findings(regions=table_of("boundary", "interior"), run=run)
    (note,) = (block.text for block in regions(findings) if isinstance(block, Text))
    assert "within 7 pixels of the border" in note


def test_shadow_is_explained_where_it_is_a_region():
    for names, told in ((("shadow", "boundary"), True), (("boundary", "interior"), False)):
        blocks = regions(some_findings(regions=table_of(*names)))
        (note,) = (block.text for block in blocks if isinstance(block, Text))
        assert ("took for shadow" in note) == told

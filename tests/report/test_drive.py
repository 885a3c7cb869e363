"""The report of a drive: which sections a page of it has, and how long its windows are."""

import pytest

from roadeval.report.blocks import Heading
from roadeval.report.document import document, page_document
from roadeval.report.findings import Findings
from roadeval.report.sections.frames import FrameBrowser
from roadeval.results.rows import as_arrays
from tests.evaluation.making import a_table, rows_of
from tests.report.making import VARIANTS, some_findings
from tests.report.sections.test_drive import findings as thresholded


def headings(made):
    return [block.text for block in made.blocks if isinstance(block, Heading) and block.level == 1]


def test_a_page_has_the_sections_of_the_report():
    row = {"variant": "filtered", "region": "lit", "pixels": 1.0, "ERR": 0.1, "errors": 1.0}
    findings = thresholded()
    vars(findings).update(
        regions={("interior", name): row for name in VARIANTS},
        error_parts={"filtered": {"svm": 0.2, "post": -0.1}},
    )
    frames = FrameBrowser([], [], [])
    paper, page = (headings(made) for made in (document(findings), page_document(findings, frames)))
    assert "Over thresholds" in page
    assert {*paper} - {*page} == {"The worst frames"}


@pytest.mark.parametrize(("frames", "size", "rows"), [(50, 10, 5), (301, 20, 16)])
def test_a_long_drive_has_longer_windows_instead_of_more(frames, size, rows):
    table = rows_of(a_table({("filtered", "post"): [10] * frames}))
    tables = {"frames": table, "windows": as_arrays("windows", ())}
    windows = Findings("drive.rrd", some_findings().facts, tables.__getitem__).windows
    assert set(windows["frames"][:-1]) == {size}
    assert len(windows) == rows
    assert windows["frames"].sum() == frames

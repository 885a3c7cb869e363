"""The report of a drive: which sections a page of it has, and how long its windows are."""

import pytest

from roadeval.report.blocks import Heading
from roadeval.report.document import document, page_document
from roadeval.report.findings import Findings
from roadeval.report.sections.frames import FrameBrowser
from roadeval.results.tables import read_table
from tests.evaluation.making import a_table
from tests.report.making import some_findings
from tests.report.sections.test_drive import findings as thresholded
from tests.report.sections.test_drive import of_regions


def headings(made):
    return [block.text for block in made.blocks if isinstance(block, Heading) and block.level == 1]


def test_a_page_has_the_sections_of_the_report():
    findings = thresholded()
    parts = {"filtered": {"svm": 0.2, "post": -0.1}}
    vars(findings).update(regions=of_regions("interior"), error_parts=parts)
    frames = FrameBrowser([], [], [])
    paper, page = (headings(made) for made in (document(findings), page_document(findings, frames)))
    assert "Over thresholds" in page
    assert {*paper} - {*page} == {"The worst frames of filtered"}


@pytest.mark.parametrize(("frames", "size", "rows"), [(50, 10, 5), (301, 20, 16)])
def test_a_long_drive_has_longer_windows_instead_of_more(frames, size, rows):
    table = a_table({("filtered", "post"): [10] * frames}).assign(drive="street", camera="")
    tables = {"frames": table, "windows": read_table("windows", "")}
    windows = Findings("drive.rrd", some_findings().facts, tables.__getitem__).windows
    assert set(windows["frames"][:-1]) == {size}
    assert len(windows) == rows
    assert windows["frames"].sum() == frames

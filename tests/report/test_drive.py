"""The report of a drive: which sections it has, and what stands above them."""

from roadeval.report.blocks import Heading
from roadeval.report.document import document, page_document
from roadeval.report.sections.frames import FrameBrowser
from tests.report.making import VARIANTS
from tests.report.sections.test_drive import findings as thresholded


def sections(findings):
    return headings(document(findings))


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
    paper, page = sections(findings), headings(page_document(findings, frames))
    assert "Over thresholds" in page
    assert {*paper} - {*page} == {"The worst frames"}

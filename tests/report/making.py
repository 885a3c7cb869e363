"""Reading back what was typeset."""

import io
import re

from pypdf import PdfReader

from roadeval.report.blocks import Document


def a_document(*blocks, title="street"):
    """A document of some blocks."""
    return Document("kicker", title, "subtitle", "footer", blocks)


def reader(content):
    """Open a PDF."""
    return PdfReader(io.BytesIO(content))


def text(content):
    """Every word of a PDF, with single spaces between them."""
    pages = (page.extract_text() for page in reader(content).pages)
    return re.sub(r"\s+", " ", " ".join(pages))

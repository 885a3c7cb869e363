"""The captions in Markdown, and the code that shows them."""

import re
from pathlib import Path

import roadeval.report
from roadeval.report.captions import caption, captions

FOLDER = Path(roadeval.report.__file__).parent
PYTHON, TEMPLATES = (
    "\n".join(path.read_text("utf-8") for path in sorted(FOLDER.rglob(pattern)))
    for pattern in ("*.py", "*.html")
)


def test_every_caption_is_shown_and_every_shown_one_is_there() -> None:
    code = (PYTHON + TEMPLATES).replace("'", '"')
    assert [name for name in captions() if f'"{name}"' not in code] == []
    shown = re.findall(r'\b(?:caption|note)\(\s*"([^"]+)"', code)
    assert {*shown} <= captions().keys()


def test_a_caption_is_one_line_with_its_values() -> None:
    assert caption("units") == "Percent; the differences in percentage points."
    assert caption("failed drives", failed=2, drives=9).startswith("2 of 9 drives failed")
    assert not any("\n" in words for words in captions().values())

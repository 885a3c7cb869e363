"""The site: ``python -m sphinx -W --keep-going -q docs build/site``.

It opens from the disk and asks nothing of any network. Pages that repeat what the code or another
file of the project says are made here, while the site is built; see ``generated.py``.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import generated  # noqa: E402
from pygments.lexers.special import TextLexer  # noqa: E402
from sphinx.highlighting import lexers  # noqa: E402

import roadeval  # noqa: E402

lexers["csv"] = TextLexer()
project = "roadeval"
author = "the roadeval authors"
release = roadeval.__version__
extensions = ["myst_parser", "sphinx_copybutton"]
# What commands print is not text to copy.
copybutton_selector = "div:not(.highlight-text) > div.highlight > pre"
copybutton_prompt_text = "$ "
myst_heading_anchors = 4
html_theme = "furo"
html_title = f"roadeval {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
smartquotes = False
html_show_sphinx = False
html_theme_options = {"footer_icons": []}


def _page(_app: Any, name: str, source: list[str]) -> None:
    source[0] = generated.page(name, source[0])


def _begin_api(app: Any) -> None:
    """Begin the pages of the Python API in a process of its own: they take longest."""
    if app.builder.name == "html":
        command = [sys.executable, HERE / "api.py", Path(app.outdir) / "api"]
        app.roadeval_api = subprocess.Popen(command)


def _end_api(app: Any, error: Exception | None) -> None:
    if (process := getattr(app, "roadeval_api", None)) and process.wait() and error is None:
        raise SystemExit("docs/api.py failed")


def setup(app: Any) -> None:
    """Connect what is generated."""
    app.connect("source-read", _page)
    app.connect("builder-inited", _begin_api)
    app.connect("build-finished", _end_api)

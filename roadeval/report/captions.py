"""The captions, notes and warnings of reports and pages, which ``captions.md`` holds."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

from roadeval.report.blocks import Text


def caption(name: str, **values: object) -> str:
    """Return the caption with a name; ``values`` replace the words in braces."""
    return captions()[name].format(**values)


def note(name: str, **values: object) -> Text:
    """Return the caption with a name as a small grey paragraph."""
    return Text(caption(name, **values), "note")


@cache
def captions() -> dict[str, str]:
    """Return all captions by their headings, with the words in braces not yet replaced."""
    text = files("roadeval.report").joinpath("captions.md").read_text("utf-8")
    parts = (part.partition("\n") for part in text.split("\n## ")[1:])
    return {name: " ".join(words.split()) for name, _, words in parts}

"""The tables in the texts: between marks, made of the numbers, and compared with them."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from benchmarks.tables.blocks import BLOCKS

ROOT: Final = Path(__file__).resolve().parents[2]
NUMBERS: Final = Path(__file__).with_name("numbers.json")
DOCUMENTS: Final = (
    ROOT / "README.md",
    ROOT / "benchmarks" / "PRESETS.md",
    ROOT / "docs" / "explanation" / "presets.md",
    ROOT / "docs" / "explanation" / "paper.md",
    ROOT / "docs" / "explanation" / "overlap.md",
)

END: Final = "<!-- end -->"
_BLOCK: Final = re.compile(
    rf"^<!-- table (?P<name>\w+)[^\n]*-->\n(?P<body>.*?)^{END}$", re.DOTALL | re.MULTILINE
)
_CODE: Final = re.compile(r"^```.*?^```$|`[^`\n]*`", re.DOTALL | re.MULTILINE)
_MEASURED: Final = re.compile(
    r"(?<![\w.])[-+]?\d[\d,]*(?:\.\d+)?\s?(?:%|pp\b|points?\b|ms\b|[kMG]i?B\b)|\d+\.\d+"
)
"""A number with decimals, or with a unit of these measurements."""
NOT_MEASURED: Final = (
    "Python 3.11",
    "95 % interval",
    "section 4.2",
    "section 4.4",
    "| 4.2, step 5",
    "| 4.4, order",
)
"""Texts that look like a measured number and are none."""


def load() -> dict[str, Any]:
    """Return the numbers that were measured last."""
    numbers: dict[str, Any] = json.loads(NUMBERS.read_text())
    return numbers


def write_tables(text: str, numbers: Mapping[str, Any]) -> str:
    """Return a text with every table between marks made anew; unknown names stay unchanged."""

    def anew(match: re.Match[str]) -> str:
        block = BLOCKS.get(match["name"])
        return match[0] if block is None else between_marks(match["name"], numbers)

    return _BLOCK.sub(anew, text)


def between_marks(name: str, numbers: Mapping[str, Any]) -> str:
    """Return a block with its marks, the first of which names the commands behind it."""
    block = BLOCKS[name]
    head = f"<!-- table {name}: {'; '.join(block.commands)} -->"
    commands = ", ".join(f"`{command}`" for command in block.commands)
    return f"{head}\n{block.body(numbers)}\n\nMade by {commands}\n{END}"


def faults(text: str, numbers: Mapping[str, Any]) -> Iterator[str]:
    """Yield, a line each, the places where a text differs from the numbers, or has none."""
    marks = text.count("<!-- table ")
    blocks = [*_BLOCK.finditer(text)]
    if marks != len(blocks):
        yield f"{marks} tables begin, and {len(blocks)} are whole: each ends with a line {END}"
    for match in blocks:
        if match["name"] not in BLOCKS:
            yield f"table {match['name']}: unknown, one of {', '.join(BLOCKS)}"
        elif match[0] != between_marks(match["name"], numbers):
            yield f"table {match['name']}: not what numbers.json gives; run with --write"
    for number in loose_numbers(text):
        yield f"{number!r}: a measured number outside a table; put it into one, or leave it out"


def loose_numbers(text: str) -> list[str]:
    """Return texts like measured numbers outside tables between marks and outside code."""
    for part in (_BLOCK, _CODE):
        text = part.sub("", text)
    for phrase in NOT_MEASURED:
        text = text.replace(phrase, "")
    return [match[0] for match in _MEASURED.finditer(text)]

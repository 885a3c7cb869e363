"""Text and charts of a comment on a pull request, and a badge.

Sites make links of mentions, issues and addresses, even behind a backslash, but not inside code.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from html import escape
from typing import Final

from roadeval.data.words import defined, percent, plain_points
from roadeval.evaluation.comparison.compare import Comparison, MaskChange
from roadeval.evaluation.comparison.conditions import Judgement
from roadeval.evaluation.metrics import TESTED
from roadeval.report.blocks import Block, blocks_as_markdown
from roadeval.report.chart import BETTER, WORSE
from roadeval.results.facts import focus_of
from roadeval.results.sentences import is_sure
from roadeval.runtime.text import elide

MOST, PART, POINTS, BARS = 60_000, 9_000, 60, 12
"""Greatest numbers: bytes of a comment and of a part of it, points and bars of a chart."""
_LINKABLE: Final = re.compile(
    r"\S*(?:\\(?:[^_*\[\]<>]|<[a-z!/?])|[…!]|%\w|:(?!\d\d\b)\S|//|www\.|[a-z]-\d|\b[\da-f]{7})\S*",
    re.IGNORECASE,
)
"""A word of Markdown that a site may turn into a link, a mention or a command."""


def fit(blocks: Iterable[Block], most: int = PART) -> str:
    """Return at most ``most`` bytes of Markdown, in which no name notifies anybody or is a link."""
    lines, shown = blocks_as_markdown(blocks).split("\n"), list[str]()
    for line in lines:
        short = elide(re.sub(r"\S{99,}", lambda word: elide(word[0], 60), line), 1500)
        safe_line = _LINKABLE.sub(lambda word: in_code(re.sub(r"\\(.)", r"\1", word[0])), short)
        most -= len(safe_line.encode()) + 1
        if most < 0:
            shown.append(f"\n*Left out here: {len(lines) - len(shown)} lines.*")
            break
        shown.append(re.sub(r"(?<=\w) \\> ", " > ", safe_line))
    return "\n".join(shown).strip() + "\n"


def in_code(text: str) -> str:
    """Return text as code, without characters that would end the code or a table's cell."""
    return f"`{elide(text, 600).translate({96: 39, 124: 166})}`"


def levels(pairs: Sequence[tuple[float, float]]) -> str:
    """Return a Mermaid chart of pairs of base and new, in percent; empty for fewer than two."""
    pairs = [pair for pair in pairs if all(map(defined, pair))][:: len(pairs) // POINTS + 1]
    if len(pairs) < 2:
        return ""
    bars, line = ([round(y, 2) for y in row] for row in zip(*pairs, strict=True))
    axis = f'y-axis "ERR in percent" 0 --> {max(*bars, *line, 1)}'
    return _mermaid("", 300, ("#aaaaaa", BETTER), axis, f"bar {bars}", f"line {line}")


def changes(rows: Sequence[tuple[str, float]]) -> str:
    """Return a Mermaid chart of the largest changes, fractions, the worst first; or nothing."""
    rows = sorted((row for row in rows if row[1] and defined(row[1])), key=lambda row: -abs(row[1]))
    rows = sorted(rows[:BARS], key=lambda row: -row[1])
    most = round(100 * max((abs(y) for _, y in rows), default=0), 3)
    names = [re.sub(r"[^\w .,'…()/-]", "·", elide(name, 32)) for name, _ in rows]
    labels = (f'"{name} {plain_points(y)}"' for name, (_, y) in zip(names, rows, strict=True))
    lines = [f"x-axis [{', '.join(labels)}]", f'y-axis "points" 0 --> {most}']
    for sign in (1, -1):  # Mermaid draws no bar for a value below 0
        ends = [round(100 * sign * y, 3) if sign * y > 0 else -most for _, y in rows]
        lines.append(f"bar {ends}")
    return _mermaid(" horizontal", 90 + 32 * len(rows), (WORSE, BETTER), *lines) if rows else ""


def _mermaid(kind: str, height: int, colours: Sequence[str], *lines: str) -> str:
    colour = f'{{xyChart: {{plotColorPalette: "{", ".join(colours)}"}}}}'
    config = f"config: {{xyChart: {{height: {height}}}, themeVariables: {colour}}}"
    return "\n".join(["```mermaid", "---", config, "---", f"xychart-beta{kind}", *lines, "```\n"])


def standing(comparison: Comparison, limits: Sequence[Judgement]) -> tuple[MaskChange, str, str]:
    """Return a surely worse mask, else the focus; a text with its ERR; a word for its change."""
    masks = comparison.finals() or comparison.changes
    focus = focus_of([row.variant for row in masks])

    def rank(row: MaskChange) -> tuple[bool, bool, float]:
        change = row.difference[TESTED]
        return is_sure(change) and change.mean > 0, row.variant == focus, change.mean

    mask = max(masks, key=rank)
    sure, mean = is_sure(mask.difference[TESTED]), mask.difference[TESTED].mean
    failed = any(limit.holds is not False for limit in limits) or (sure and mean > 0)
    tone = "better" if sure else "may be chance" if mean else "unchanged"
    text = f"{mask.variant}: {percent(mask.new[TESTED], 1)} % ({plain_points(mean, 1)} pp)"
    return mask, text, "worse" if failed else tone


def badge(comparison: Comparison, limits: Sequence[Judgement]) -> str:
    """Return an SVG with ERR and its change, and a title for screen readers."""
    _, text, tone = standing(comparison, limits)
    title, shown = escape(elide(f"ERR of {text}, {tone}", 200)), text.rpartition(": ")[2]
    colour, width = {"better": "#1a7f37", "worse": "#cf222e"}.get(tone, "#59636e"), 6 * len(shown)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width + 48}" height="20" role="img">'
        f'<title>{title}</title><rect width="36" height="20" fill="#333"/><rect x="36" '
        f'width="{width + 12}" height="20" fill="{colour}"/><g fill="#fff" font-size="11" '
        'font-family="Verdana,sans-serif"><text x="6" y="14">ERR</text>'
        f'<text x="42" y="14" textLength="{width}">{shown}</text></g></svg>\n'
    )

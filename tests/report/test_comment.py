"""One comment on a pull request: what it says, its length, and names that do nothing in it."""

import math
import re
from xml.etree import ElementTree

import pytest

from roadeval.evaluation.comparison.compare import DriveChange, RegionChange
from roadeval.evaluation.comparison.conditions import Condition, judge
from roadeval.evaluation.comparison.pairing import MovedFrame
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.report.comment import MOST, badge, changes, levels
from roadeval.report.comparison import changed_drives, comment
from tests.evaluation.making import a_change, a_comparison, a_difference

WORSE, BETTER = a_difference(1.2, 0.5, 2, p=0.001), a_difference(-1.2, -2, -0.5, p=0.001)
HOSTILE = [
    *("@octocat", "octo/road#123", "GH-12", "#7", "!8", "$1", "~bug", "&2", "%3", ":tada:"),
    *("https://evil.example", "www.evil.example", "a@evil.example", "[x](//evil.example)"),
    *("</details>", "<img src=x onerror=alert(1)>", "<!-- x", "a`@me`b", "a|@me|b", "```\n@me"),
    *("\n/close\n", "\u202e@me", "0123456789abcdef0123456789abcdef01234567", "%%{init: {}}%%"),
    *('a"]\nclick A "//evil.example"', "x" * 70 + "@me" + "y" * 70),
]


def alive(markdown):
    """What stands neither in code nor in a chart."""
    text = re.sub(r"```mermaid\n.*?\n```\n", "", markdown, flags=re.DOTALL)
    return re.sub(r"`[^`\n]+`", "CODE", text)


def a_fleet(names, variants=("net",), settings=None):
    """A comparison with a drive, a region and a frame of each name for the first variant."""
    masks = [a_change(WORSE, variant, "new") for variant in variants]
    rows = [(variants[0], n, WORSE if i % 2 else BETTER) for i, n in enumerate(names)]
    return a_comparison(
        *masks,
        drives=tuple(
            DriveChange("new", v, "post", n, 9, 0.1, 0.2, d, 0.01, changed=True) for v, n, d in rows
        ),
        regions=tuple(RegionChange("new", v, n, n, 9, 0.1, 0.2, d) for v, n, d in rows),
        moved=tuple(MovedFrame("new", v, i, i, 0.1, 0.2, 0.1) for i, (v, _, _) in enumerate(rows)),
        changed_settings={"new": settings or {}},
        warnings=tuple(names),
    )


@pytest.mark.parametrize("name", HOSTILE)
def test_a_name_pings_nobody_and_links_nowhere(name):
    text = comment(a_fleet([name, f"drive {name}"], settings={name: (name, name)}), [], [], name)
    left = alive(text)
    assert not re.search(
        r"@|#\d|GH-|evil|close\b|[!~$&]\w|%\w|:tada|[0-9a-f]{9}|<(?!/?(det|sum))", left
    )
    assert left.count("</details>") == 2
    charts = re.findall(r"```mermaid\n(.*?)\n```\n", text, flags=re.DOTALL)
    assert text.count("```") == 2 * len(charts) == 8
    lines = "\n".join(charts).splitlines()
    labels = [line.removeprefix("x-axis ") for line in lines if line.startswith("x-axis")]
    assert all(
        re.fullmatch(r"\[\"[^\"%;#<>\[\]`]+\"(, \"[^\"%;#<>\[\]`]+\")*\]", one) for one in labels
    )
    assert all(re.match(r"---|config|xychart|[xy]-axis|bar|line", line) for line in lines)


@pytest.mark.parametrize("name", ["n" * 1000, "n " * 500, "𝄞" * 1000, "@" * 1000, "| " * 500])
def test_a_comment_fits_whatever_comes_in_and_says_what_is_left_out(name):
    names = [f"{name}{place}" for place in range(500)]
    settings = {f"{name}{place}": ([name] * 9, name) for place in range(200)}
    comparison = a_fleet(names, [f"v{place}" for place in range(40)], settings)
    limit = Condition.parse("post.v1.ERR > +0.5pp")
    text = comment(comparison, [*judge(comparison, [limit], EvaluationSettings())], [], name)
    assert len(text.encode()) <= MOST
    first = "## roadeval: failed, 1 of 1 limits exceeded: post.v1.ERR > +0.5pp; ERR of v0: 11.2 %"
    assert text.startswith(first)
    assert "| v0 | post | ERR |" in text
    assert "Left out here: " in text
    assert text.endswith("</details>\n")


@pytest.mark.parametrize(
    ("change", "colour", "title"),
    [
        (BETTER, "#1a7f37", "ERR of a&lt;b: 8.8 % (-1.2 pp), better"),
        (WORSE, "#cf222e", "ERR of a&lt;b: 11.2 % (+1.2 pp), worse"),
        (a_difference(1.2, -1, 3, p=0.3), "#59636e", "may be chance"),
        (a_difference(1.2), "#59636e", "may be chance"),
        (a_difference(0), "#59636e", "unchanged"),
    ],
)
def test_a_badge_has_a_colour_for_better_worse_and_chance_and_a_title(change, colour, title):
    svg = badge(a_comparison(a_change(change, "a<b")), [])
    assert colour in svg
    assert f"{title}</title>" in svg
    ElementTree.fromstring(svg)


def test_results_without_a_final_mask_in_common_have_a_comment_all_the_same():
    text = comment(a_comparison(a_change(WORSE, final=False)), [], [], "roadeval compare a b")
    assert text.startswith("## roadeval: worse; ERR of filtered: 11.2 % (+1.2 pp)\n")
    assert "\nAgain: `roadeval compare a b`\n" in text


def test_a_badge_is_red_if_a_limit_cannot_be_judged():
    comparison = a_comparison(a_change(BETTER))
    limit = Condition.parse("post.nothing.ERR > +0.5pp")
    assert "#cf222e" in badge(comparison, [*judge(comparison, [limit], EvaluationSettings())])


def test_a_bar_shows_the_size_of_a_change_and_its_row_the_direction():
    chart = changes([("a", 0.01), ("b", -0.02), ("c", math.nan)])
    *_, names, axis, worse, better, _, _ = chart.split("\n")
    assert names == 'x-axis ["a +1.00", "b -2.00"]'
    assert axis == 'y-axis "points" 0 --> 2.0'
    assert (worse, better) == ("bar [1.0, -2.0]", "bar [-2.0, 2.0]")
    assert changes([("a", 0.0)]) == ""


def test_levels_leave_out_what_is_undefined_and_are_thinned():
    assert "bar [1.0, 3.0]\nline [2.0, 4.0]" in levels([(1.0, 2.0), (math.nan, 1.0), (3.0, 4.0)])
    assert levels([(1.0, 2.0)]) == ""
    assert levels([(1.0, 2.0)] * 500).count("1.0") <= 61


# --- The report of a comparison: what its headings name -------------------------------------------


@pytest.mark.parametrize(
    ("result", "title"), [("net", "net differs from base"), ("new", "net changed")]
)
def test_drives_on_which_a_mask_differs_are_headed_by_the_two(result, title):
    row = DriveChange(result, "net", "post", "street", 12, 0.1, 0.2, WORSE, 0.01, changed=True)
    heading, _ = changed_drives(a_comparison(a_change(WORSE, "net", result), drives=(row,)))
    assert heading.text == f"Drives on which {title}, the surest first"

"""Documents as pages: every block, nothing that is markup, nothing from elsewhere."""

import base64
import hashlib
import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest

from roadeval.report.blocks import (
    Block,
    BulletList,
    Cell,
    Command,
    Details,
    DriveRow,
    Figure,
    Heading,
    ImageFile,
    ImageGrid,
    KeepTogether,
    LinkList,
    Picture,
    Strip,
    Table,
    Text,
    TwoColumns,
)
from roadeval.report.chart import Chart, ChartKind, Look, Series
from roadeval.report.findings import NotableFrame
from roadeval.report.page.render import page
from roadeval.report.sections.frames import FrameBrowser
from tests.report.making import a_document

JPEG = ImageFile(b"\xff\xd8\xff\xe0 not much of a picture")
HOSTILE = "<script>alert(1)</script>\"'&\x1b[2J javascript:alert(2)"
CHART = Chart("ERR", ChartKind.LINES, [Series(HOSTILE, Look("#0072B2"), [0, 1], [1.0, 2.0])])
MARKS = Chart("ERR", ChartKind.MARKS, CHART.series, names=[HOSTILE, "b"], share=[1.0, 2.0])


def every_block(text):
    """One of each kind of block, with a text wherever one has room."""
    table = Table([text, "n"], [[Cell(text, look=Look("#0072B2")), text], ["", "1"]], caption=text)
    strip = Strip(7, [text], table, [[Picture(text, text, JPEG)]], text)
    row = NotableFrame(7, 0, "", {text: {"ERR": 0.01}}, notes=[text], conditions=[text])
    return [
        Heading(text),
        Heading(text, 2),
        Text(text),
        Text(text, "title"),
        Command(text),
        BulletList(text, [text], "warning"),
        table,
        replace(table, find=text),
        Figure([CHART, MARKS], text),
        ImageGrid([(text, JPEG)], 4, skip=1, caption=text),
        Details(text, [Text(text)]),
        KeepTogether([Text(text)]),
        TwoColumns([Text(text)], [Text(text)]),
        LinkList([(text, "0/")]),
        DriveRow(text, text, replace(CHART, low=True), "0/", [(text, JPEG)]),
        FrameBrowser([row], [text], [CHART], text.format, strips=[strip]),
    ]


class Reader(HTMLParser):
    """The elements of a page with their attributes, and its text."""

    def __init__(self, content):
        super().__init__()
        self.elements = []
        self.words = []
        self.feed(content.decode())

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.words.append(data)

    def all(self, tag):
        return [attributes for name, attributes in self.elements if name == tag]


def test_names_of_settings_are_code_and_nothing_else_is_markup():
    text = "set `labels.road`, write `threshold = 0.5`, not `<b>`"
    blocks = Text(text), BulletList("", [text]), Table(["a"], [[text]])
    parts = Reader(rendered(*blocks)).elements
    assert [tag for tag, _ in parts].count("code") == 6
    assert "b" not in [tag for tag, _ in parts]


def rendered(*blocks):
    return page(a_document(*blocks))


def test_a_block_that_nobody_can_draw_is_no_silent_gap():
    class Riddle(Block):
        pass

    with pytest.raises(NotImplementedError, match="riddle"):
        rendered(Riddle())


def test_what_looks_like_markup_is_text_wherever_it_stands():
    plain, hostile = (Reader(rendered(*every_block(text))) for text in ("word", HOSTILE))
    assert [tag for tag, _ in plain.elements] == [tag for tag, _ in hostile.elements]
    names = ([set(own) - {"data-of"} for _, own in each.elements] for each in (plain, hostile))
    assert next(names) == next(names)
    assert "\x1b" not in "".join(hostile.words)
    for _, attributes in hostile.elements:
        for address in (attributes.get("href"), attributes.get("src")):
            assert address is None or address.startswith(("#", "data:", "0/"))


def test_a_page_asks_for_nothing_and_allows_its_own_script_and_style_alone():
    content = rendered(*every_block("word"))
    made = Reader(content)
    (policy,) = [own["content"] for own in made.all("meta") if "http-equiv" in own]
    assert policy.startswith("default-src 'none'; img-src data:;")
    for tag, directive in (("style", "style-src"), ("script", "script-src")):
        (code,) = re.findall(rf"<{tag}>(.*?)</{tag}>", content.decode(), re.S)
        digest = base64.b64encode(hashlib.sha256(code.encode()).digest()).decode()
        assert f"{directive} 'sha256-{digest}'" in policy
    assert not made.all("link")[1:]
    assert not any(
        "style" in own or any(n.startswith("on") for n in own) for _, own in made.elements
    )


def test_tables_name_their_columns_and_rows_and_fill_in_what_a_row_takes_from_above():
    table = Table(["variant", "stage", "n"], [["a", "svm", "1"], ["", "post", "2"]], (0, 1))
    made = Reader(rendered(table))
    assert [own["scope"] for own in made.all("th")] == ["col"] * 3 + ["row"] * 2
    text = "".join(made.words)
    assert text.count("a") > text.count("post")
    assert len(made.all("caption")) == 1


def test_numbers_of_frames_in_a_cell_are_links_to_the_frames():
    table = Table(["class", "worst frames"], [["car", Cell("31 44", frames=(31, 44))]])
    html = page(a_document(table)).decode()
    links = [f'<a href="#frame-{number}">{number}</a>' for number in (31, 44)]
    assert " ".join(links) in html

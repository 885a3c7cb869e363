"""Documents as pages: every block, nothing that is markup, nothing from elsewhere."""

import base64
import hashlib
import re
import struct
import zlib
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
from roadeval.report.chart import Chart, ChartKind, Level, Look, Series, looks
from roadeval.report.findings import NotableFrame
from roadeval.report.page.render import page
from roadeval.report.pdf.typeset import typeset
from roadeval.report.sections.frames import FrameBrowser
from tests.report.making import a_document, reader, text

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


# --- From blocks to pages: text stays text, and the same document gives the same file -------------


TYPESET_HOSTILE = '#panic("x") $x^2$ *bold* _it_ <label> @ref `raw` [c] \\ // # = - "quoted" ${x}'


def a_png():
    def chunk(kind, data):
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    header = struct.pack(">IIBBBBB", 2, 1, 8, 0, 0, 0, 0)
    parts = (b"IHDR", header), (b"IDAT", zlib.compress(b"\0\0\xff")), (b"IEND", b"")
    return ImageFile(b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*part) for part in parts))


def a_chart(title, kind=ChartKind.LINES, **more):
    names = [f"{title} of one", f"{title} of two"]
    drawn = zip(names, looks(names).values(), strict=True)
    given = {"low": [0.5, 1], "high": [2, 9]}
    return Chart(title, kind, [Series(n, k, [0, 1], [1, 2], **given) for n, k in drawn], **more)


CHARTS = {
    "lines": a_chart("ERR", names=["svm", "post"], level=Level("the mean", 1.5)),
    "level": a_chart("ERR", ChartKind.LINES, unit="pp", level=Level("the mean", 1.5, 1, 2)),
    "curves": a_chart("precision", across="recall"),
    "marks": a_chart("ERR", ChartKind.MARKS, names=["a", "b"], share=[3, 4], y_range=(0, 4)),
}


@pytest.mark.parametrize("name", CHARTS)
def test_every_kind_of_chart_is_drawn_with_its_words(name):
    chart = CHARTS[name]
    content = typeset(a_document(Figure([chart, chart, chart], "What it shows.")))
    words = text(content)
    title = f"{chart.title}, {chart.unit}"
    wanted = [title, "What it shows.", *(k.name for k in chart.legend())]
    wanted += chart.names
    assert [each for each in wanted if each not in words] == []
    # A legend is one, the titles are three.
    assert all(words.count(key.name) == 1 for key in chart.legend())
    assert words.count(title) == 3


@pytest.mark.parametrize(
    "block",
    [
        Heading(TYPESET_HOSTILE),
        Text(TYPESET_HOSTILE),
        Text(TYPESET_HOSTILE, "note"),
        Text(TYPESET_HOSTILE, "verdict"),
        Text(TYPESET_HOSTILE, "title"),
        Command(TYPESET_HOSTILE),
        BulletList(TYPESET_HOSTILE, [TYPESET_HOSTILE], "warning"),
        Table([TYPESET_HOSTILE], [[TYPESET_HOSTILE]], caption=TYPESET_HOSTILE),
        Figure([a_chart(TYPESET_HOSTILE)], ""),
        Figure([a_chart("ERR")], TYPESET_HOSTILE),
        ImageGrid([(TYPESET_HOSTILE, a_png())], 1),
        ImageGrid([("one", a_png())], 1, caption=TYPESET_HOSTILE),
        Details(TYPESET_HOSTILE, []),
    ],
    ids=lambda block: type(block).__name__,
)
def test_text_that_looks_like_markup_is_printed_as_it_is(block):
    assert '#panic("x") $x^2$ *bold* _it_ <label> @ref `raw`' in text(typeset(a_document(block)))


def test_the_caption_of_pictures_is_on_their_page():
    for above in range(2, 8):
        pictures = ImageGrid([("one", a_png())] * 3, 2, caption="What they show")
        blocks = [Table(["n"], [[str(n)] for n in range(above * 6)], small=True), pictures]
        pages = [page.extract_text() for page in reader(typeset(a_document(*blocks))).pages]
        assert ["one" in words for words in pages] == ["What they show" in words for words in pages]


def test_who_listens_to_a_document_is_told_what_each_part_is_and_what_pictures_show():
    table = Table(["variant", "ERR"], [["filtered", "1.00"]], caption="Rates")
    made = reader(typeset(a_document(Heading("One"), table, Figure([a_chart("ERR")], ""))))
    root = made.trailer["/Root"]
    assert root["/MarkInfo"]["/Marked"]
    assert root["/Lang"] == "en"
    kinds = list(parts(root["/StructTreeRoot"]))
    assert {"/H1", "/Table", "/TH", "/TD", "/Figure"} <= {kind for kind, _ in kinds}
    assert ("/Figure", "ERR, %: ERR of one, ERR of two") in kinds


def parts(element):
    """The parts of a document's structure: what each is, and the words for a picture."""
    element = element.get_object()
    yield element.get("/S"), element.get("/Alt")
    inner = element.get("/K", [])
    for each in inner if isinstance(inner, list) else [inner]:
        if hasattr(each.get_object(), "keys") and "/S" in each.get_object():
            yield from parts(each)


def test_many_rows_of_pictures_fill_a_page_and_go_on_with_their_caption_above():
    grid = ImageGrid([(f"picture {n}", a_png()) for n in range(12)], 2, caption="Frames.")
    pages = reader(typeset(a_document(Heading("Masks"), grid))).pages
    first, *_, last = (page.extract_text() for page in pages)
    assert first.index("Frames.") < first.index("picture 0")
    assert "picture 11" in last
    assert "picture 11" not in first

"""From blocks to pages: text stays text, and the same document gives the same file."""

import struct
import zlib

import pytest

from roadeval.report.blocks import (
    BulletList,
    Command,
    Details,
    Figure,
    Heading,
    ImageFile,
    ImageGrid,
    Table,
    Text,
)
from roadeval.report.chart import Chart, ChartKind, Level, Series, looks
from roadeval.report.pdf.typeset import typeset
from tests.report.making import a_document, reader, text

HOSTILE = '#panic("x") $x^2$ *bold* _it_ <label> @ref `raw` [c] \\ // # = - "quoted" ${x}'


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
        Heading(HOSTILE),
        Text(HOSTILE),
        Text(HOSTILE, "note"),
        Text(HOSTILE, "verdict"),
        Text(HOSTILE, "title"),
        Command(HOSTILE),
        BulletList(HOSTILE, [HOSTILE], "warning"),
        Table([HOSTILE], [[HOSTILE]], caption=HOSTILE),
        Figure([a_chart(HOSTILE)], ""),
        Figure([a_chart("ERR")], HOSTILE),
        ImageGrid([(HOSTILE, a_png())], 1),
        ImageGrid([("one", a_png())], 1, caption=HOSTILE),
        Details(HOSTILE, []),
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

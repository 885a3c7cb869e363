"""Text and documents from elsewhere: nothing acts, what would take minutes is refused."""

import json
import time
from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from roadeval.runtime.documents import LONGEST, read_bounded, read_json, read_toml, read_yaml
from roadeval.runtime.settings import meanings
from roadeval.runtime.text import UNENCODABLE, as_markdown, visible, visible_lines, without_secrets

ANYTHING = st.text(st.characters(codec=None))


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("\x1b[31mred\x07", r"\u001b[31mred\u0007"),
        ("a\r\nroadeval: done", r"a\r\nroadeval: done"),
        ("\x9b2J\x7f", r"\u009b2J\u007f"),
        ("gpj.\N{RIGHT-TO-LEFT OVERRIDE}mca", r"gpj.\u202emca"),
        ("\N{RIGHT-TO-LEFT ISOLATE}\N{LINE SEPARATOR}", r"\u2067\u2028"),
        ("\N{ZERO WIDTH SPACE}\N{BYTE ORDER MARK}\N{SOFT HYPHEN}", r"\u200b\ufeff\u00ad"),
        (b"caf\xe9".decode("utf-8", "surrogateescape"), r"caf\udce9"),
        ("\N{TAG SPACE}\uffff", r"\udb40\udc20\uffff"),
    ],
)
def test_what_acts_without_being_seen_is_escaped(text, shown):
    assert visible(text) == shown


@given(ANYTHING)
def test_escaped_text_is_a_line_that_any_stream_takes_and_is_escaped_once(text):
    shown = visible(text)
    assert len(shown.splitlines()) <= 1
    assert visible(shown) == shown
    assert shown.encode().decode() == shown


@given(ANYTHING)
def test_a_document_of_json_means_the_same(text):
    document = visible_lines(json.dumps({text: [text]}, indent=2, ensure_ascii=False))
    assert json.loads(document) == {text: [text]}


def test_what_a_stream_cannot_encode_is_escaped_in_the_same_way():
    assert "größe \udce9".encode("ascii", UNENCODABLE) == rb"gr\u00f6\u00dfe \udce9"
    with pytest.raises(UnicodeDecodeError):
        b"\xe9".decode("ascii", UNENCODABLE)


def test_markdown_shows_the_text_itself():
    assert as_markdown("[a](http://b) *c* `d` <e> | $f$ &g; @h #i_\x1b") == (
        r"\[a\](http://b) \*c\* \`d\` \<e\> \| \$f\$ \&g; \@h \#i\_\\u001b"
    )


@pytest.mark.parametrize(
    ("text", "left"),
    [
        ("no http://u:geheim@host:80/a?sig=geheim here", "no http://host:80/a here"),
        ("(s3://u:geheim@bucket/a) http:/u:geheim@h/b", "(s3://bucket/a) http://h/b"),
        ("http://u:geheim/x@host/a", "http://host/a"),
        ("http://u:ge?geheim@host:9/a", "http://host:9/a"),
        ("http://u:ge#geheim@host:9/a", "http://host:9/a"),
        ("http://u:x@geheim@host/a ftp://u:geheim@host/a", "http://host/a ftp://host/a"),
        ("http://u:ge heim@host", "http:// heim@host"),
        ("http://[::1]:80/a@b tcp://host:8786: no", "http://[::1]:80/a@b tcp://host:8786: no"),
        ("net.mcap:/mask, C:/a@b, 10:30", "net.mcap:/mask, C:/a@b, 10:30"),
    ],
)
def test_urls_lose_what_is_secret(text, left):
    assert without_secrets(text) == left.replace("http://h/b", "http:/h/b")


BIG = "x" * (LONGEST + 1)
MANY = "y" * 1_001


@pytest.mark.parametrize(
    ("document", "reason"),
    [
        ({"verdict": BIG}, "a text of 12,001 letters, and at most 12,000 are read"),
        ({"a": [{BIG: 1}]}, "a text of 12,001 letters"),
        ({str(n): MANY for n in range(500)}, "its long texts have more than 500,000 letters"),
        ([0] * 101, "more than 100 values"),
        ([[[0] * 40] * 2] * 2, "more than 100 values"),
        *((deep, "nests more than 32") for deep in ("[" * 100_000, "[" * 40 + "]" * 40)),
        ('{"a":' * 40 + "1" + "}" * 40, "nests more than 32"),
        ("9" * 5_000, "^a number in it has thousands of digits$"),
        ('{"a": [1,', r"^it is not JSON, or ends early \(line 1, column 10\)$"),
        (b'"\xff"', "^it is not in UTF-8$"),
    ],
)
def test_json_that_is_damaged_or_holds_too_much_is_refused_in_plain_words(document, reason):
    text = document if isinstance(document, str | bytes) else json.dumps(document)
    with pytest.raises(ValueError, match=reason):
        read_json(text, **({"values": 100} if "values" in reason else {}))


def test_what_is_written_is_read():
    document = {"a": "x" * LONGEST, "b": ["w" * 1_000] * 900, "c": [1.5, None, True], "d\n": {}}
    assert read_json(json.dumps(document)) == document
    assert read_json(json.dumps(document).encode()) == document


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("a = " + "[" * 1_000 + "]" * 1_000, "nests more than 32"),
        ("a = " + "[" * 40 + "]" * 40, "nests more than 32"),
        ("a = " + "{b = " * 400 + "1" + "}" * 400, "nests more than 32"),
        (".".join("a" * 50) + " = 1", "nests more than 32"),
        ("x." * 20_000 + "y = 1", "a name in it has more than 2,000 parts"),
        ("[" + "x." * 1_500 + "y]\n" + "[" + "x." * 1_500 + "z]", "or several have so many"),
        ("a = " + "9" * 5_000, "thousands of digits"),
        ("# " + "x" * (1 << 20), "bytes, and at most 1,048,576 are read"),
        ("a = [1", "Unclosed array"),
        (f"a = '{BIG}'", "a text of 12,001 letters"),
    ],
)
def test_toml_that_holds_too_much_is_refused_at_once(text, reason):
    begun = time.process_time()
    with pytest.raises(ValueError, match=reason):
        read_toml(text)
    assert time.process_time() - begun < 2


def test_a_document_is_a_file_that_ends(tmp_path):
    (tmp_path / "large").write_bytes(bytes(65 << 20))
    with pytest.raises(ValueError, match="at most 67,108,864 are read"):
        read_bounded(tmp_path / "large")
    with pytest.raises(OSError, match="is a folder"):
        read_bounded(tmp_path)


@pytest.mark.parametrize("text", ["!!timestamp noon", '!!int ""', "!!bool maybe", "a: [1"])
def test_yaml_whose_values_are_not_of_their_tags_is_damaged(tmp_path, text):
    (tmp_path / "camera.yaml").write_text(text)
    with pytest.raises(ValueError, match="it is damaged"):
        read_yaml(tmp_path / "camera.yaml")


# --- The meaning of settings, as help texts and documented configurations show it -----------------


@dataclass
class Base:
    """Settings of a base.

    least: The least
        number.
    note: This is not a field, and so no setting.
    """

    least: int = 1


@dataclass
class More(Base):
    """More settings.

    greatest: A number: ``least`` or more.
    """

    greatest: int = 2
    undescribed: int = 3


def test_the_docstring_of_a_class_and_of_its_bases_describes_their_fields():
    """Also of a class whose source is nowhere."""
    described = {"least": "The least number.", "greatest": "A number: ``least`` or more."}
    assert meanings(More) == described
    parts = {"__doc__": "Made.\n\n    seed: A seed.\n", "__annotations__": {"seed": int}}
    assert meanings(type("Made", (More,), parts)) == {**described, "seed": "A seed."}

"""Text from elsewhere: nothing in it can act, and what it says stays readable."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

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

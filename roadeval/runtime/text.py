"""Text from outside, such as names of topics and files, made safe to show.

A name can hold a terminal's command, a mark that turns the direction of the text around it, or a
line break that begins a false message. All text for people passes through `visible`.
"""

from __future__ import annotations

import codecs
import json
import os
import re
from collections.abc import Iterable
from typing import Final
from unicodedata import category

_JOINERS: Final = "\N{ZERO WIDTH NON-JOINER}\N{ZERO WIDTH JOINER}"
"""Letters inside words of some scripts, and inside some emoji."""
_MARKUP: Final = frozenset("\\`*_[]<>|#&~$@")
_URL: Final = re.compile(
    r"((?:[A-Za-z][A-Za-z0-9+.-]+:/(?:/|(?=[^\s/@]*@))|(?:https?|gs|s3):/))(\S*)"
)
"""A URL in a text, also one from which a `Path` has removed a slash."""

LIKENESS: Final = 0.7
"""Least similarity, as `difflib` counts it, of a mistyped name and the name that is suggested."""
UNENCODABLE: Final = "roadeval.visible"
"""Name of an error handler for streams: it escapes letters that the encoding lacks."""


def debug() -> bool:
    """Return whether ``ROADEVAL_DEBUG=1`` in the environment asks for tracebacks."""
    return os.environ.get("ROADEVAL_DEBUG") == "1"


def defect(error: BaseException) -> str:
    """Return the sentence on an error that is a mistake of the program itself."""
    message = " ".join(f"{type(error).__name__}: {error}".split())
    return (
        f"{visible(message)} (a defect of roadeval, not of your input: run again with "
        "ROADEVAL_DEBUG=1 to see where, and please report it)"
    )


def visible(text: str) -> str:
    r"""Return a line of text with invisible characters escaped as in JSON.

    These are control characters, line breaks, marks of direction, characters that Unicode does not
    define, and bytes of a file's name that are not UTF-8. A string of JSON or TOML keeps its
    meaning.

    >>> print(visible("/camera\x1b[2J\nroadeval: done"))
    /camera\u001b[2J\nroadeval: done
    """
    if text.isprintable():
        return text
    return "".join(
        letter
        if letter.isprintable() or letter in _JOINERS or category(letter) == "Zs"
        else _escape(letter)
        for letter in text
    )


def visible_lines(text: str) -> str:
    """Return the lines of a text, as a document of JSON or TOML, each made `visible`."""
    return "\n".join(map(visible, text.split("\n")))


def likely(name: str, names: Iterable[str]) -> str:
    """Return a question about the names that a mistyped one was probably meant to be; or nothing.

    >>> likely("--out", ["--net", "--output"]), likely("robst", ["paper", "robust"])
    ('did you mean --output? ', 'did you mean robust? ')
    >>> likely("mine", ["filtered"])
    ''
    """
    from difflib import get_close_matches

    names = [*names]
    begun = sorted(other for other in names if other.startswith(name))
    meant = begun[:3] or get_close_matches(name, names, 1, LIKENESS)
    return f"did you mean {' or '.join(meant)}? " if meant and name else ""


def elide(name: str, letters: int) -> str:
    """Return a name, shortened in the middle if it is long: names differ at both ends."""
    name = visible(name)
    if len(name) <= letters:
        return name
    half = (letters - 1) // 2
    return f"{name[: letters - 1 - half]}\N{HORIZONTAL ELLIPSIS}{name[len(name) - half :]}"


def without_secrets(text: str) -> str:
    """Return text with the user, password, query and fragment of its URLs removed.

    The query of a signed URL is as good as a password.

    >>> without_secrets("https://me:secret@host/a.mcap?X-Amz-Signature=5d1c cannot be read")
    'https://host/a.mcap cannot be read'
    """
    return _URL.sub(lambda url: public_url(url[0]), text)


def public_url(url: str) -> str:
    """Return a URL without user, password, query and fragment; other text unchanged."""
    match = _URL.match(url)
    return url if match is None else f"{match[1]}{_public(url[match.end(1) :])}"


def _public(rest: str) -> str:
    """Return the part of a URL after its scheme without user, password, query and fragment."""
    host = re.split("[/?#]", rest, maxsplit=1)[0]
    if "@" not in host and re.search(r"^[^\[]*:(?!\d*\W*$)", host):
        # No port follows the colon, but a password that contains /, ? or #, or begins with it.
        return _public(rest.rpartition("@")[2]) if "@" in rest else ""
    return re.split("[?#]", host.rpartition("@")[2] + rest[len(host) :], maxsplit=1)[0]


def is_utf8(text: str) -> bool:
    """Return whether text is Unicode, and not the bytes of a name in another encoding."""
    return text.encode(errors="ignore").decode() == text


def as_markdown(text: str) -> str:
    r"""Return a line of text as Markdown that shows it literally.

    >>> print(as_markdown("a*b"))
    a\*b
    """
    return "".join(f"\\{letter}" if letter in _MARKUP else letter for letter in visible(text))


def _escape(letters: str) -> str:
    return json.dumps(letters)[1:-1]


def escape_unencodable(error: UnicodeError) -> tuple[str, int]:
    """Return the letters that cannot be encoded, escaped, and the place after them."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return _escape(error.object[error.start : error.end]), error.end


codecs.register_error(UNENCODABLE, escape_unencodable)

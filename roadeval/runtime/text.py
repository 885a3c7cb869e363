"""Text from elsewhere, as names of topics and files, made safe to show.

A name can hold a terminal's command, a mark that turns the direction of the text around it, or a
line break that begins a false message. All text for people passes through `visible` on its way out.
"""

from __future__ import annotations

import codecs
import json
import os
import re
from typing import Final
from unicodedata import category

_JOINERS: Final = "\N{ZERO WIDTH NON-JOINER}\N{ZERO WIDTH JOINER}"
"""Letters of words in some scripts, and of some emoji."""
_MARKUP: Final = frozenset("\\`*_[]<>|#&~$@")
_URL: Final = re.compile(
    r"((?:[A-Za-z][A-Za-z0-9+.-]+:/(?:/|(?=[^\s/@]*@))|(?:https?|gs|s3):/))(\S*)"
)
"""A URL in a text; also one that passed for a path and lost a slash."""

UNENCODABLE: Final = "roadeval.visible"
"""An error handler for streams: letters that the encoding lacks are escaped as by `visible`."""


def debug() -> bool:
    """Return whether tracebacks are asked for, by ``ROADEVAL_DEBUG=1`` in the environment."""
    return os.environ.get("ROADEVAL_DEBUG") == "1"


def defect(error: BaseException) -> str:
    """Return the sentence on an error that is a mistake of the program itself."""
    what = " ".join(f"{type(error).__name__}: {error}".split())
    return (
        f"{visible(what)} (a defect of roadeval, not of your input: run again with "
        "ROADEVAL_DEBUG=1 to see where, and please report it)"
    )


def visible(text: str) -> str:
    r"""Return a line of text with invisible characters escaped as in JSON.

    These are control characters, line breaks, marks of direction, characters that Unicode does not
    define, and bytes of a file's name that are not UTF-8. In a string of JSON or TOML the result
    means the same.

    >>> print(visible("/camera\x1b[2J\nroadeval: done"))
    /camera\u001b[2J\nroadeval: done
    """
    if text.isprintable():
        return text
    return "".join(
        each if each.isprintable() or each in _JOINERS or category(each) == "Zs" else _escaped(each)
        for each in text
    )


def visible_lines(text: str) -> str:
    """Return text of several lines, as a document of JSON or TOML, each as `visible` returns it."""
    return "\n".join(map(visible, text.split("\n")))


def elided(name: str, letters: int) -> str:
    """Return a name, shortened in the middle where it is long, as names differ at both ends."""
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
    """Return a URL without user, password, query and fragment; text that is none as it is."""
    match = _URL.match(url)
    return url if match is None else f"{match[1]}{_public(url[match.end(1) :])}"


def _public(rest: str) -> str:
    """Return the part of a URL after its scheme without user, password, query and fragment."""
    host = re.split("[/?#]", rest, maxsplit=1)[0]
    if "@" not in host and re.search(r"^[^\[]*:(?!\d*\W*$)", host):
        # No port: a password with one of those letters in it, or the beginning of one.
        return _public(rest.rpartition("@")[2]) if "@" in rest else ""
    return re.split("[?#]", host.rpartition("@")[2] + rest[len(host) :], maxsplit=1)[0]


def is_utf8(text: str) -> bool:
    """Return whether text is Unicode, and not the bytes of a name in another encoding."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def as_markdown(text: str) -> str:
    r"""Return a line of text as Markdown that shows it literally.

    >>> print(as_markdown("a*b"))
    a\*b
    """
    return "".join(f"\\{each}" if each in _MARKUP else each for each in visible(text))


def _escaped(letters: str) -> str:
    return json.dumps(letters)[1:-1]


def _replace(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return _escaped(error.object[error.start : error.end]), error.end


codecs.register_error(UNENCODABLE, _replace)

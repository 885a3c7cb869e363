"""Text from elsewhere, as names of topics and files, made safe to show.

A name can hold what a terminal takes for a command, what turns the direction of the text around it,
or a line break that begins a false message. Whatever shows text to a person passes it through
`visible` as it goes out.
"""

from __future__ import annotations

import codecs
import json
import re
from typing import Final
from unicodedata import category

_JOINERS: Final = "\N{ZERO WIDTH NON-JOINER}\N{ZERO WIDTH JOINER}"
"""Parts of words in some scripts, and of some emoji."""
_MARKUP: Final = frozenset("\\`*_[]<>|#&~$@")
_URL: Final = re.compile(
    r"((?:[A-Za-z][A-Za-z0-9+.-]+:/(?:/|(?=[^\s/@]*@))|(?:https?|gs|s3):/))(\S*)"
)
"""A URL in a text; also one that passed for a path and lost a slash."""

UNENCODABLE: Final = "roadeval.visible"
"""An error handler for streams: what their encoding lacks is written as `visible` writes it."""


def visible(text: str) -> str:
    r"""Return a line of text with what cannot be seen escaped as in JSON.

    That is: control characters, line breaks, marks of direction, characters that Unicode does not
    define, and bytes of a file's name that are not UTF-8. Text without them is returned as it is;
    in a string of JSON or TOML the result means the same.

    >>> print(visible("/camera\x1b[2J\nroadeval: done"))
    /camera\u001b[2J\nroadeval: done
    """
    if text.isprintable():
        return text
    return "".join(letter if _harmless(letter) else _escaped(letter) for letter in text)


def visible_lines(text: str) -> str:
    """Return text of several lines, as a document of JSON or TOML, each as `visible` returns it."""
    return "\n".join(map(visible, text.split("\n")))


def elided(name: str, letters: int) -> str:
    """Return a name, its middle left out where it is long: both ends tell names apart."""
    name = visible(name)
    if len(name) <= letters:
        return name
    half = (letters - 1) // 2
    return f"{name[: letters - 1 - half]}\N{HORIZONTAL ELLIPSIS}{name[len(name) - half :]}"


def without_secrets(text: str) -> str:
    """Return text whose URLs have no user, password, query and fragment.

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
    """Return what follows a URL's scheme without the parts that may be secret."""
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
    r"""Return a line of text as Markdown that shows it as it is, whatever it looks like.

    >>> print(as_markdown("a*b"))
    a\*b
    """
    return "".join(f"\\{each}" if each in _MARKUP else each for each in visible(text))


def _harmless(letter: str) -> bool:
    return letter.isprintable() or letter in _JOINERS or category(letter) == "Zs"


def _escaped(letters: str) -> str:
    return json.dumps(letters)[1:-1]


def _replace(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return _escaped(error.object[error.start : error.end]), error.end


codecs.register_error(UNENCODABLE, _replace)

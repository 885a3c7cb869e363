"""Text from elsewhere, as names of topics and files, made safe to show.

A name can hold what a terminal takes for a command, what turns the direction of the text around it,
or a line break that begins a false message. Whatever shows text to a person passes it through
`visible` as it goes out.
"""

from __future__ import annotations

import codecs
import json
from typing import Final
from unicodedata import category

_JOINERS: Final = "\N{ZERO WIDTH NON-JOINER}\N{ZERO WIDTH JOINER}"
"""Parts of words in some scripts, and of some emoji."""
_MARKUP: Final = frozenset("\\`*_[]<>|#&~$@")

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

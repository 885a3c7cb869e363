"""Sentences in which names of settings are marked, so that each interface can use its own names."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import Any, Final

_PLACE: Final = re.compile(r"\{([\w.]*)\}")


class Setting(str):
    """The name of a setting in a sentence, as ``topics.truth``."""

    __slots__ = ()


class Sentence(str):
    """Text in which the names of settings are marked.

    As a string it shows a setting's Python name between backticks; `name_settings` replaces these
    names, for example by flags.

    >>> sentence = Sentence("{} frames are too many; lower {training.frames}", 90)
    >>> print(sentence)
    90 frames are too many; lower `training.frames`
    """

    parts: tuple[str, ...]
    """Texts and `Setting`s."""

    def __new__(cls, template: str, *values: object) -> Sentence:
        """Put settings and values in place of each ``{table.key}`` and ``{}`` of a template.

        Values may be settings and sentences. Text from elsewhere is a value, never the template.
        """
        left, parts = iter(values), []
        for number, piece in enumerate(_PLACE.split(template)):
            if number % 2 == 0:
                parts.append(piece)
            elif piece:
                parts.append(Setting(piece))
            else:
                value = next(left)
                parts += _parts(value if isinstance(value, str) else str(value))
        return cls.of(parts)

    @classmethod
    def of(cls, parts: Iterable[str]) -> Sentence:
        """Return the sentence that consists of these texts and settings."""
        nonempty = tuple(filter(None, parts))
        texts = (f"`{part}`" if isinstance(part, Setting) else part for part in nonempty)
        self = super().__new__(cls, "".join(texts))
        self.parts = nonempty
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return Sentence.of, (self.parts,)

    def join(self, texts: Iterable[str], /) -> Sentence:
        """Return texts as one sentence, with this one between them."""
        parts: list[str] = []
        for number, text in enumerate(texts):
            parts += (*self.parts, *_parts(text)) if number else _parts(text)
        return Sentence.of(parts)


def name_settings(text: str, name: Callable[[str], str]) -> Sentence:
    """Return text with the names of its settings as ``name`` returns them.

    >>> sentence = Sentence("lower {training.frames}")
    >>> print(name_settings(sentence, {"training.frames": "--train-frames"}.__getitem__))
    lower --train-frames
    """
    return Sentence.of(name(part) if isinstance(part, Setting) else part for part in _parts(text))


def _parts(text: str) -> tuple[str, ...]:
    return text.parts if isinstance(text, Sentence) else (text,)

"""Sentences for people, which know the settings that they name."""

from __future__ import annotations

from collections.abc import Callable, Iterable


class Setting(str):
    """The name of a setting in a sentence, as ``topics.truth``."""

    __slots__ = ()


class Sentence(str):
    """Text made of words and of settings.

    As a string it names a setting as Python does, between backticks; `name_settings` gives it the
    names of another place.

    >>> sentence = Sentence("nothing is left to evaluate; lower ", Setting("training.frames"))
    >>> print(sentence)
    nothing is left to evaluate; lower `training.frames`
    """

    parts: tuple[str, ...]

    def __new__(cls, *parts: str) -> Sentence:
        """Join parts, among them `Setting`s and other sentences."""
        pieces: list[str] = []
        for part in parts:
            pieces += part.parts if isinstance(part, Sentence) else (part,)
        texts = (f"`{piece}`" if isinstance(piece, Setting) else piece for piece in pieces)
        self = super().__new__(cls, "".join(texts))
        self.parts = tuple(pieces)
        return self

    def __getnewargs__(self) -> tuple[str, ...]:  # type: ignore[override]
        return self.parts

    def join(self, texts: Iterable[str], /) -> Sentence:
        """Return texts as one sentence, with this one between them."""
        first, *others = [*texts] or [""]
        return Sentence(first, *(part for text in others for part in (self, text)))


def name_settings(text: str, name: Callable[[str], str]) -> Sentence:
    """Return text with the names of its settings as ``name`` returns them.

    >>> sentence = Sentence("lower ", Setting("training.frames"))
    >>> print(name_settings(sentence, {"training.frames": "--train-frames"}.__getitem__))
    lower --train-frames
    """
    parts = text.parts if isinstance(text, Sentence) else (text,)
    return Sentence(*(name(part) if isinstance(part, Setting) else part for part in parts))

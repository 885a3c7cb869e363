"""The base class of all errors that a user can cause and correct."""

from __future__ import annotations

from collections.abc import Callable
from numbers import Integral
from typing import Any, Self

from roadeval.runtime.sentence import Sentence, Setting, name_settings
from roadeval.runtime.text import without_secrets


class RoadevalError(Exception):
    """A known problem: what is wrong, where, and what to do next.

    Its text is one line, without the passwords of URLs. It names settings as Python does. The
    terminal prints it without a traceback, names settings by their flags, and exits with code 1.
    A room derives an error of its own if some caller must tell it apart. Anything else that escapes
    is a defect of the program.
    """

    def __init__(
        self, problem: str = "", *, where: object = "", setting: str = "", remedy: str = ""
    ) -> None:
        super().__init__(problem)
        self.problem = problem
        self.where = where if isinstance(where, str) else str(where)
        """The file, topic or frame, from the outside in."""
        self.setting = setting
        """The setting that is wrong, such as ``topics.truth``; empty if no setting is wrong."""
        self.remedy = remedy
        """The next step that helps."""
        self.in_file = False
        """Whether settings stand in a file, where flags do not name them."""
        self.draft = ""
        """Lines of a file that corrects the problem, to be completed by the user."""

    @classmethod
    def of(cls, error: RoadevalError, where: object = "", *, in_file: bool = False) -> Self:
        """Return another error as one of this class, with a place put before its own place."""
        made = cls.__new__(cls, *error.args)
        made.__dict__.update(error.__dict__)
        if where:
            place = where if isinstance(where, str) else str(where)
            made.where = Sentence(": ").join(filter(None, (place, error.where)))
        made.in_file = in_file or error.in_file
        return made

    def rename_settings(self, rename: Callable[[str], str]) -> Self:
        """Return the error with its settings renamed, for example to settings of another table."""
        made = self.of(self)
        made.setting = rename(self.setting) if self.setting else ""
        for name in ("where", "problem", "remedy"):
            text = name_settings(getattr(self, name), lambda setting: Setting(rename(setting)))
            setattr(made, name, text)
        return made

    @property
    def sentence(self) -> Sentence:
        """The message: ``where: setting: problem; remedy``, without what is empty."""
        return self._sentence(self.where)

    @property
    def reason(self) -> Sentence:
        """The message without the place."""
        return self._sentence("")

    def _sentence(self, where: str) -> Sentence:
        parts = filter(None, (where, Setting(self.setting), self.problem))
        text = Sentence("; ").join(filter(None, (Sentence(": ").join(parts), self.remedy)))
        if self.in_file:
            text = name_settings(text, str)
        return Sentence.of(
            part if isinstance(part, Setting) else without_secrets(part) for part in text.parts
        )

    def __str__(self) -> str:
        return str(self.sentence)

    def __reduce__(self) -> tuple[Any, ...]:
        # A constructor may take other arguments, so none is called.
        return type(self).__new__, (type(self), *self.args), self.__dict__


class SettingError(RoadevalError, ValueError):
    """Settings of one table that cannot be used; the message names them without their table."""


def check_count(name: str, number: object, least: int = 1) -> None:
    """Raise a `RoadevalError` if an argument is not a whole number of at least ``least``.

    >>> check_count("worst", 0)
    Traceback (most recent call last):
    roadeval.errors.RoadevalError: worst must be a whole number from 1 on (given: 0)
    """
    if not isinstance(number, Integral) or number < least:
        raise RoadevalError(f"{name} must be a whole number from {least} on (given: {number!r})")

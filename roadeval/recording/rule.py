"""Which frames' images a recording keeps: the setting ``output.record``.

A long log is scored whole, but seldom looked at whole. Numbers, notes and tables of every frame are
always recorded; this is about images alone.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from roadeval.recording.layout import RecordingError


class RuleKind(StrEnum):
    """The rules there are."""

    ALL = "all"
    MASKS = "masks"
    WORST = "worst"
    EVERY = "every"
    NONE = "none"


_RULE: Final = re.compile(r"(all|masks|none)|(worst|every):([1-9][0-9]{0,8})")


@dataclass(frozen=True, slots=True)
class RecordRule:
    """A rule that chooses images.

    ``all`` images; ``masks`` and labels of every frame, with the camera's image; all images of
    the ``worst:K`` frames by ERR, or of ``every:N``-th frame; ``none`` at all, which means
    no recording. ``number`` is K or N.

    >>> RecordRule.parse("worst:20")
    RecordRule(kind=<RuleKind.WORST: 'worst'>, number=20)
    """

    kind: RuleKind = RuleKind.ALL
    number: int = 0

    @property
    def recorded(self) -> bool:
        """Whether there is a recording."""
        return self.kind is not RuleKind.NONE

    @classmethod
    def parse(cls, text: str) -> RecordRule:
        """Read a rule as it is written in a configuration.

        Raises
        ------
        RecordingError
            If it is none.
        """
        match = _RULE.fullmatch(text)
        if match is None:
            raise RecordingError(
                f"`output.record` {text}: choose all, masks, worst:K, every:N or none (as worst:20)"
            )
        plain, counted, number = match.groups()
        return cls(RuleKind(plain or counted), int(number or 0))

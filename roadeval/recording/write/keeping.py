"""Which frames' pictures a recording keeps: a long log is scored whole, but seldom looked at whole.

Numbers, notes and tables of every frame are always recorded; this is about pictures alone.
"""

from __future__ import annotations

import heapq
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import StrEnum
from operator import itemgetter
from pathlib import Path
from types import TracebackType
from typing import Final, Self

from roadeval.data import BASELINE, FINAL_STAGE, FrameResult, Pictures
from roadeval.recording.layout import Layout, RecordingError
from roadeval.recording.write.encoding import Encoded
from roadeval.recording.write.recorder import NullRecorder, Recorder
from roadeval.recording.write.shelf import Shelf


class Kind(StrEnum):
    """The rules there are."""

    ALL = "all"
    MASKS = "masks"
    WORST = "worst"
    EVERY = "every"
    NONE = "none"


_RULE: Final = re.compile(r"(all|masks|none)|(worst|every):([1-9]\d{0,6})")


@dataclass(frozen=True, slots=True)
class Rule:
    """What ``--record`` asks for.

    ``all`` pictures; ``masks`` and labels of every frame, with the camera's image; all pictures
    of the ``worst:K`` frames by ERR, or of ``every:N``-th frame; ``none`` at all, which means
    no recording.
    """

    kind: Kind = Kind.ALL
    number: int = 0

    @classmethod
    def parse(cls, text: str) -> Rule:
        """Read a rule as it is typed.

        Raises
        ------
        RecordingError
            If it is none.
        """
        match = _RULE.fullmatch(text)
        if match is None:
            raise RecordingError(
                f"--record {text}: choose all, masks, worst:K, every:N or none (as worst:20)"
            )
        plain, counted, number = match.groups()
        return cls(Kind(plain or counted), int(number or 0))


@dataclass(frozen=True, slots=True, eq=False)
class Kept:
    """An encoded frame, and how bad it is: the ERR by which ``worst:K`` ranks it."""

    encoded: Encoded
    badness: float


class Keeper:
    """A recorder that keeps pictures by a rule; a context manager like the `Recorder` it feeds.

    The pictures of ``worst:K`` wait on a `Shelf` beside the recording: which they are is known at
    the end alone, and memory need not hold them, however large K is.

    Parameters
    ----------
    path, layout
        As for the `Recorder`.
    rule
        Any but ``none``.
    """

    def __init__(self, path: Path, layout: Layout, rule: Rule) -> None:
        self.path = path
        self._recorder = Recorder(path, layout)
        self._rule = rule
        self._shelf = Shelf(path.with_name(f"{path.stem}.partial.pictures"))
        self._worst: list[tuple[float, int]] = []

    @property
    def partial(self) -> Path:
        """The file while it is being written."""
        return self._recorder.partial

    def __enter__(self) -> Self:
        self._recorder.__enter__()
        # A killed run may have left some, whatever this one's rule. It is no more than in the way.
        with suppress(RecordingError):
            self._shelf.sweep()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            # A run that is stopped keeps the worst frames so far, if there is room for them.
            with suppress(RecordingError):
                self._write_held()
        finally:
            try:
                self._shelf.close()
            except RecordingError:
                # What went wrong first is what the user must hear.
                if error is None:
                    raise
            finally:
                self._recorder.__exit__(kind, error, trace)

    def encode(self, result: FrameResult, position: int, lines: Mapping[str, str]) -> Kept:
        """Encode the frame at ``position`` among those read, from 0; in any thread."""
        bad = badness(result)
        pictures = self._pictures(bad, position)
        return Kept(self._recorder.encode(replace(result, pictures=pictures), lines), bad)

    def write(self, kept: Kept) -> None:
        """Append a frame. Frames come in order, from one thread."""
        if self._rule.kind is not Kind.WORST:
            self._recorder.write(kept.encoded)
            return
        self._recorder.write(replace(kept.encoded, payloads={}))
        if kept.encoded.payloads:
            # Of equals the earlier frame is kept, whatever the order of the threads.
            self._recorder.check_room()
            self._shelf.put(kept.encoded)
            heapq.heappush(self._worst, (kept.badness, -kept.encoded.number))
            if len(self._worst) > self._rule.number:
                self._shelf.drop(-heapq.heappop(self._worst)[1])

    def settle(self) -> None:
        """Write all that waits, the pictures held back too, once the last frame is written."""
        self._write_held()
        self._recorder.settle()

    def finish(self, results: Mapping[str, str]) -> None:
        """Add what still waits and the results, close the file and give it its name."""
        self._write_held()
        self._recorder.finish(results)

    def _write_held(self) -> None:
        self._worst = sorted(self._worst, key=itemgetter(1))
        self._recorder.write_pictures(self._held())

    def _held(self) -> Iterator[Encoded]:
        """Take out the pictures held back, in order: whoever is interrupted can take the rest."""
        while self._worst:
            encoded = self._shelf.get(-self._worst[-1][1])
            self._worst.pop()
            yield encoded

    def _pictures(self, bad: float, position: int) -> Pictures:
        if self._rule.kind is Kind.MASKS:
            return Pictures.MASKS
        if self._rule.kind is Kind.EVERY:
            return Pictures.NONE if position % self._rule.number else Pictures.ALL
        if self._rule.kind is Kind.WORST:
            return Pictures.ALL if bad >= self._bar() else Pictures.NONE
        return Pictures.ALL

    def _bar(self) -> float:
        """Least badness that can still be among the worst; it only ever rises."""
        worst = self._worst
        return worst[0][0] if len(worst) == self._rule.number else 0.0


def recorder_for(path: Path, layout: Layout, rule: Rule) -> Keeper | NullRecorder:
    """Give the recorder that a rule asks for."""
    return NullRecorder() if rule.kind is Kind.NONE else Keeper(path, layout, rule)


def badness(result: FrameResult) -> float:
    """Greatest ERR of any variant's final mask; -1 for a frame that was not evaluated."""
    finals = (t for t in result.tallies if t.stage == FINAL_STAGE and t.variant != BASELINE)
    return max((t.rates["ERR"] for t in finals), default=-1.0)

"""A recorder that keeps the images of some frames only, as a `RecordRule` says."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, suppress
from dataclasses import replace
from operator import itemgetter
from pathlib import Path
from typing import Any, Self

from roadeval.data import FrameResult
from roadeval.recording.layout import Layout, RecordingError
from roadeval.recording.rule import RecordRule, RuleKind
from roadeval.recording.write.encoding import EncodedFrame, Images, worst_error
from roadeval.recording.write.picture_store import PictureStore
from roadeval.recording.write.recorder import NullRecorder, Recorder


class SelectiveRecorder:
    """A recorder that keeps images by a rule; a context manager like the `Recorder` it feeds.

    The images of ``worst:K`` wait in a `PictureStore` beside the recording: which they are is known
    only at the end, and memory need not hold them, however large K is.

    Parameters
    ----------
    path, layout
        As for the `Recorder`.
    rule
        Any but ``none``.
    """

    def __init__(self, path: Path, layout: Layout, rule: RecordRule) -> None:
        self.path = path
        self._recorder = Recorder(path, layout)
        self._rule = rule
        self._store = PictureStore(self.partial.with_name(f"{self.partial.name}-images"))
        self._worst: list[tuple[float, int]] = []
        """A heap of ERR and minus the number of the frames that are put aside."""
        self._end = ExitStack()

    @property
    def partial(self) -> Path:
        """The file while it is being written."""
        return self._recorder.partial

    def __enter__(self) -> Self:
        self._end.enter_context(self._recorder)
        # In reverse order: the images put aside, their folder, the recording.
        self._end.callback(self._store.clear)
        self._end.callback(self._rescue)
        return self

    def __exit__(self, *error: Any) -> None:
        self._end.__exit__(*error)

    def encode(self, result: FrameResult, position: int, lines: Mapping[str, str]) -> EncodedFrame:
        """Encode a frame; the heavy part of the work, in any thread.

        Parameters
        ----------
        result
            With its layers.
        position
            Among the frames read, from 0.
        lines
            The frame's lines of the tables in `Layout.tables`, by name.
        """
        return self._recorder.encode(result, lines, self._images(worst_error(result), position))

    def write(self, encoded: EncodedFrame) -> None:
        """Append a frame. Frames come in order, from one thread."""
        if self._rule.kind is not RuleKind.WORST:
            self._recorder.write(encoded)
            return
        self._recorder.write(replace(encoded, payloads={}))
        if encoded.payloads:
            self._recorder.check_disk_space()
            self._store.put(encoded)
            # Of equals the earlier frame is kept, whatever the order of the threads.
            heapq.heappush(self._worst, (encoded.worst_error, -encoded.number))
            if len(self._worst) > self._rule.number:
                self._store.drop(-heapq.heappop(self._worst)[1])

    def flush(self) -> None:
        """Write all that waits, the images put aside too, once the last frame is written."""
        self._write_worst()
        self._recorder.flush()

    def finish(self, results: Mapping[str, str]) -> None:
        """Add what still waits and the results, and close the file."""
        self._write_worst()
        self._recorder.finish(results)

    def _rescue(self) -> None:
        """Keep the worst frames so far of a run that is stopped, if there is room for them."""
        with suppress(RecordingError):
            self._write_worst()

    def _write_worst(self) -> None:
        # Not in place: a worker thread may look at the heap.
        self._worst = sorted(self._worst, key=itemgetter(1))
        self._recorder.write_images(self._put_aside())

    def _put_aside(self) -> Iterator[EncodedFrame]:
        """Take out the frames put aside, in order: after an interrupt one can take the rest."""
        while self._worst:
            encoded = self._store.get(-self._worst[-1][1])
            self._worst.pop()
            yield encoded

    def _images(self, error: float, position: int) -> Images:
        match self._rule.kind:
            case RuleKind.MASKS:
                return Images.MASKS
            case RuleKind.EVERY:
                return Images.NONE if position % self._rule.number else Images.ALL
            case RuleKind.WORST:
                return Images.ALL if error >= self._least() else Images.NONE
            case _:
                return Images.ALL

    def _least(self) -> float:
        """Return the least ERR that can still be among the worst; it only ever rises."""
        worst = self._worst
        return worst[0][0] if len(worst) == self._rule.number else 0.0


def recorder_for(
    path: Path | None, layout: Layout, rule: RecordRule
) -> SelectiveRecorder | NullRecorder:
    """Return the recorder that a rule asks for; for no path, one that does nothing."""
    return NullRecorder() if path is None else SelectiveRecorder(path, layout, rule)

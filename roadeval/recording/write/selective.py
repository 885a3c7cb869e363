"""A recorder that keeps the images of some frames only, as a `RecordRule` says."""

from __future__ import annotations

import heapq
import shutil
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from operator import itemgetter
from pathlib import Path
from typing import Any, Final, Self

from roadeval.data import FrameResult
from roadeval.recording.layout import Layout, RecordingError, RecordRule, RuleKind
from roadeval.recording.write.encoding import EncodedFrame, Images, worst_error
from roadeval.recording.write.recorder import NullRecorder, Recorder


class SelectiveRecorder:
    """A recorder that keeps images by a rule; a context manager, as `Recorder`.

    The images of ``worst:K`` wait in a `PictureStore` beside the recording until the end, when it
    is known which they are.

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
        """Write everything that waits, images put aside included, after the last frame."""
        self._write_worst()
        self._recorder.flush()

    def finish(self, results: Mapping[str, str]) -> None:
        """Add what still waits and the results, and close the file."""
        self._write_worst()
        self._recorder.finish(results)

    def _rescue(self) -> None:
        """Write the worst frames so far of a run that is stopped, if the disk has room."""
        with suppress(RecordingError):
            self._write_worst()

    def _write_worst(self) -> None:
        # Not in place: a worker thread may look at the heap.
        self._worst = sorted(self._worst, key=itemgetter(1))
        self._recorder.write_images(self._put_aside())

    def _put_aside(self) -> Iterator[EncodedFrame]:
        """Yield the frames put aside, in order, and forget each: it can be called again."""
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
        """Return the least ERR that can still be among the worst."""
        worst = self._worst
        return worst[0][0] if len(worst) == self._rule.number else 0.0


def recorder_for(
    path: Path | None, layout: Layout, rule: RecordRule
) -> SelectiveRecorder | NullRecorder:
    """Return a recorder that keeps images by a rule; without a path one that does nothing."""
    return NullRecorder() if path is None else SelectiveRecorder(path, layout, rule)


class PictureStore:
    """Frames' images on disk by frame number, one file a frame, in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        self._folder: Final = folder
        self._sizes: Final[dict[int, tuple[EncodedFrame, dict[str, int]]]] = {}
        """Each frame without its images, and their sizes in bytes by path."""

    def put(self, encoded: EncodedFrame) -> None:
        """Keep a frame's images; its numbers and texts are left out.

        Raises
        ------
        RecordingError
            If they cannot be written.
        """
        with self._explained():
            self._folder.mkdir(exist_ok=True)
            self._file(encoded.number).write_bytes(b"".join(encoded.payloads.values()))
        sizes = {path: len(payload) for path, payload in encoded.payloads.items()}
        self._sizes[encoded.number] = EncodedFrame(encoded.number, encoded.stamp_ns, {}), sizes

    def drop(self, number: int) -> None:
        """Remove a frame."""
        with self._explained():
            self._file(number).unlink()
        del self._sizes[number]

    def get(self, number: int) -> EncodedFrame:
        """Return a frame, with its images alone.

        Raises
        ------
        RecordingError
            If they cannot be read.
        """
        bare, sizes = self._sizes[number]
        with self._explained(), self._file(number).open("rb") as file:
            return replace(bare, payloads={path: file.read(size) for path, size in sizes.items()})

    def clear(self) -> None:
        """Remove the folder, as far as that is possible."""
        shutil.rmtree(self._folder, ignore_errors=True)

    def _file(self, number: int) -> Path:
        return self._folder / str(number)

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise RecordingError(
                f"{self._folder}: the images put aside cannot be written or read ({error}); "
                "is the disk full?"
            ) from error

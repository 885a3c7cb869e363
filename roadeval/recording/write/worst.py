"""The images of the worst frames so far, which wait on disk until the end of a run."""

from __future__ import annotations

import heapq
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from operator import itemgetter
from pathlib import Path
from typing import Final

from roadeval.recording.layout import RecordingError
from roadeval.recording.write.encoding import EncodedFrame


class WorstFrames:
    """The images of the frames with the highest ERR, one file a frame, in a folder of its own.

    The folder is made for the first frame, and holds at most ``most`` of them.
    """

    def __init__(self, folder: Path, most: int) -> None:
        self._folder: Final = folder
        self._most: Final = most
        self._heap: list[tuple[float, int]] = []
        """ERR and minus the number of each frame, the least first."""
        self._sizes: Final[dict[int, tuple[EncodedFrame, dict[str, int]]]] = {}
        """By frame number: the frame without images, texts and numbers, and its images' sizes."""

    @property
    def least(self) -> float:
        """The least ERR that can still be among the worst; for any thread."""
        heap = self._heap
        return heap[0][0] if len(heap) == self._most else 0.0

    def offer(self, encoded: EncodedFrame) -> None:
        """Keep a frame's images if they are among the worst; of equals the earlier ones.

        Raises
        ------
        RecordingError
            If they cannot be written.
        """
        number = encoded.number
        with self._explained():
            self._folder.mkdir(exist_ok=True)
            self._file(number).write_bytes(b"".join(encoded.payloads.values()))
        sizes = {path: len(payload) for path, payload in encoded.payloads.items()}
        self._sizes[number] = EncodedFrame(number, encoded.stamp_ns, {}), sizes
        heapq.heappush(self._heap, (encoded.worst_error, -number))
        if len(self._heap) > self._most:
            dropped = -heapq.heappop(self._heap)[1]
            del self._sizes[dropped]
            with self._explained():
                self._file(dropped).unlink()

    def take(self) -> Iterator[EncodedFrame]:
        """Yield the frames in order, with their images alone, and forget each.

        After an interrupt it can be called again.

        Raises
        ------
        RecordingError
            If they cannot be read.
        """
        # Not in place: a worker thread may look at the heap.
        self._heap = sorted(self._heap, key=itemgetter(1))
        while self._heap:
            encoded = self._read(-self._heap[-1][1])
            self._heap.pop()
            yield encoded

    def _read(self, number: int) -> EncodedFrame:
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

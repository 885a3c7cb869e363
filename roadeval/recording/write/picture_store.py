"""Images of frames put aside on the disk, until it is known which of them are kept."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Final

from roadeval.recording.layout import RecordingError
from roadeval.recording.write.encoding import EncodedFrame


class PictureStore:
    """Frames' images by number, one file a frame, in a folder that is removed at the end.

    Parameters
    ----------
    folder
        Made when the first frame comes.
    """

    def __init__(self, folder: Path) -> None:
        self._folder: Final = folder
        self._sizes: Final[dict[int, tuple[EncodedFrame, dict[str, int]]]] = {}
        """Of each frame, all but its images, and the bytes of each of these by path."""

    def put(self, encoded: EncodedFrame) -> None:
        """Put a frame's images here; its numbers and texts are left out.

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
        """Return a frame that was put here and not dropped, with its images alone.

        Raises
        ------
        RecordingError
            If they cannot be read.
        """
        bare, sizes = self._sizes[number]
        with self._explained(), self._file(number).open("rb") as file:
            return replace(bare, payloads={path: file.read(size) for path, size in sizes.items()})

    def clear(self) -> None:
        """Remove the folder.

        What cannot be removed is only clutter, and no reason to fail.
        """
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

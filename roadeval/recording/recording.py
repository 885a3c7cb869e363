"""A recording read back without the log: its tables, images and notes."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Collection
from dataclasses import replace
from functools import cached_property
from numbers import Real
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from roadeval.data import ERRORS, VariantLayout
from roadeval.data.arrays import Plane
from roadeval.data.result import AnyArray
from roadeval.recording import layout as at
from roadeval.recording.layout import Layout, RecordingError, SeveralCamerasError
from roadeval.recording.rrd_file import TEXT, RrdFile, name_damage
from roadeval.results.facts import Facts, another_format
from roadeval.results.tables import read_table
from roadeval.runtime.documents import check_texts, read_json
from roadeval.version import VERSION

if TYPE_CHECKING:
    import pandas as pd

    from roadeval.recording.codecs import Codec


_CAMERA: Final = "EncodedImage:blob"


def rig_facts(path: Path) -> Facts | None:
    """Return the facts of all cameras together; None if the run ended before."""
    text = RrdFile(path).document(f"/results/{at.SUMMARY}")
    return None if text is None else Facts.parse(text, path)


def run_toml_in(path: Path) -> str | None:
    """Return the configuration of a recording's run as TOML; None if the run ended before."""
    return RrdFile(path).document("/results/run")


class Recording:
    """A recording on disk, the ``.rrd`` file that a replay wrote.

    A partial recording, of a run that was interrupted or killed, is read as far as it goes: then
    ``complete`` is False, and ``summary`` and tables may be empty. A `RecordingError` if another
    program or format has made it, or if it is of several cameras and ``camera`` names none.

    Examples
    --------
    >>> recording = Recording("out.rrd")
    >>> round(float(recording.frames.query("stage == 'post'").ERR.mean()), 2)
    0.04
    >>> recording.layer("filtered", "post", frame=12).shape
    (48, 64)
    """

    def __init__(self, path: str | PathLike[str], camera: str = "") -> None:
        self.path = Path(path)
        self._file = RrdFile(self.path)
        with name_damage(self.path, at.PROPERTIES):
            number = self._file.static(at.PROPERTIES, "format")
        with name_damage(self.path, at.CAMERAS):
            prefixes = read_json(self._file.document(at.CAMERAS) or "{}")
            cameras = {str(name): str(prefix) for name, prefix in prefixes.items()}
        if cameras and camera not in cameras:
            raise SeveralCamerasError(self.path, [*cameras])
        self._file.below = cameras.get(camera, "")
        text = self._file.document(at.LAYOUT)
        if text is None:
            lacking = f"holds no run, or its {self._file.below + at.LAYOUT} was dropped"
            ended = "the recording ends before its first frame"
            raise RecordingError(lacking if self._file.indexed else ended, where=self.path)
        with name_damage(self.path, at.LAYOUT):
            version = read_json(text).get("properties", {}).get("version")
            if number is None and version == VERSION:  # Rerun's filter drops the properties
                number = at.FORMAT
            if number != at.FORMAT:
                sentence = another_format(version, later=(number or 0) > at.FORMAT)
                raise RecordingError(sentence, where=self.path)
            self.layout = Layout.from_json(text)

    @property
    def complete(self) -> bool:
        """Whether the run reached its end."""
        return self._file.indexed and self.result(at.SUMMARY) is not None

    @property
    def variants(self) -> tuple[VariantLayout, ...]:
        """The variants with their stages and layers, without the baseline."""
        return self.layout.variants

    @property
    def frame_numbers(self) -> tuple[int, ...]:
        """The frames that have images, in order."""
        return tuple(self.stamps)

    @cached_property
    def stamps(self) -> dict[int, int]:
        """The header stamps of the frames that have images, in nanoseconds."""
        if (listed := self._file.document(at.SHOWN)) is not None:
            with name_damage(self.path, at.SHOWN):
                shown = {int(frame): int(stamp) for frame, stamp in json.loads(listed)}
            if not all(map(self._file.span(at.CAMERA).holds, shown)):
                part = "it is a part, as `rerun rrd split` makes it"
                problem = f"lacks images of frames that it lists: {part}"
                raise RecordingError(problem, where=self.path, remedy="give the whole recording")
            return shown
        stamps: dict[int, int] = {}
        for batch in self._file.batches(at.CAMERA, _CAMERA, static=False):
            columns = (batch.column(name).cast("int64") for name in (at.FRAME, at.STAMP))
            stamps |= zip(*(column.to_pylist() for column in columns), strict=True)
        return stamps

    @property
    def unsure(self) -> tuple[int, ...]:
        """The last frames of a partial recording: some of their layers may be missing."""
        return () if self.complete else self.frame_numbers[-at.MOST_WAITING :]

    def result(self, name: str) -> str | None:
        """Return the text of a result, such as ``summary``; None if the run ended before."""
        return self._file.document(f"/results/{name}")

    @cached_property
    def facts(self) -> Facts | None:
        """The facts of the result; None if the run ended before."""
        text = self.result(at.SUMMARY)
        facts = None if text is None else Facts.parse(text, self.path)
        with name_damage(self.path, at.SECONDS):
            seconds = read_json(self._file.document(at.SECONDS) or "{}")
        return replace(facts, seconds=seconds) if facts else None

    @property
    def summary(self) -> dict[str, Any]:
        """The content of ``summary.json``; empty if the run ended before."""
        return self.facts.as_dict() if self.facts else {}

    @cached_property
    def frames(self) -> pd.DataFrame:
        """The rows of ``frames.csv``."""
        return self.table("frames")

    def table(self, name: str, masks: Collection[tuple[str, str]] | None = None) -> pd.DataFrame:
        """Return the rows of a table by its name, of some masks or of all; empty if it has none."""
        if name in self.layout.tables:
            lines = (line for _, line in self._file.rows(f"/results/{name}", TEXT))
            text = "".join((self.layout.tables[name].rstrip(), "\n", *lines))
        else:
            text = self.result(name) or ""
        stated = self.facts.tables or None if self.facts else None
        return read_table(name, text, stated, masks=masks)

    def scalars(self, path: str) -> pd.Series[float]:
        """Return numbers by frame under an entity path, such as ``/timing/filtered/svm``."""
        import pandas as pd

        rows = dict(self._file.rows(path, "Scalars:scalars"))
        return pd.Series(rows, name=path, dtype=float).rename_axis(at.FRAME)

    def notes(self, frame: int) -> tuple[str, ...]:
        """Return the sentences about a frame."""
        return self._notes.get(frame, ())

    def image(self, frame: int) -> Plane:
        """Return the camera's image, ``(H, W, 3)`` uint8 RGB."""
        return self._array(at.CAMERA, frame)

    def truth(self, frame: int) -> Plane:
        """Return the truth, ``(H, W)`` uint8: 0 non-road, 1 road, 255 ignored."""
        return self._array(at.TRUTH_PATH, frame)

    def layer(self, variant: str, name: str, frame: int) -> AnyArray:
        """Return a layer of a variant on a frame.

        A `RecordingError` if there is no such layer, or none on this frame. A `DamagedError` if it
        differs from what was written.

        Returns
        -------
        array
            Masks and labels: ``(H, W)`` uint8, as the stage made them. Maps of numbers:
            ``(H, W)`` float32 in their own unit, approximate: NDI within 3 of 256 levels on
            average, distances at half the resolution. Images: ``(H, W, 3)`` uint8 RGB.
        """
        return self._array(f"/{variant}/{name}", frame)

    def is_whole(self, frame: int, *, scored: bool) -> bool:
        """Return whether a frame has its image and masks, and if scored its truth and errors."""
        paths = [at.CAMERA, *[at.TRUTH_PATH] * scored]
        for variant in self.variants:
            names = (*variant.stages, *[ERRORS.name] * scored)
            paths += (f"/{variant.name}/{name}" for name in names)
        images = (self._file.image(path, self._codecs[path].component, frame) for path in paths)
        return all(image is not None for image in images)

    @cached_property
    def _codecs(self) -> dict[str, Codec]:
        # Imported here: image decoders take time to import, and tables need none.
        from roadeval.recording.codecs import codecs_of

        return codecs_of(self.layout)

    @cached_property
    def _notes(self) -> dict[int, tuple[str, ...]]:
        notes = defaultdict[int, list[str]](list)
        for frame, note in self._file.rows(at.NOTES, "TextLog:text"):
            notes[frame].append(note)
        with name_damage(self.path, at.NOTES):
            for sentences in notes.values():
                check_texts(sentences)
        return {frame: tuple(sentences) for frame, sentences in notes.items()}

    def _array(self, path: str, frame: int) -> AnyArray:
        if path not in self._codecs:
            remedy = f"there are {', '.join(sorted(self._codecs))}"
            raise RecordingError(f"there is no {path}", where=self.path, remedy=remedy)
        number: object = frame
        if not (isinstance(number, Real) and number // 1 == number):
            raise TypeError(f"frame: a whole number, not {frame!r}")
        codec = self._codecs[path]
        with name_damage(self.path, f"{path} on frame {frame}"):
            payload = self._file.image(path, codec.component, frame)
            if payload is None:
                raise RecordingError(f"{path} has nothing on frame {frame}", where=self.path)
            return codec.decode(payload)

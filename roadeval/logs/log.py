"""A camera log: its topics, what to replay of it, and its frames."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt
from mcap.records import Channel, Schema

from roadeval.images import MAX_PIXELS, Limits
from roadeval.logs.container.damage import Damage, damage_of
from roadeval.logs.container.file import Container
from roadeval.logs.errors import BadRecord, LogError
from roadeval.logs.files import files_of
from roadeval.logs.frames import FrameStream
from roadeval.logs.masks.elsewhere import log_and_topic, of_folder, of_topic
from roadeval.logs.masks.folder import open_folder
from roadeval.logs.messages.decoders import kind_of, message_is_whole
from roadeval.logs.messages.schemas import TopicKind
from roadeval.logs.settings import LabelSettings, MaskSettings, TopicSettings
from roadeval.logs.span import Span
from roadeval.logs.times import NS
from roadeval.logs.topics.choose import named
from roadeval.logs.topics.description import TopicInfo, describe_topic
from roadeval.logs.topics.mask_source import MaskSource
from roadeval.logs.topics.reader import topic_readers
from roadeval.logs.topics.selection import Selection, settle
from roadeval.logs.topics.survey import survey
from roadeval.runtime.text import visible


def open_log(path: str | Path, *, keep_corrupt: bool = False, max_pixels: int = MAX_PIXELS) -> Log:
    """Open an MCAP file, or a rosbag2 folder of split files, as one log.

    Parameters
    ----------
    path
        File or folder.
    keep_corrupt
        Whether to use data whose checksum is wrong, and images of which a part is lost.
    max_pixels
        Most pixels of an image; one that has more is not decoded.

    Raises
    ------
    LogError
        If it is missing, unreadable, or no MCAP log.
    """
    path = Path(path)
    files, damage = files_of(path)
    try:
        return Log(path, files, damage, Limits(max_pixels, keep_corrupt))
    except (BadRecord, OSError) as error:
        raise LogError(f"{path}: {error}") from error


class Log:
    """An open log; close it, or use it in a ``with`` statement.

    Attributes
    ----------
    path, name
        Where it lies, and its name without folder and suffix, fit to be shown.
    topics
        Every topic, by name.
    damage
        What could not be read.
    start_ns, end_ns
        Log times of the first and the last message of all topics; 0 in an empty log.
    """

    def __init__(
        self,
        path: Path,
        files: Sequence[Path],
        damage: Sequence[Damage],
        limits: Limits,
    ) -> None:
        self.path = path
        self.name = visible(path.stem if path.is_file() else path.resolve().name)
        self._lost_files = damage
        self._limits = limits
        self._beside: list[Log] = []
        self._containers = [
            Container(f, _is_image, message_is_whole, keep_corrupt=limits.keep_damaged)
            for f in files
        ]
        self._readers = topic_readers(self._containers, limits, lacks_files=bool(damage))
        self.topics: tuple[TopicInfo, ...] = tuple(
            describe_topic(reader) for _, reader in sorted(self._readers.items())
        )
        starts = [topic.first_ns for topic in self.topics if topic.first_ns is not None]
        ends = [topic.last_ns for topic in self.topics if topic.last_ns is not None]
        self.start_ns = min(starts, default=0)
        self.end_ns = max(ends, default=0)

    @property
    def damage(self) -> tuple[Damage, ...]:
        """What could not be read, in the order of the files."""
        found = [damage for container in self._containers for damage in damage_of(container)]
        return tuple(
            replace(damage, log_start_ns=self.start_ns) for damage in (*self._lost_files, *found)
        )

    @property
    def losses(self) -> tuple[str, ...]:
        """The losses of the log, a sentence each; empty if nothing is lost.

        Damage inside chunks is found when they are read, or by `verify`.
        """
        for container in self._containers:
            container.verify_data()
        lost = [damage for damage in self.damage if damage.lossy]
        kept = [self._kept(topic) for topic in self.topics if topic.is_image]
        return (*map(str, lost), *kept) if lost else ()

    @property
    def size(self) -> int:
        """Bytes of all its files."""
        return sum(container.source.size for container in self._containers)

    def _kept(self, topic: TopicInfo) -> str:
        reader = self._readers[topic.name]
        total = max(reader.expected(), len(reader))
        known = f" of {total}" if total > reader.readable() else ""
        until = (topic.last_ns or self.start_ns) - self.start_ns
        return f"{topic.name}: {reader.readable()}{known} images kept, up to {until / NS:.3f} s"

    def verify(self) -> None:
        """Read the whole log once, so that `damage` knows all of it."""
        for container in self._containers:
            container.verify()

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of the file, or of the SHA-256 sums of a folder's files, in hexadecimal.

        The first time the whole log is read for it.

        Raises
        ------
        LogError
            If the disk fails.
        """
        digests = []
        for container in self._containers:
            digest = hashlib.sha256()
            try:
                container.read_all(digest.update)
            except BadRecord as error:
                raise LogError(f"{container.path}: {error}") from error
            digests.append(digest.hexdigest())
        if len(digests) == 1:
            return digests[0]
        return hashlib.sha256("".join(digests).encode()).hexdigest()

    def select(
        self,
        topics: TopicSettings | None = None,
        labels: LabelSettings | None = None,
        *,
        masks: Mapping[str, MaskSettings] | None = None,
        scale: float = 1.0,
        several: bool = False,
    ) -> Selection:
        """Settle what to replay.

        Parameters
        ----------
        topics
            What the user chose; the rest is chosen here, where the log leaves no doubt.
        labels
            What the values of the truth mean.
        masks
            Other methods' masks that lie beside the log, by name. Another log that holds some
            stays open as long as this one.
        scale
            Of the frames that `frames` returns, with their labels, to the logged ones' width and
            height.
        several
            Whether the labels are given for several logs at once, see `understand`.

        Raises
        ------
        LogError
            If a topic is missing or the choice is not plain, a label value does not occur or
            cannot be understood, a label image has another size, or no mask belongs to a frame.
        """
        topics, labels = topics or TopicSettings(), labels or LabelSettings()
        try:
            found = settle(self.topics, self._readers, topics, labels, scale, several=several)
            beside = {name: self._masks(name, own, found) for name, own in (masks or {}).items()}
        except LogError as error:
            raise LogError(f"{self.path.name}: {error}") from error
        return replace(found, elsewhere=beside)

    def _masks(self, name: str, settings: MaskSettings, selection: Selection) -> MaskSource:
        """Settle masks that lie beside the log; errors begin with their variant's name."""
        images, place = self._readers[selection.image.name], log_and_topic(settings.path)
        try:
            if place is None:
                folder = open_folder(Path(settings.path), settings, self._limits)
                return of_folder(folder, settings, selection, images)
            limits = self._limits
            other = open_log(
                place[0], keep_corrupt=limits.keep_damaged, max_pixels=limits.max_pixels
            )
            self._beside.append(other)
            topic = named(other.topics, place[1], "topic").name
            truth = selection.truth and selection.truth.topic.name
            if topic == truth and other.path.resolve() == self.path.resolve():
                raise LogError(f"{topic} is the truth that it is held against")
            reader = other._readers[topic]
            return of_topic(
                reader,
                settings,
                selection,
                images,
                log=other.name,
                digest=lambda: other.sha256,
            )
        except LogError as error:
            told = str(error).replace("`labels.", f"`masks.{name}.labels.")
            raise LogError(f"`masks` {name}: {told}") from error

    def oddities(self, selection: Selection) -> tuple[str, ...]:
        """Go through all selected images, without decoding them: see `LogDescription.oddities`."""
        image = selection.image
        return tuple(
            f"{image.name}: {oddity}" for oddity in survey(self._readers[image.name], image.size)
        )

    def frames(self, selection: Selection, span: Span | None = None) -> FrameStream:
        """Read the selected frames, by log time; each call begins anew.

        Raises
        ------
        LogError
            If the span holds no frame.
        """
        span = span or Span()
        times = self._readers[selection.image.name].log_times
        start = span.start.resolve(self.start_ns) if span.start else None
        end = span.end.resolve(self.start_ns) if span.end else None
        first = 0 if start is None else int(np.searchsorted(times, start))
        last = len(times) if end is None else int(np.searchsorted(times, end))
        if first >= last:
            raise LogError(self._empty(times))
        return FrameStream(self._readers, selection, span, range(first, last))

    def _empty(self, times: npt.NDArray[np.int64]) -> str:
        if not len(times):
            return f"{self.path.name}: the image topic holds no message"
        begin, end = ((int(time) - self.start_ns) / NS for time in (times[0], times[-1]))
        return (
            f"{self.path.name}: no frame in this range; the images lie from {begin:.3f} to "
            f"{end:.3f} seconds after the log's start ({times[0]} to {times[-1]} ns)"
        )

    def close(self) -> None:
        """Close the log's files, and those of logs beside it."""
        for container in self._containers:
            container.close()
        for other in self._beside:
            other.close()

    def __enter__(self) -> Log:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def _is_image(channel: Channel, schema: Schema | None) -> bool:
    return kind_of(channel, schema) is not TopicKind.OTHER

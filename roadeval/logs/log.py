"""A camera log: its topics, its damage, the choice of what to replay, and its frames."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from itertools import chain, islice
from operator import itemgetter
from pathlib import Path
from typing import IO, Any

import numpy as np

from roadeval.data.words import counted
from roadeval.images.formats import Limits
from roadeval.logs.container.file import Container, Damage, containers_in, damage_of
from roadeval.logs.container.outline import outline_of
from roadeval.logs.container.records import MAGIC
from roadeval.logs.errors import BadRecord, FrameError, LogError, UnclearLabelsError
from roadeval.logs.files import content_problem, files_of
from roadeval.logs.frames import (
    TRUTH,
    WHITE,
    FrameStream,
    Selection,
    labelled_numbers,
    look_at_images,
    settle,
)
from roadeval.logs.messages.encoding import TopicKind
from roadeval.logs.messages.pictures import kind_of, message_stamp
from roadeval.logs.settings import NS, LogConfig, MaskSettings, parse_time
from roadeval.logs.topics.calibration import image_names
from roadeval.logs.topics.choose import check_names, choose_image, choose_truth, named
from roadeval.logs.topics.reader import SMALL, TopicInfo, TopicReader, describe_topic, topic_readers
from roadeval.logs.truth.audits import without_corrections
from roadeval.logs.truth.label_files import labels_in
from roadeval.logs.truth.meaning import (
    ClassMap,
    LabelSource,
    class_names,
    log_and_topic,
    source_beside_log,
)
from roadeval.logs.truth.named_labels import find_keys, shown_name
from roadeval.logs.truth.pairing import LOOKED_AT, Clock
from roadeval.logs.writing.writer import LogWriter
from roadeval.runtime.sentence import Sentence, Setting, name_settings
from roadeval.runtime.text import visible


@dataclass(slots=True)
class Traffic:
    """The requests to a server so far, and the bytes of a file in its answers."""

    requests: int = 0
    bytes: int = 0
    total: int = 0
    """The size of the file."""

    def __str__(self) -> str:
        return f"{self.bytes / 1e6:.1f} of {self.total / 1e6:.1f} MB in {self.requests:,} requests"


@dataclass(frozen=True, eq=False)
class RemoteLog:
    """A remote log, which is one file."""

    source: str
    """Its URL, without secrets."""
    path: Path
    """Its name."""
    file: IO[bytes]
    traffic: Traffic


def open_log(
    path: str | Path | RemoteLog,
    config: LogConfig | None = None,
    *,
    every_topic: bool = False,
    by_summary: bool = False,
) -> Log:
    """Open an MCAP file, or a rosbag2 folder of split files, as one log.

    By default messages that a replay does not use are only counted. With ``by_summary`` only the
    first messages of a log that lies elsewhere are read, if its summary suffices, see `outline_of`.
    A `LogError` if it is missing, unreadable, or no MCAP log.
    """
    config = config or LogConfig()
    if isinstance(path, RemoteLog):
        traffic, opened, source, path = path.traffic, path.file, path.source, path.path
        if problem := content_problem(path, opened):
            raise LogError(problem, where=path)
        files, damage = [path], list[Damage]()
    else:
        traffic, opened, source, path = None, None, str(path), Path(path)
        files, damage = files_of(path)
    states: dict[Path, tuple[int, ...]] = {}
    for file in files if opened is None else ():
        with suppress(OSError), file.open("rb") as content:
            content.seek(-len(MAGIC), os.SEEK_END)
            if content.read() == MAGIC:  # no recorder still writes the file
                states[file] = _state(os.fstat(content.fileno()))
    frames = config.frames
    limits = Limits(frames.max_pixels, turn=not frames.unturned, full_range=frames.full_range)

    def is_wanted(*channel: Any) -> bool:
        return every_topic or kind_of(*channel) is not TopicKind.OTHER

    def needs_many(*channel: Any) -> bool:
        return kind_of(*channel) is TopicKind.TRANSFORMS

    try:
        outline = None
        if by_summary and opened is not None:
            outline = outline_of(path, opened, is_wanted, needs_many, message_stamp)
        containers = (
            [outline]
            if outline
            else [
                container
                for file in files
                for container in containers_in(file, is_wanted, message_stamp, opened=opened)
            ]
        )
        readers = topic_readers(containers, limits, lacks_files=bool(damage))
        topics = tuple(describe_topic(reader) for _, reader in sorted(readers.items()))
    except (BadRecord, OSError) as error:
        raise LogError(str(error), where=path) from error
    name = path.stem if path.is_file() or opened is not None else path.resolve().name
    facts = path, source, visible(name), config, topics, readers, containers, damage, states
    return Log(*facts, by_summary=outline is not None, traffic=traffic)


def _state(facts: os.stat_result) -> tuple[int, ...]:
    return facts.st_ino, facts.st_size, facts.st_mtime_ns


@dataclass(frozen=True, eq=False)
class Log:
    """An open log; close it, or use it in a ``with`` statement."""

    path: Path
    source: str
    """Its path, or its URL without secrets."""
    name: str
    """Its name without folder and suffix; control characters are escaped."""
    config: LogConfig
    """The settings by which it is read."""
    topics: tuple[TopicInfo, ...]
    """Every topic, by name."""
    readers: Mapping[str, TopicReader]
    """The messages of each topic."""
    containers: Sequence[Container]
    """Its files; several logs may follow each other in one."""
    lost_files: Sequence[Damage]
    """Files that cannot be read at all."""
    states: Mapping[Path, tuple[int, ...]]
    """Inode, bytes and time of change (ns) of each complete file when it was opened."""
    of_rig: bool = False
    """Whether other cameras of the log are replayed, too."""
    beside: list[Log] = field(default_factory=list)
    """Other logs that hold labels; they are closed with this one."""
    by_summary: bool = False
    """Whether only the first messages are read, see `outline_of`."""
    traffic: Traffic | None = None
    """The requests and bytes that a log elsewhere has cost so far; None for one on a disk."""

    @cached_property
    def start_ns(self) -> int:
        """Log time of the first message of all topics; 0 in an empty log."""
        starts = (topic.first_ns for topic in self.topics if topic.first_ns is not None)
        return min(starts, default=0)

    @cached_property
    def end_ns(self) -> int:
        """Log time of the last message of all topics; 0 in an empty log."""
        ends = (topic.last_ns for topic in self.topics if topic.last_ns is not None)
        return max(ends, default=0)

    @property
    def damage(self) -> tuple[Damage, ...]:
        """Damage that is known so far, in the order of the files."""
        damages = [*self.lost_files, *chain(*map(damage_of, self.containers))]
        return tuple(replace(damage, log_start_ns=self.start_ns) for damage in damages)

    @property
    def losses(self) -> tuple[str, ...]:
        """The losses of the log, a sentence each.

        Damage inside chunks is found when they are read, or by `verify`. The checksum of all data
        is checked if some chunks have none of their own, or the log has at most `SMALL` bytes. A
        `LogError` if a file has changed since it was opened.
        """
        for file, before in self.states.items():
            with suppress(OSError):
                now = _state(file.stat())
                if now != before and now[0] == before[0]:  # one of another inode is not read
                    raise LogError("it changed while it was read", where=file, remedy="run again")
        for container in self.containers:
            if self.size <= SMALL or not container.is_covered:
                container.verify_data()
        lost = [str(damage) for damage in self.damage if damage.lossy]
        for topic in (topic for topic in self.topics if lost and topic.is_image):
            reader = self.readers[topic.name]
            total, readable = max(reader.expected(), len(reader)), reader.readable()
            of_total = f" of {total}" if total > readable else ""
            until = ((topic.last_ns or self.start_ns) - self.start_ns) / NS
            lost.append(f"{topic.name}: {readable}{of_total} images kept, up to {until:.3f} s")
        return tuple(lost)

    @property
    def size(self) -> int:
        """Bytes of all its files."""
        return sum(len(container.source) for container in self.containers)

    @cached_property
    def digest(self) -> str:
        """The log's identity in hexadecimal, the same wherever the log lies.

        It is the SHA-256 of sizes, of the places and log times of messages, and of the chunks' own
        checksums; no message is read. A `LogError` if the disk fails.
        """
        try:
            parts = [container.fingerprint() for container in self.containers]
        except BadRecord as error:
            raise LogError(str(error), where=self.path) from error
        return hashlib.sha256(b"\n".join(parts)).hexdigest()

    def verify(self, on_bytes: Callable[[int, int], object] | None = None) -> str | None:
        """Read the log completely, so that all damage is known; return its SHA-256 in hexadecimal.

        For a folder it is the SHA-256 of its files' SHA-256; None if the disk fails. ``on_bytes``
        is called now and then with the bytes that were read, and with the bytes in total.
        """
        sums = {container.path: hashlib.sha256() for container in self.containers}
        done = 0
        for container in self.containers:
            try:
                for size, block in container.verify():
                    sums[container.path].update(block)
                    done += size
                    if on_bytes is not None:
                        on_bytes(done, 2 * self.size)  # the log is read by chunks, then in blocks
            except BadRecord:
                return None
        parts = [digest.hexdigest() for digest in sums.values()]
        return parts[0] if len(parts) == 1 else hashlib.sha256("".join(parts).encode()).hexdigest()

    def select(self) -> Selection:
        """Return what to replay: the topics that the settings name, else the only candidates.

        Another log that holds masks stays open as long as this one. A `LogError` if a topic is
        missing or the choice is doubtful, a label value does not occur or has no clear meaning, a
        label image has another size, or no mask belongs to a frame.
        """
        try:
            config, audits = without_corrections(self.config)
            selection = settle(self.topics, self.readers, config, of_rig=self.of_rig)
            if (place := config.truth).path:
                settings = MaskSettings(**vars(place), labels=config.labels)
                truth = self._beside_log(settings, selection, config.topics.sync_offset_ms)
                selection = replace(selection, labels={TRUTH: truth, **selection.labels})
            if audits and selection.truth is not None:
                truth = self._with_corrections(selection.truth, audits, selection)
                selection = replace(selection, labels={**selection.labels, TRUTH: truth})
            masks = {name: self._masks(name, m, selection) for name, m in self.config.masks.items()}
        except LogError as error:
            raise LogError.of(error, self.path.name) from error
        return replace(selection, labels={**selection.labels, **masks})

    def _with_corrections(
        self, truth: LabelSource, folders: Sequence[str], selection: Selection
    ) -> LabelSource:
        """Return the truth with the labels in some folders in place of its own."""
        sources = [self._beside_log(MaskSettings(path=path), selection) for path in folders]
        notes = tuple(
            f"the labels of {counted(len(source.pictures), 'frame')} are from {source.where}; "
            f"all others are those of {truth.where}"
            for source in sources
        )

        def digest() -> str:
            parts = [source.digest() for source in (truth, *sources) if source.digest]
            return hashlib.sha256(" ".join(parts).encode()).hexdigest()

        corrections = tuple(sources)
        return replace(truth, digest=digest, notes=truth.notes + notes, corrections=corrections)

    def _masks(self, name: str, settings: MaskSettings, selection: Selection) -> LabelSource:
        """Read masks that lie beside the log; their messages name the settings of their variant."""

        def of_variant(setting: str) -> Setting:
            table, _, key = setting.partition(".")
            tables = {"labels": f"masks.{name}.labels", "truth": f"masks.{name}"}
            return Setting(f"{tables[table]}.{key}" if table in tables else setting)

        try:
            if (log := log_and_topic(settings.path)[0]) == settings.path:
                remedy = f"name a topic of it, as {log}:/topic"
                raise LogError("a log", where=log, remedy=remedy)
            try:
                masks = self._beside_log(settings, selection)
            except UnclearLabelsError:
                if not selection.names:  # else it may be a result of KITTI's road benchmark
                    raise
                masks = self._beside_log(replace(settings, threshold=0.5), selection)
                masks = replace(masks, notes=(*masks.notes, f"taken for {masks.meaning.words}"))
            if selection.truth is not None and masks.where == selection.truth.where:
                raise LogError(f"{masks.where} is the truth that it is scored against")
        except LogError as error:
            refused = error.rename_settings(of_variant)
            if isinstance(error, UnclearLabelsError):
                or_threshold = "{}; or, for confidences, their threshold"
                refused.remedy = Sentence(or_threshold, refused.remedy)
            raise LogError.of(refused, Sentence("{masks} {}", name)) from error
        notes, meant = (
            tuple(name_settings(note, of_variant) for note in notes)
            for notes in (masks.notes, masks.meaning.notes)
        )
        return replace(masks, meaning=replace(masks.meaning, notes=meant), notes=notes)

    def _beside_log(
        self, settings: MaskSettings, selection: Selection, offset_ms: float = 0.0
    ) -> LabelSource:
        """Read labels of a folder, of an annotation tool's file, or of another log."""
        log, topic = log_and_topic(settings.path)
        camera, images = selection.camera, selection.camera.images
        if log is None:
            origin = labels_in(Path(settings.path), camera.topic.size, settings)
            if settings.names == "*" and settings.images is None:
                names = [shown_name(label.path, settings.path) for label in origin.labels]
                check_names(names, camera.topic, self.topics)
            count = len(images) if images.sure == images.expected() == len(images) else None
            paths = [*map(Path, selection.names)]
            labels = find_keys(origin, settings.path, settings, images.limits, count, named=paths)
            source = source_beside_log(
                labels, settings, camera, lambda: labels.digest, offset_ms=offset_ms
            )
            if self.config.topics.frame_id is None or labels.by != "number":
                return source
            doubt = (
                "the numbers count all images of {}, also those that {topics.frame_id} leaves out"
            )
            return replace(source, notes=(*source.notes, Sentence(doubt, images.name)))
        other = open_log(log, LogConfig(frames=self.config.frames))
        self.beside.append(other)
        if topic is None:
            choice = choose_truth(other.topics, camera.topic, None, settings.labels)
            if choice.topic is None:
                raise LogError(choice.why, where=log, remedy=f"name its topic, as {log}:/topic")
            topic = choice.topic.name
        reader = other.readers[named(other.topics, topic, "truth.path").name]
        name = "" if other.path.resolve() == self.path.resolve() else other.name
        return source_beside_log(
            *(reader, settings, camera, lambda: other.digest, name),
            offset_ms=offset_ms,
            names=class_names(reader.name, other.topics, other.readers),
        )

    @property
    def has_camera(self) -> bool:
        """Whether it is clear which topic has the camera's images."""
        try:
            settings = self.config.topics
            choose_image(self.topics, settings.image, settings.of_labels)
        except LogError:
            return False
        return True

    def for_camera(self, config: LogConfig) -> Log:
        """Return the same open log with the settings of one camera of a rig."""
        return replace(self, config=config, of_rig=True)

    def frames(
        self, selection: Selection, only: Collection[int] | None = None, *, labelled: bool = False
    ) -> FrameStream:
        """Read the frames of a selection by log time; each call begins anew.

        ``only`` are the numbers of the frames to read; ``labelled`` reads labelled frames only. A
        `LogError` if there is none in the range.
        """
        settings, images, truth = self.config.frames, selection.camera.images, selection.truth
        times, bounds = images.log_times, [0, len(images)]
        for place, time in enumerate((settings.start, settings.end)):
            if time is not None:
                bounds[place] = int(np.searchsorted(times, parse_time(time, self.start_ns)))
        first, last = bounds
        if first >= last:
            begin, end = ((int(time) - self.start_ns) / NS for time in (times[0], times[-1]))
            raise LogError(
                "no frame in this range",
                where=self.path.name,
                remedy=f"the images lie from {begin:.3f} to {end:.3f} seconds after the log's "
                f"start ({times[0]} to {times[-1]} ns)",
            )
        numbers: Sequence[int] = range(first, last)
        most = settings.every * (settings.max_frames or last)
        if (camera := self.config.topics.frame_id) is not None:
            of_camera = (number for number in numbers if images.frame_id(number) == camera)
            numbers = [*(of_camera if settings.labelled else islice(of_camera, most))]
            if not numbers:
                has = f"the first has {images.frame_id(first) or 'none'}"
                problem = f"no image of the range has {camera}; {has}"
                raise LogError(problem, where=self.path.name, setting="topics.frame_id")
        if settings.labelled:
            numbers = [*islice(labelled_numbers(truth, images, numbers), most)] if truth else []
            if not numbers:
                why = selection.no_truth or "no frame of the range has road truth"
                problem = Sentence("leaves no frame: {}", why)
                raise LogError(problem, where=self.path.name, setting="frames.labelled")
        numbers = numbers[:: settings.every][: settings.max_frames]
        if only is not None:
            numbers = [number for number in numbers if number in only]
        return FrameStream(selection, last - first, numbers, labelled=labelled)

    def write_excerpt(self, topic: str, first: int, last: int, path: Path) -> None:
        """Write the messages of all topics from 2 s before an image to the end of a later one.

        Earlier messages that a replay needs, such as calibrations, come first. Messages that cannot
        be read are left out, see `losses`. A `LogError` if the file cannot be written.
        """
        images, times = self.readers[topic], self.readers[topic].log_times.tolist()
        end = min([times[last] + NS, *(time - 1 for time in times[last + 1 : last + 2])])
        span = times[first] - 2 * NS, end, images.stamp(last)
        names = image_names(self.topics, self.readers)[sum(time < span[0] for time in times) :]
        messages = [
            (max(int(reader.log_times[position]), span[0]), reader, position)
            for about in self.topics
            if (reader := self.readers[about.name]) and about.kind is not TopicKind.NAMES
            for position in reader.span(about.kind, *span)
        ]
        with LogWriter(path) as excerpt:
            if names:
                excerpt.names(names, max(span[0], 0))
            for log_time, reader, position in sorted(messages, key=itemgetter(0)):
                with suppress(FrameError):
                    for (_, channel, schema, _), message in reader.messages(position):
                        excerpt.copy(channel, schema, message, log_time)

    def close(self) -> None:
        """Close the files of the log, and of logs beside it."""
        for container in self.containers:
            container.close()
        for other in self.beside:
            other.close()

    def __enter__(self) -> Log:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


@dataclass(frozen=True)
class LogDescription:
    """The content of a log, its damage, and the choices of a replay."""

    path: str
    bytes: int
    """The size of its files."""
    start_ns: int
    end_ns: int
    """Log times of its first and last message."""
    topics: tuple[TopicInfo, ...]
    picks: tuple[str, ...]
    """The topics that a replay would choose and why, a sentence each."""
    problem: str
    """Why a replay could not choose; empty if it could."""
    damage: tuple[str, ...]
    losses: tuple[str, ...]
    """The damage of the files, and the losses by it, a sentence each."""
    digest: str
    """The log's identity, see `Log.digest`; empty if only its first messages were read."""
    verified: bool
    """Whether the log was read completely; if not, damage inside chunks is unknown."""
    sha256: str | None
    """SHA-256 of a log that was read completely, see `Log.verify`."""
    by_summary: bool = False
    """Whether only the summary and the first messages were read: damage, gaps, and values of labels
    that occur later are unknown then."""
    traffic: Traffic | None = None
    """The requests and bytes that a log elsewhere has cost so far; None for one on a disk."""
    misfits: tuple[str, ...] = ()
    """Reasons why truth beside the log does not fit its images, a sentence each."""

    def as_dict(self) -> dict[str, Any]:
        """Return the description as JSON objects."""
        return asdict(self)


def describe(
    path: str | Path | RemoteLog,
    config: LogConfig | None = None,
    *,
    verify: bool = False,
    on_bytes: Callable[[int, int], object] | None = None,
    by_summary: bool = True,
) -> LogDescription:
    """Describe a log by its summary and indexes, and what a replay would choose of it.

    With ``verify``, or if it has at most `SMALL` bytes, it is read completely to find all damage;
    ``on_bytes`` is as in `Log.verify`. Without ``verify`` only the summary and the first messages
    of a log that lies elsewhere are read, if they suffice. A `LogError` if the log is missing,
    unreadable, or no MCAP log.
    """
    config = config or LogConfig()
    # Labels beside the log, and the images of one of several cameras, may be anywhere in it.
    needs_all = verify or config.truth.path or config.masks or config.topics.frame_id is not None
    with open_log(path, config, by_summary=by_summary and not needs_all) as log:
        picks, problem = tuple[str, ...](), ""
        is_certain = True
        try:
            selection = log.select()
            picks = (*selection.reasons, *look_at_images(selection))
            camera, meanings = selection.camera, [s.meaning for s in selection.labels.values()]
            is_certain = (
                (camera.clock is Clock.STAMP or len(camera.images) >= LOOKED_AT)
                and selection.white in (None, 1, WHITE)
                and all(isinstance(m, ClassMap) and m.shows_road for m in meanings)
            )
        except LogError as error:
            problem = error.sentence
            # More labels make their values no clearer, but another problem may vanish with them.
            is_certain = isinstance(error.__cause__, UnclearLabelsError) or not log.has_camera
        if log.by_summary and (log.damage or not is_certain):
            return describe(path, config, by_summary=False)
        verified = not log.by_summary and (verify or log.size <= SMALL)
        sha256 = log.verify(on_bytes) if verified else None
        return LogDescription(
            path=log.source,
            bytes=log.size,
            start_ns=log.start_ns,
            end_ns=log.end_ns,
            topics=log.topics,
            picks=picks,
            problem=problem,
            damage=tuple(map(str, log.damage)),
            losses=log.losses,
            digest="" if log.by_summary else log.digest,
            verified=verified,
            sha256=sha256,
            by_summary=log.by_summary,
            traffic=path.traffic if isinstance(path, RemoteLog) else None,
        )

"""The selection of a replay, and its frames: read in bounded memory, decoded in any thread."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from heapq import heappushpop
from itertools import chain, islice
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from roadeval.data import ROAD, Calibration, Frame, TruthClass
from roadeval.data.words import first_of
from roadeval.geometry.ground import Ground, ground_of
from roadeval.images.decoding import orientation_of
from roadeval.images.formats import format_of
from roadeval.logs.errors import BadMessage, FrameError, LogError, LostMessageError
from roadeval.logs.messages.encoding import TopicKind
from roadeval.logs.messages.pictures import CompressedPicture, Picture, PictureSequence, Video
from roadeval.logs.messages.pixels import deep_samples, to_rgb
from roadeval.logs.settings import LabelSettings, LogConfig, MaskSettings
from roadeval.logs.topics.calibration import calibration_of, image_names, is_rectified, lens_at
from roadeval.logs.topics.choose import Choice, choose_image, choose_shadow, choose_truth, named
from roadeval.logs.topics.reader import UNREADABLE, TopicInfo, TopicReader
from roadeval.logs.truth.meaning import (
    ClassMap,
    Labels,
    LabelSource,
    Meaning,
    check_size,
    class_names,
    meaning_of,
    read_or_error,
    samples,
    size_problem,
    undecodable,
)
from roadeval.logs.truth.pairing import (
    LOOKED_AT,
    REACH,
    Camera,
    Clock,
    NamedLabels,
    Partners,
    by_time,
    clock_of,
    frames_of,
    tolerance,
)
from roadeval.runtime.sentence import Sentence
from roadeval.runtime.text import visible

TRUTH: Final = "/truth"
SHADOW: Final = "/shadow"
"""Names of road truth and true shadow among labels; no mask's name begins with a slash."""


@dataclass(frozen=True, eq=False)
class Selection:
    """Topics and rules of a replay."""

    camera: Camera
    """The camera's images, and how labels are paired with them."""
    image_why: str
    """Why that camera was chosen."""
    labels: Mapping[str, LabelSource]
    """`TRUTH`, `SHADOW`, and other systems' road masks by name, those in the log first."""
    scale: float = 1.0
    """Scale of the frames that are read, relative to the camera's; at most 1."""
    no_truth: str = ""
    """Why there is no road truth."""
    calibration: Calibration | None = None
    """The camera's calibration, for images of the logged size."""
    calibration_why: str = ""
    """Remarks on the calibration, or why the log's calibration is not used."""
    ground: Ground | None = None
    """The ground before the camera, for images of the logged size."""
    ground_why: str = ""
    """The source of the ground, or what is missing for it."""
    white: float | None = None
    """The sample that is white in the camera's images; None for images of 8 bits."""
    names: Sequence[str] = ()
    """The names of all images, if the log has them: each has its own calibration then."""
    lens_at: Callable[[int], Calibration | None] = lambda _: None
    """Read an image's own calibration, by its log time."""

    @property
    def image(self) -> TopicInfo:
        """The camera's topic."""
        return self.camera.topic

    @property
    def truth(self) -> LabelSource | None:
        """Road truth."""
        return self.labels.get(TRUTH)

    @property
    def classes(self) -> list[TruthClass]:
        """The classes of the truth that have occurred, in the order of `Frame.classes`' codes."""
        meaning = self.truth.meaning if self.truth else None
        return meaning.classes if isinstance(meaning, ClassMap) else []

    @property
    def shadow(self) -> LabelSource | None:
        """Truth of shadow."""
        return self.labels.get(SHADOW)

    @property
    def masks(self) -> dict[str, LabelSource]:
        """Other systems' road masks by name."""
        return {name: s for name, s in self.labels.items() if name not in (TRUTH, SHADOW)}

    def digests(self) -> dict[str, str]:
        """Return the SHA-256 of the labels beside the log: of ``truth``, and of masks by name."""
        return {
            name.removeprefix("/"): source.digest()
            for name, source in self.labels.items()
            if source.digest
        }

    @property
    def size(self) -> tuple[int, int] | None:
        """Width and height of the frames that are read, if known."""
        return None if self.image.size is None else scaled_size(self.image.size, self.scale)

    @property
    def ground_as_read(self) -> Ground | None:
        """The ground, for frames of the size in which they are read."""
        return self.ground.scaled(*self.size) if self.ground and self.size else None

    @property
    def notes(self) -> tuple[str, ...]:
        """Warnings about the camera's images, a sentence each."""
        notes = list[str]()
        if self.white not in (None, 1, WHITE):
            white = "a sample of {} is white; {frames.white} sets another"
            notes.append(Sentence(white, f"{self.white:g}"))
        if self.image.turned != 1:
            how = "turned, as their EXIF orientation or display matrix asks"
            what = "its images are {}; {frames.unturned} leaves them as stored"
            if not self.camera.images.limits.turn:
                what = "its images are as stored, and would be {}, by viewers and annotation tools"
            notes.append(Sentence(what, how))
        return tuple(notes)

    def among_truth(self, numbers: Sequence[int]) -> Sequence[int]:
        """Return the frames that lie in the range of the truth, by keys and times of the labels."""
        if self.truth is None:
            return numbers
        labels, times = self.truth.pictures, self.camera.images.log_times
        if isinstance(labels, NamedLabels) and labels.by != "stamp":
            keys = frozenset(labels.log_times.tolist())
            return [number for number in numbers if number in keys] or numbers
        first, last = np.searchsorted(times, labels.log_times[[0, -1]])
        return [number for number in numbers if first <= number <= last] or numbers

    @property
    def reasons(self) -> tuple[str, ...]:
        """The topics that were chosen and why, a sentence each."""
        about = Sentence("; ").join((self.image_why, *self.notes))
        lines: list[str] = [Sentence("image: {} ({})", self.image.name, about)]
        for name, source in self.labels.items():
            what = {TRUTH: "truth", SHADOW: "shadow truth"}.get(name, f"mask {name}")
            lines.append(f"{what}: {source.where} ({source.why}; {source.meaning.words})")
            notes = (*source.notes, *source.meaning.notes)
            lines += [Sentence("{}: {}", what, note) for note in notes]
        if lens := self.calibration:
            place = f", mounted in {lens.mounting.parent}" if lens.mounting else ""
            model = lens.model or f"{'a nameless' if lens.bends else 'no'} distortion"
            lines.append(f"calibration: {lens.topic} ({model}{place})")
        if self.calibration_why:
            none = "" if lens else "no "
            lines.append(Sentence("{}calibration: {}", none, self.calibration_why))
        if self.ground_why:
            lines.append(self.ground_why)
        if self.no_truth:
            lines.append(Sentence("no truth: {}", self.no_truth))
        if (clock := self.camera.clock) is not Clock.STAMP:
            lines.append(f"the header stamps are all zero or equal; used in place of them: {clock}")
        return tuple(lines)


def scaled_size(size: tuple[int, int], scale: float) -> tuple[int, int]:
    """Scale a width and height, to whole pixels."""
    width, height = (max(1, round(length * scale)) for length in size)
    return width, height


def settle(
    topics: Sequence[TopicInfo],
    readers: Mapping[str, TopicReader],
    config: LogConfig,
    *,
    of_rig: bool = False,
) -> Selection:
    """Return the selection of a log's topics; `choose_truth` explains ``of_rig``.

    Errors are as in `Log.select`.
    """
    settings = config.topics
    topics = [_with_frame_id(topic, readers[topic.name], settings.frame_id) for topic in topics]
    image, why = choose_image(topics, settings.image, settings.of_labels)
    if image.problem or "depth" in image.format.lower():
        _check_readable(readers[image.name], image)
    if config.truth.path:
        truth = Choice(None, "")
    else:
        truth = choose_truth(topics, image, settings.truth, config.labels, of_rig=of_rig)
    choices = {TRUTH: truth, SHADOW: choose_shadow(topics, image, settings.shadow)}
    if truth.topic == image:
        raise LogError(f"{image.name} is the image's own topic", setting="topics.truth")
    for name, topic in settings.masks.items():
        setting = f"topics.masks.{name}"
        choices[name] = Choice(named(topics, topic, setting), "asked for")
        if choices[name].topic == truth.topic:
            raise LogError(f"{topic} is the truth that it is scored against", setting=setting)
    images = readers[image.name]
    most_ns = tolerance(images, settings.sync_tolerance_ms)
    camera = Camera(images, image, clock_of(images), most_ns, settings.resize_truth)
    labels = {}
    for name, (label_topic, reason) in choices.items():
        if label_topic is not None:
            is_truth, reader = name == TRUTH, readers[label_topic.name]
            pairing = by_time(reader, camera, settings.sync_offset_ms if is_truth else 0.0)
            notes = check_size(label_topic.size, reader, 0, camera, pairing)
            values = MaskSettings(labels=config.labels if is_truth else LabelSettings())
            shown = "shadow" if name == SHADOW else "road"
            names = class_names(reader.name, topics, readers) if is_truth else {}
            meaning = meaning_of(reader, values, shown=shown, names=names)
            notes += (pairing.note,) if pairing.note else ()
            source = LabelSource(reader.name, reader, meaning, pairing, reason)
            labels[name] = replace(source, notes=notes)
    calibration = calibration_of(image, topics, readers)
    if any(calibration) and image.turned != 1 and camera.images.limits.turn:
        reason = "it is of the sensor's rows, and the images are turned ({frames.unturned})"
        calibration = None, Sentence(reason)
    ground, ground_why = ground_of(calibration[0], config.ground, image.size)
    if any(config.ground.distortion) and is_rectified(image.name):
        rectified = " is applied although the topic's name says rectified"
        ground_why = Sentence("{}; {ground.distortion}{}", ground_why, rectified)
    return Selection(
        camera,
        why,
        labels,
        config.frames.scale,
        "" if truth.topic else truth.why,
        *calibration,
        ground,
        ground_why,
        _white_sample(images, config.frames.white),
        image_names(topics, readers),
        partial(lens_at, topics, readers),
    )


def _with_frame_id(topic: TopicInfo, reader: TopicReader, frame_id: str | None) -> TopicInfo:
    """Return a topic with a ``frame_id``, if some of its images have that."""
    if frame_id is None or not topic.is_image or not len(reader):
        return topic
    positions = {*np.linspace(0, len(reader) - 1, 2 * LOOKED_AT, dtype=int).tolist()}
    has_images = frame_id in map(reader.frame_id, positions)
    return replace(topic, frame_id=frame_id) if has_images else topic


WHITE: Final = (1 << 16) - 1
"""The default of the white sample in images of more than 8 bits."""


def _white_sample(images: TopicReader, setting: float | None) -> float | None:
    """Return the sample that is white in a camera's pictures; None if they have 8 bits.

    By default it follows from the greatest sample of some pictures all over the topic.
    """
    greatest, kind = 0.0, ""
    for _, picture in samples(images):
        with suppress(BadMessage):
            deep = deep_samples(picture, images.limits)
            if deep is None or setting is not None:
                return None if deep is None else setting
            greatest = max(greatest, float(deep[np.isfinite(deep)].max(initial=0)))
            kind = deep.dtype.kind
    if not kind or (kind == "f" and greatest <= 2):  # fractions may go somewhat beyond 1
        return 1 if kind else None
    bits_of_cameras = (8, 10, 12, 14, 16)
    return next(((1 << bits) - 1 for bits in bits_of_cameras if greatest < 1 << bits), greatest)


def _check_readable(reader: TopicReader, topic: TopicInfo) -> None:
    """Raise a `LogError` if none of some messages of a topic can be decoded."""
    problem = topic.problem
    for _, picture in samples(reader):
        try:
            to_rgb(picture, reader.limits)
        except BadMessage as error:
            problem = problem or error.sentence
        else:
            return
    raise undecodable(reader, problem)


@dataclass(slots=True)
class Accounting:
    """Counts of frames and of truth, which grow while frames are read.

    Any thread may add to ``undecodable`` and ``in_chunks``, which have frame numbers as keys.
    """

    in_log: int = 0
    """Messages of the image topic."""
    in_range: int = 0
    """Messages inside the range of times."""
    read: int = 0
    """Frames returned so far."""
    labelled: int = 0
    """Frames returned that have truth."""
    masks: Counter[str] = field(default_factory=Counter)
    """Frames returned that have a mask of another method, by its name."""
    repeated: int = 0
    """Frames returned that repeat an earlier one, by stamp and content."""
    labels_repeated: int = 0
    """Labelled frames with a label that equals an earlier one bit for bit."""
    frame_ids: Counter[str] = field(default_factory=Counter)
    """Frames by the ``frame_id`` of their images."""
    undecodable: dict[int, str] = field(default_factory=dict)
    """Why frames could not be decoded, by their numbers."""
    odd_sizes: dict[int, tuple[int, int]] = field(default_factory=dict)
    """Frames with another width and height than the topic's first image."""
    blank: dict[int, str] = field(default_factory=dict)
    """Frames that are ``black`` or ``white``."""
    of_video: Mapping[str, str] = field(default_factory=dict)
    """Sentences on a video, by their subject."""
    in_chunks: set[int] = field(default_factory=set)
    """Undecodable frames in unreadable chunks, which are reported as damage of the log."""

    @property
    def losses(self) -> tuple[str, ...]:
        """A sentence on each undecodable frame that is not ``in_chunks``."""
        lost = sorted(self.undecodable.keys() - self.in_chunks)
        return tuple(Sentence("frame {}: {}", number, self.undecodable[number]) for number in lost)

    @property
    def notes(self) -> Iterator[str]:
        """Sentences on images that repeat others, are blank, or differ in size from the first."""
        if self.repeated:
            yield (
                f"{self.repeated} of the {self.read} images repeat an earlier one, by stamp and "
                "content; each of them is counted"
            )
        yield from self.of_video.values()
        # A few labels are alike if the vehicle stands, or if there is no road.
        if self.labels_repeated > self.labelled / 5:
            yield (
                f"{self.labels_repeated} of the {self.labelled} labels repeat an earlier one bit "
                "for bit, under another stamp: one that was only repeated does not fit its image"
            )
        if len(self.frame_ids) > 1:
            names = [f"{visible(name)} ({count})" for name, count in self.frame_ids.items()]
            yield Sentence(
                "the images are of several cameras, by frame_id: {}; {topics.frame_id} chooses one",
                first_of(names, 5),
            )
        for level in ("black", "white"):
            blank = [number for number, colour in self.blank.items() if colour == level]
            if blank and 10 * len(blank) >= self.read:  # an exposure may take a few to settle
                yield (
                    f"{len(blank)} of the {self.read} images are {level} (frames {_few(blank)}): "
                    "nothing can be seen in them, or learnt from them"
                )
        if self.odd_sizes:
            sizes = sorted({f"{width}x{height}" for width, height in self.odd_sizes.values()})
            yield (
                f"the images' sizes vary: {len(self.odd_sizes)} of the {self.read} are not of the "
                f"first one's size but {' or '.join(sizes)} (frames {_few(self.odd_sizes)}); "
                "labels are compared with their own images, and the recording shows all images in "
                "the first one's size"
            )


def _few(frames: Iterable[int]) -> str:
    """Return the first frame numbers, and how many more there are."""
    return first_of([*map(str, sorted(frames))], 5)


class Label(NamedTuple):
    """A label of a frame, not decoded yet."""

    picture: Picture | FrameError
    """The picture, or why it cannot be read."""
    place: str
    """Its topic or its file, for messages."""
    meaning: Meaning


@dataclass(frozen=True, eq=False)
class LoggedFrame:
    """A frame of the log, not decoded yet."""

    number: int
    """Position in the image topic by log time, from 0, undecodable messages included."""
    stamp_ns: int
    """Header stamp; the log time if the log has no stamps."""
    log_time_ns: int
    picture: Picture | FrameError
    """The image, or why it cannot be read."""
    labels: Mapping[str, Label]
    """The labels that belong to it, by their names in `Selection.labels`."""
    selection: Selection
    accounting: Accounting
    """The counts that decoding adds to."""
    calibration: Calibration | None = None
    """Its own, if each image has one."""

    @property
    def labelled(self) -> bool:
        """Whether there is truth for it."""
        return TRUTH in self.labels

    def decode(self) -> Frame:
        """Decode image and labels, in any thread; a `FrameError` if one cannot be decoded."""
        try:
            return self._decode()
        except (BadMessage, FrameError) as error:
            self.accounting.undecodable[self.number] = error.sentence
            if isinstance(self.picture, LostMessageError):
                self.accounting.in_chunks.add(self.number)
            raise FrameError.of(error, f"frame {self.number}") from error

    def _decode(self) -> Frame:
        import cv2

        picture, scale = self.picture, self.selection.scale
        if isinstance(picture, FrameError):
            raise picture
        image = to_rgb(picture, self.selection.camera.images.limits, self.selection.white)
        logged = image.shape[1], image.shape[0]
        if self.selection.image.size not in (None, logged):
            self.accounting.odd_sizes[self.number] = logged
        sample = image[::4, ::4]
        for level, is_level in (("black", sample <= 16), ("white", sample >= 240)):
            if is_level.mean() >= 0.99:
                self.accounting.blank[self.number] = level
        size = scaled_size(logged, scale)
        labels = {name: self._label(name, logged, size) for name in self.labels}
        truth, shadow = (labels.pop(name, None) for name in (TRUTH, SHADOW))
        format_ = None
        if isinstance(picture, CompressedPicture) and scale == 1:
            # Viewers of recordings do not turn images.
            format_ = format_of(picture.data) if orientation_of(picture.data) == 1 else None
        return Frame(
            self.number,
            self.stamp_ns,
            self.log_time_ns,
            # Colours are averaged over the area of a new pixel.
            image if size == logged else _resized(image, size, cv2.INTER_AREA),
            picture.data,
            format_.media_type if format_ else None,
            None if truth is None else truth.truth,
            None if shadow is None else shadow.truth,
            # A mask has no third value.
            {name: (label.truth == ROAD).astype(np.uint8) for name, label in labels.items()},
            {n: label.probability for n, label in labels.items() if label.probability is not None},
            classes=None if truth is None else truth.classes,
            name="".join(self.selection.names[self.number : self.number + 1]),
            calibration=self.calibration,
        )

    def _label(self, name: str, *sizes: tuple[int, int]) -> Labels:
        """Decode a label, and resize it to the image as logged, then as read."""
        import cv2

        picture, place, meaning = self.labels[name]
        if isinstance(picture, FrameError):
            raise picture
        camera = self.selection.camera
        try:
            label = meaning.read(picture, camera.images.limits)
        except BadMessage as error:
            raise FrameError.of(error, place) from error
        theirs, resize = label.truth.shape[1::-1], camera.resize_labels
        if problem := size_problem(place, theirs, "its image", sizes[0], resize=resize):
            raise FrameError(problem)
        layers = {layer: pixels for layer, pixels in vars(label).items() if pixels is not None}
        for size in sizes:
            if layers["truth"].shape[1::-1] != size:
                for layer, pixels in layers.items():
                    layers[layer] = _resized(pixels, size, cv2.INTER_NEAREST_EXACT)
        return Labels(**layers)


class FrameStream:
    """The frames of a selection, by log time; ``accounting`` has the counts so far."""

    def __init__(
        self, selection: Selection, in_range: int, numbers: Sequence[int], *, labelled: bool
    ) -> None:
        """Begin a stream of the frames with these numbers, of ``in_range`` frames in the range.

        With ``labelled`` the frames without truth are left out; not even their chunks are read.
        """
        images, truth = selection.camera.images, selection.truth
        self.selection: Final = selection
        self._is_sparse = labelled
        self.numbers: Final = numbers
        """The numbers of the frames, in order."""
        self.accounting = Accounting(in_log=len(images), in_range=in_range)
        self._pictures: PictureSequence = images
        if selection.image.kind is TopicKind.VIDEO:
            self._pictures = video = Video(images, images.limits)
            self.accounting.of_video = video.notes
        begin, few = int(images.log_times[numbers[0]]), are_few(images, numbers)
        self._labels: dict[str, tuple[LabelSource, Partners]] = {
            name: (source, source.partners(begin, few=few))
            for name, source in selection.labels.items()
        }
        corrections = truth.corrections if truth else ()
        self._corrections = [(source, source.partners(begin, few=few)) for source in corrections]
        self._first: dict[int, int] = {}
        """The number of the first frame with a stamp, by the stamp."""
        self._contents: dict[int, int] = {}
        """The stamp of the first label of each content, by the hash of the content."""
        read: Iterable[int] = numbers
        if labelled:
            read = labelled_numbers(truth, images, numbers) if truth else ()
        self._iterator = map(self._frame, read)

    def __iter__(self) -> Iterator[LoggedFrame]:
        if not self._is_sparse:
            self.selection.camera.images.expect(chain.from_iterable(self.parts()))
        return self

    def __next__(self) -> LoggedFrame:
        return next(self._iterator)

    def __len__(self) -> int:
        return len(self.numbers)

    def parts(self) -> Iterator[Sequence[tuple[int, int]]]:
        """Yield the bytes of the log that hold each frame and its labels, by their log times."""
        in_log = (source for source in self.selection.labels.values() if not source.digest)
        topics = [self.selection.camera.images, *(source.pictures for source in in_log)]
        readers = [t for t in topics if isinstance(t, TopicReader) and len(t)]
        yield from zip(*(reader.parts(self.log_times) for reader in readers), strict=True)

    @property
    def log_times(self) -> npt.NDArray[np.int64]:
        """The log times of all frames of the stream, ``(n,)`` nanoseconds."""
        return self.selection.camera.images.log_times[np.asarray(self.numbers, np.intp)]

    def unpaired(self) -> Iterator[str]:
        """Yield a sentence on labels without a frame, and on frames that lost their label.

        It yields none if frames in between are not read, since their labels are unknown.
        """
        first, last, frames = self.numbers[0], self.numbers[-1], len(self.numbers)
        for name, (source, partners) in self._labels.items():
            if not isinstance(source.pairing.images, TopicReader) or frames <= last - first:
                continue
            shown = f"{name.removeprefix('/')}: "
            count, away = partners.unpaired(of_all=frames == self.accounting.in_log)
            if count:
                problem = f"{shown}{count} of the {len(source.pictures)} labels of {source.where}"
                why = "the frame {} ms from the first has another label"
                if away > source.pairing.tolerance:
                    why = "the first is {} ms from the nearest, and at most {} are allowed "
                    why += "({topics.sync_tolerance_ms})"
                times = (f"{ns / 1e6:.1f}" for ns in (away, source.pairing.tolerance))
                yield Sentence("{} belong to no frame: {}", problem, Sentence(why, *times))
            if partners.missed:
                lost = f"{partners.missed} frames have no label: the one in reach lies nearer to"
                yield f"{shown}{lost} another frame"

    def _frame(self, number: int) -> LoggedFrame:
        labels = {
            name: Label(
                read_or_error(source.pictures, at), source.pictures.place(at), source.meaning
            )
            for name, source, partners in (
                *((name, *labels) for name, labels in self._labels.items()),
                *((TRUTH, *labels) for labels in reversed(self._corrections)),
            )
            if (at := partners.of(number)) is not None
        }
        self.accounting.read += 1
        self.accounting.labelled += TRUTH in labels
        self.accounting.masks.update(labels.keys() - {TRUTH, SHADOW})
        # Reading a message corrects its log time if the file's index is wrong.
        picture = read_or_error(self._pictures, number)
        if name := getattr(picture, "frame_id", ""):
            self.accounting.frame_ids[name] += 1
        images, clock = self.selection.camera.images, self.selection.camera.clock
        log_time = int(images.log_times[number])
        stamp = images.stamp(number) if clock is Clock.STAMP else UNREADABLE
        stamp = log_time if stamp == UNREADABLE else stamp
        first = self._first.setdefault(stamp, number)
        with suppress(FrameError):
            is_again = first != number and images.message(first).data == images.message(number).data
            self.accounting.repeated += is_again
        if (label := labels.get(TRUTH)) and not isinstance(label.picture, FrameError):
            before = self._contents.setdefault(hash(bytes(label.picture.data)), stamp)
            self.accounting.labels_repeated += before != stamp
        calibration = self.selection.lens_at(log_time) if self.selection.names else None
        logged = number, stamp, log_time, picture, labels, self.selection, self.accounting
        return LoggedFrame(*logged, calibration)


def look_at_images(selection: Selection) -> Iterator[str]:
    """Decode some images of a camera; yield the warnings to show before a replay."""
    images = selection.camera.images
    places = [*range(min(LOOKED_AT, len(images)))]
    if images.is_small and selection.image.kind is not TopicKind.VIDEO:
        places = sorted({*np.linspace(0, len(images) - 1, LOOKED_AT, dtype=int).tolist()})
    stream = FrameStream(replace(selection, labels={}), len(images), places, labelled=False)
    for logged in stream:
        with suppress(FrameError):
            logged.decode()
    yield from stream.accounting.notes


def are_few(images: TopicReader, numbers: Sequence[int]) -> bool:
    """Return whether reading only these images needs fewer chunks than reading all in between."""
    between = range(numbers[0], numbers[-1] + 1)
    return images.chunks_of(numbers) < images.chunks_of(between)


def labelled_numbers(
    source: LabelSource, images: TopicReader, numbers: Sequence[int]
) -> Iterator[int]:
    """Yield the frames that have a label, in order.

    The search goes image by image, or label by label if it reads fewer chunks.
    """
    ends, few = [], are_few(images, numbers)
    for number in (*numbers[-2:], numbers[0]):  # one of the last two may have a damaged stamp
        partners = source.partners(int(images.log_times[number]), few=few)
        partners.of(number)
        ends.append(partners.near)
    *last, first = ends
    begin, end = max(first - REACH, 0), max(last) + REACH
    # Each label takes its own chunk and its image's.
    if source.pairing.is_small or images.chunks_of(numbers) <= 2 * (end - begin):
        yield from (number for number in numbers if partners.of(number) is not None)
        return
    in_range = frozenset(numbers)
    by_label = frames_of(source.pairing, begin, end, few=True)
    labelled = (number for number in by_label if number in in_range)
    waiting = sorted(islice(labelled, 2 * REACH))  # labels are logged nearly in order
    yield from (heappushpop(waiting, number) for number in labelled)
    yield from sorted(waiting)


def merge_streams(streams: Sequence[FrameStream]) -> Iterator[tuple[int, LoggedFrame]]:
    """Yield the frames of several streams by log time, each with the number of its stream."""
    times = np.concatenate([stream.log_times for stream in streams])
    numbers = np.repeat(np.arange(len(streams)), [*map(len, streams)])
    order = numbers[np.argsort(times, kind="stable")].tolist()
    parts = [stream.parts() for stream in streams]
    images = streams[0].selection.camera.images
    images.expect(part for number in order for part in next(parts[number]))
    for number in order:
        yield number, next(streams[number])


def _resized(pixels: npt.NDArray[Any], size: tuple[int, int], how: int) -> npt.NDArray[Any]:
    """Resize an image, or labels, to a width and height."""
    import cv2

    return np.asarray(cv2.resize(pixels, size, interpolation=how), pixels.dtype)

"""The meaning of the labels of one source: from values, colours or confidences to truth.

It is determined before the first frame.
"""

from __future__ import annotations

import re
import shlex
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from threading import Lock
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from roadeval.data import (
    IGNORE,
    NO_CLASS,
    NON_ROAD,
    ROAD,
    Classes,
    Mask,
    Probability,
    Truth,
    TruthClass,
)
from roadeval.data.words import counted
from roadeval.images.formats import Limits, Size
from roadeval.logs.errors import BadMessage, FrameError, LogError, UnclearLabelsError
from roadeval.logs.files import is_shown
from roadeval.logs.messages.encoding import TopicKind
from roadeval.logs.messages.pictures import Picture, PictureSequence
from roadeval.logs.messages.pixels import (
    ROUNDING,
    label_samples,
    lossy_format,
    palette_of,
    size_of,
    to_labels,
    to_rgb,
)
from roadeval.logs.settings import LabelPlace, LabelSettings, MaskSettings
from roadeval.logs.topics.calibration import shared_parts
from roadeval.logs.topics.choose import lossy_labels
from roadeval.logs.topics.reader import TopicInfo, TopicReader
from roadeval.logs.truth.named_labels import LabelSet, NamedLabels
from roadeval.logs.truth.pairing import (
    LOOKED_AT,
    Camera,
    LabelPictures,
    Pairing,
    Partners,
    by_number,
    by_time,
    check_times,
    frames_of,
)
from roadeval.runtime.sentence import Sentence
from roadeval.runtime.text import elide

UNKNOWN: Final = 254
"""Stands for the truth of a value with unknown meaning."""
TOP: Final = np.iinfo(np.uint16).max
"""The code of a confidence of 1."""
SCALES: Final = frozenset({100 * (TOP // 255), 255, 1000, 1023, 4095, 10_000, 32_767})
"""Codes of percent in 8 bits, and of other numbers in 16 bits that may mean a confidence of 1."""
LEAST: Final = np.iinfo(np.int16).min
"""The least label value; values below count as this one."""
NO_LABEL: Final = "values below 0 mean no label, and are ignored"
_MASKS: Final = ({0: NON_ROAD, 255: ROAD, 128: IGNORE}, {0: NON_ROAD, 1: ROAD, 255: IGNORE})
"""The values of masks that need no settings, and their meaning."""
TWO_KINDS: Final = Sentence(
    "255 is road in masks of 0 and 255, and ignored in masks of 0 and 1; name what means road "
    "with {labels.road}, or both if both do"
)
NAME_THEM: Final = Sentence(
    "name those that mean road with {labels.road}, and those to leave out with {labels.ignore}"
)
NAME_COLOURS: Final = Sentence(
    "name the colours that mean road with {labels.road_colors}, or save labels without a palette"
)
LONG: Final = 80
"""Greatest number of letters of a class's name in results."""
RARE: Final = 0.05
"""A class with a smaller share of the labelled pixels is probably not the road."""


@dataclass(frozen=True, eq=False)
class Labels:
    """A decoded label picture."""

    truth: Truth
    """``(H, W)`` uint8: 0 non-road, 1 road, 255 ignore."""
    classes: Classes | None = None
    """The classes of the pixels, as in `roadeval.data.Frame`."""
    probability: Probability | None = None
    """``(H, W)`` uint16 codes of a confidence map."""


class ClassCodes:
    """Codes of label values, or of packed colours, in the order in which they occur.

    The first 255 have codes, from 0; `NO_CLASS` stands for all others. Any thread may use it.
    """

    def __init__(self, *, by_color: bool) -> None:
        self.values: Final[dict[int, int]] = {}
        """The code of each value that has one, in the order of codes."""
        self._table = np.full(1 << 24 if by_color else TOP + 1 - LEAST, NO_CLASS, np.uint8)
        """Negative values index from the end."""
        self._lock = Lock()

    def of(self, labels: npt.NDArray[Any]) -> Classes:
        """Return the codes of ``(H, W)`` labels or packed colours."""
        values = np.maximum(labels, LEAST) if labels.dtype.kind == "i" else labels
        codes: Classes = self._table[values]
        if (unseen := values[codes == NO_CLASS]).size:
            with self._lock:
                for value in np.unique(unseen).tolist():
                    if value in self.values or len(self.values) < NO_CLASS:
                        self._table[value] = self.values.setdefault(value, len(self.values))
            codes = self._table[values]
        return codes


@dataclass(frozen=True, eq=False)
class ClassMap:
    """The meaning of the values, or of the colours, of label pictures."""

    meaning: Mapping[int, int]
    """Truth by label value, or by packed colour (`pack_colors`)."""
    others: int
    """Truth of any other value; `UNKNOWN` if such a value is an error."""
    by_color: bool
    """Whether colours are looked up instead of values."""
    words: str
    notes: tuple[str, ...] = ()
    """Doubts about the meaning, a sentence each."""
    names: Mapping[int, str] = field(default_factory=dict)
    """The names of label values, or packed colours, as far as they are known."""
    codes: ClassCodes | None = None
    """None for plain masks, which have no classes."""
    shows_road: bool = True
    """Whether road occurred in plain masks; if not, its value is a guess."""
    colours: Mapping[int, int] = field(default_factory=dict)
    """The packed colours that palettes give to values."""

    @property
    def classes(self) -> list[TruthClass]:
        """The classes that have occurred, each at the position of its code."""
        words = {ROAD: "road", NON_ROAD: "other", IGNORE: "ignored"}
        classes = []
        for value in self.codes.values if self.codes else ():
            truth = self.meaning.get(value, IGNORE if value < 0 else self.others)
            name = self.names.get(value, _color_name(value) if self.by_color else "")
            classes.append(TruthClass(value, elide(name, LONG), words[truth]))
        return classes

    @cached_property
    def _table(self) -> npt.NDArray[np.uint8]:
        """``(98304,)`` truth by label value; negative values index from the end."""
        table = np.full(TOP + 1 - LEAST, self.others, np.uint8)
        table[LEAST:] = IGNORE
        for value, truth in self.meaning.items():
            table[value] = truth
        return table

    def read(self, picture: Picture, limits: Limits) -> Labels:
        """Decode a label picture.

        A `BadMessage` if it cannot be decoded, has an unknown value, has colours instead of values,
        or is compressed with loss.
        """
        if name := lossy_format(picture):
            raise BadMessage(f"a {name}, whose compression changes label values")
        if self.by_color:
            colors = pack_colors(to_rgb(picture, limits))
            truth = np.full(colors.shape, self.others, np.uint8)
            for color, meaning in self.meaning.items():
                truth[colors == color] = meaning
            return Labels(truth, self.codes.of(colors) if self.codes else None)
        values = to_labels(picture, limits)
        if values.ndim != 2:
            raise BadMessage("it holds colours, not label values")
        if self.colours and values.dtype == np.uint8:
            used = np.bincount(values.ravel()).nonzero()[0].tolist()
            if problem := palette_problem(self.colours, palette_colours(picture, used)):
                raise BadMessage(problem, remedy=NAME_COLOURS)
        return Labels(self.of_values(values), self.codes.of(values) if self.codes else None)

    def of_values(self, labels: npt.NDArray[Any]) -> Truth:
        """Translate ``(H, W)`` labels; a `BadMessage` if a value is unknown, or beyond 65535."""
        if labels.dtype == np.uint8:
            import cv2

            truth: Truth = cv2.LUT(np.ascontiguousarray(labels), self._table[:256])
        elif labels.dtype.itemsize > 2 and (greatest := labels.max()) > TOP:
            raise BadMessage(f"it holds the value {greatest}: label values are at most {TOP}")
        else:
            truth = self._table[np.maximum(labels, LEAST) if labels.dtype.kind == "i" else labels]
        if self.others == UNKNOWN and (truth == UNKNOWN).any():
            value = int(labels[truth == UNKNOWN][0])
            raise BadMessage(f"it holds the value {value}, unlike the frames before ({self.words})")
        is_second = self.others == UNKNOWN and self.meaning.get(255) == IGNORE
        if is_second and (truth == IGNORE).any() and not (truth == ROAD).any():
            raise BadMessage("it holds 255 but no 1", remedy=TWO_KINDS)
        return truth


@dataclass(frozen=True)
class Confidence:
    """Confidence maps: road has at least the ``threshold``, from 0 to 1."""

    threshold: float
    notes: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """The meaning, in words."""
        return f"a confidence map: road is {self.threshold:g} or more"

    def road(self, probability: Probability) -> Mask:
        """Return the road mask of ``(H, W)`` uint16 codes."""
        return (probability >= self.threshold * TOP).astype(np.uint8)

    def read(self, picture: Picture, limits: Limits) -> Labels:
        """Decode a confidence map; errors as in `codes`."""
        probability = self.codes(picture, limits)
        return Labels(self.road(probability), probability=probability)

    def check(self, greatest: int, name: str) -> None:
        """Raise a `LogError` if the greatest code of some maps tells that they are masks."""
        if greatest in (1, TOP // 255):  # 1 of 65535, or of 255
            problem = f"the greatest number of {name} is 1: these are masks, and no confidences"
            raise LogError(problem, remedy="leave out the threshold, or write fractions")

    def doubts(self, greatest: int) -> tuple[str, ...]:
        """Return a warning if the greatest code of some maps tells that 1 has another code."""
        if greatest not in SCALES and greatest >= self.threshold * TOP:
            return ()
        greatest_share = f"the greatest confidence that was looked at is {greatest / TOP:.2g}"
        return (f"{greatest_share}: write 1 as 255 in 8 bits, or as 65535 in 16 bits",)

    def codes(self, picture: Picture, limits: Limits) -> Probability:
        """Decode a confidence map to ``(H, W)`` uint16 codes 0..65535 that span 0..1.

        A `BadMessage` if it cannot be decoded, has colours or a number beyond 0..1, or is
        compressed with loss.
        """
        if name := lossy_format(picture):
            raise BadMessage(f"a {name}, whose compression changes confidences")
        levels = label_samples(picture, limits)
        if levels.dtype.kind == "f":
            if not ((levels >= -ROUNDING) & (levels <= 1 + ROUNDING)).all():
                raise BadMessage("it holds a confidence that is not from 0 to 1")
            return np.rint(np.clip(levels, 0, 1).astype(np.float64) * TOP).astype(np.uint16)
        if levels.ndim != 2 or levels.dtype.kind == "i":
            raise BadMessage("it holds colours or signed numbers, not confidences")
        return levels.astype(np.uint16) * (TOP // 255) if levels.dtype == np.uint8 else levels


Meaning = ClassMap | Confidence
"""The meaning of the label pictures of one source."""


def count_values(
    picture: Picture, labels: LabelSettings, name: str, limits: Limits, file: Path | None = None
) -> Mapping[int, int]:
    """Return the number of pixels by value, or by packed colour, of a label picture.

    ``file`` is the picture's own file, if any. A `BadMessage` if it cannot be decoded. A `LogError`
    if it has colours, but the settings name none, or if it is compressed with loss.
    """
    if format_ := lossy_format(picture):
        if file is not None and labels == LabelSettings():
            colours, most = to_rgb(picture, limits), 48  # JPEG may move the levels so far
            is_grey = np.ptp(colours.astype(np.int16), axis=2).max() <= most
            is_black, is_white = colours[..., 0] <= most, colours[..., 0] >= 255 - most
            if is_grey and is_white.any() and np.mean(~is_black & ~is_white) <= RARE:
                command = f"mkdir png && python -c '{_REPAIR % file.suffix}' {shlex.quote(name)}"
                reason = "holds masks whose compression blurs their edges; make a new folder"
                raise LogError(f"{name} {reason}: {command}")
        raise LogError(lossy_labels(name, format_))
    pixels = to_rgb(picture, limits) if labels.road_colors else to_labels(picture, limits)
    packed = pixels if pixels.ndim == 2 else pack_colors(pixels)
    packed = np.maximum(packed, LEAST) if packed.dtype.kind == "i" else packed
    if packed.dtype == np.uint8:  # without sorting the pixels
        counts = np.bincount(packed.ravel())
        values, counts = counts.nonzero()[0], counts[counts > 0]
    else:
        values, counts = np.unique(packed, return_counts=True)
    if pixels.ndim != 2 and not labels.road_colors:
        raise LogError(
            f"{name} holds the colours {_listed(map(_color_name, values.tolist()))}",
            remedy=Sentence("name those that mean road with {labels.road_colors}"),
        )
    return dict(zip(values.tolist(), counts.tolist(), strict=True))


def palette_colours(picture: Picture, values: Collection[int]) -> dict[int, int]:
    """Return the packed colours that a picture's palette, if it has one, gives to some values."""
    if (palette := palette_of(picture)) is None:
        return {}
    colours = pack_colors(palette).tolist()
    return {value: colours[value] for value in values if 0 <= value < len(colours)}


_REPAIR: Final = (
    'import cv2, pathlib, sys; [cv2.imwrite(f"png/{f.stem}.png", cv2.threshold(cv2.imread(str(f), '
    '0), 127, 255, 0)[1]) for f in pathlib.Path(sys.argv[1]).rglob("*%s")]'
)


def palette_problem(colours: Mapping[int, int], palette: Mapping[int, int]) -> str:
    """Return the first value that a palette and other labels give different packed colours."""
    for value, colour in palette.items():
        if (other := colours.get(value, colour)) != colour:
            names = _color_name(colour), _color_name(other)
            return "its palette has the colour {1} for {0}, and others have {2}".format(
                value, *names
            )
    return ""


def merge_colours(palettes: Mapping[str, Mapping[int, int]]) -> dict[int, int]:
    """Return the packed colours of values, given the colours in each label's palette by its place.

    A `LogError` if a value has two colours: then values mean nothing by themselves.
    """
    colours: dict[int, int] = {}
    for place, palette in palettes.items():
        if problem := palette_problem(colours, palette):
            raise LogError(problem, where=place, remedy=NAME_COLOURS)
        colours |= palette
    return colours


def check_brightness(
    meaning: ClassMap, colours: Mapping[int, int], name: str, *, is_named: bool
) -> None:
    """Raise a `LogError` if road is not named, and its colour is darker than that of non-road."""
    road = next((value for value, truth in meaning.meaning.items() if truth == ROAD), 0)
    if is_named or not {0, road} <= colours.keys():
        return
    light = {value: sum(colours[value].to_bytes(3, "big")) for value in (0, road)}
    if light[road] < light[0]:
        problem = "{} holds the values 0 and {} of a palette, which are the colours {} and {}"
        shown = _color_name(colours[0]), _color_name(colours[road])
        raise UnclearLabelsError(problem.format(name, road, *shown), remedy=NAME_COLOURS)


def find_meaning(
    labels: LabelSettings, pictures: Sequence[Collection[int]], name: str, shown: str = "road"
) -> ClassMap:
    """Find the meaning of the values of label pictures, which show road or ``shown``.

    ``pictures`` are the values, or packed colours, of each of some pictures. A `LogError` if no
    named value of road occurs; or if none is named, and the values are class ids or have different
    meanings in different pictures.
    """
    values = sorted({value for picture in pictures for value in picture})
    has_negatives, remedy = values[:1] < [0], NAME_THEM
    keys = {tuple(map(int, key.split(","))): text for key, text in labels.names.items()}
    names = {_pack_color(key) if len(key) == 3 else key[0]: text for key, text in keys.items()}

    def text_of(value: Any) -> str:
        text = _color_name(value) if labels.road_colors else str(value)
        return f"{text} ({names[value]})" if value in names else text

    there = f"{name}: the labels that were looked at hold {_listed(map(text_of, values))}"
    if labels.road or labels.road_colors:
        ending = "_colors" if labels.road_colors else ""
        road, other = labels.road, labels.ignore
        if labels.road_colors:
            road, other = (
                tuple(map(_pack_color, colors))
                for colors in (labels.road_colors, labels.ignore_colors)
            )
        # A class that has a name may be rare, and so may all classes of road but one.
        codes: dict[Any, int] = {value: value for value in (*values, *names)}
        rare = [v for v in (*road, *other) if isinstance(v, int) and v not in codes]
        rare = rare if codes.keys() & {*road} else []
        codes |= {value: value for value in rare}
        meaning = _as_named(road, other, codes, there, text=text_of, ending=ending)
        unseen = f"no label that was looked at holds {_listed(map(text_of, rare))}: is it rare?"
        meaning = replace(meaning, names=names, notes=(unseen,) if rare else ())
        unnamed = any(value < 0 and value not in meaning.meaning for value in values)
        return replace(meaning, words=f"{meaning.words}; {NO_LABEL}") if unnamed else meaning
    for truths in _MASKS:
        if {value for value in values if value >= 0} <= truths.keys():
            white = next(value for value, truth in truths.items() if truth == ROAD)
            if white == 1 and any(255 in picture and 1 not in picture for picture in pictures):
                remedy = TWO_KINDS
                break
            ignored = [str(value) for value in values if truths.get(value) == IGNORE]
            words = f"a mask of {_listed(map(str, values))}: {_words([str(white)], ignored, shown)}"
            words += f"; {NO_LABEL}" if has_negatives else ""
            return ClassMap(truths, UNKNOWN, False, words, shows_road=white in values)
    problem = f"{name} holds the values {_listed(map(text_of, values))}"
    raise UnclearLabelsError(problem, remedy=remedy)


def find_class_meaning(labels: LabelSettings, origin: LabelSet, name: str) -> ClassMap:
    """Return the meaning of drawn labels by the names of their classes.

    If only the classes road and ignore occur, they mean what they say. A `LogError` if the settings
    name no class of road, or one that does not occur.
    """
    classes = origin.classes
    road, ignored = labels.road, labels.ignore
    if not road and {"road"} <= classes.keys() <= {"road", "ignore"}:
        road, ignored = ("road",), ignored or tuple({"ignore"} & classes.keys())
    there = _counted(origin, classes)
    if not road:
        raise UnclearLabelsError(f"{name} has the classes {there}", remedy=NAME_THEM)
    if origin.lost:
        there += f"; {counted(origin.lost, 'label')} of it cannot be read"
    # The name of a class may be a number.
    names = map(str, road), map(str, ignored)
    meaning = _as_named(*names, classes, f"{name}, which has the classes {there}")
    rest = [label for label in classes if classes[label] not in meaning.meaning]
    words = f"; non-road is all else, {_counted(origin, rest)}" if rest else ""
    texts = {value: labels.names.get(label, label) for label, value in classes.items()}
    return replace(meaning, words=meaning.words + words, names={0: "no shape", **texts})


def _as_named(
    road: Iterable[Any],
    ignored: Iterable[Any],
    codes: Mapping[Any, int],
    there: str,
    *,
    text: Callable[[Any], str] = str,
    ending: str = "",
) -> ClassMap:
    """Return the meaning of values, colours or classes, given those that are road or ignored.

    ``codes`` has the values of all that occur, ``there`` lists them in words; ``ending`` ends the
    names of the settings. A `LogError` if one of road or ignored does not occur.
    """
    meaning: dict[int, int] = {}
    words: list[list[str]] = []
    for setting, names, truth in (("road", road, ROAD), ("ignore", ignored, IGNORE)):
        words.append([])
        for name in names:
            if name not in codes:
                problem, place = f"{text(name)} does not occur in {there}", f"labels.{setting}"
                has_no_names = isinstance(name, str) and int in map(type, codes)
                remedy = "name its values in {labels.names}" if has_no_names else ""
                raise LogError(problem, setting=f"{place}{ending}", remedy=Sentence(remedy))
            meaning[codes[name]] = truth
            words[-1].append(text(name))
    by_color, codes_of_classes = bool(ending), ClassCodes(by_color=bool(ending))
    return ClassMap(meaning, NON_ROAD, by_color, _words(words[0], words[1]), codes=codes_of_classes)


def _counted(origin: LabelSet, classes: Iterable[str], limit: int = 8) -> str:
    """List the most usual of some classes, with the number of labels in which each occurs."""
    usual = sorted(classes, key=lambda name: -origin.occurring[name])
    shown = [f"{name} ({counted(origin.occurring[name], 'label')})" for name in usual[:limit]]
    return ", ".join(shown) + (f", and {len(usual) - limit} more" if len(usual) > limit else "")


def pack_colors(colors: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint32]:
    """Return ``(H, W)`` numbers, red * 65536 + green * 256 + blue, for ``(H, W, 3)`` colours."""
    wide = colors.astype(np.uint32)
    return np.asarray(wide[..., 0] << 16 | wide[..., 1] << 8 | wide[..., 2], np.uint32)


def _pack_color(color: Sequence[int]) -> int:
    return color[0] << 16 | color[1] << 8 | color[2]


def _color_name(packed: int) -> str:
    return f"{packed >> 16},{packed >> 8 & 255},{packed & 255}"


def _words(road: Iterable[str], ignored: Iterable[str], shown: str = "road") -> str:
    left_out = _listed(ignored)
    return f"{shown} is {_listed(road)}" + (f", {left_out} is ignored" if left_out else "")


def _listed(names: Iterable[str], limit: int = 16) -> str:
    """Join names with blanks, the first ones if there are many."""
    shown = list(names)
    return " ".join(shown[:limit] + ["..."] * (len(shown) > limit))


_TOPIC_OF_A_LOG: Final = re.compile(r"(.+\.mcap|.{2,}(?=:/)):(.+)")
"""A path of a log and a topic; a single letter before the colon is a disk's."""


def class_names(
    label: str, topics: Sequence[TopicInfo], readers: Mapping[str, TopicReader]
) -> dict[str, str]:
    """Return the names of a label topic's values, from the ``vision_msgs/LabelInfo`` beside it.

    It is the topic with the path that shares most with the labels' path. Empty if there is none, or
    if several share as much.
    """
    near = {
        topic.name: shared_parts(topic.name, label)
        for topic in topics
        if topic.kind is TopicKind.CLASSES and topic.count
    }
    best = [name for name, parts in near.items() if parts == max(near.values())]
    if len(best) == 1 and (near[best[0]] or best[0].count("/") <= 1):
        with suppress(FrameError, BadMessage, AttributeError, TypeError, ValueError):
            classes = readers[best[0]].fields(0).class_map
            return {str(int(item.class_id)): str(item.class_name) for item in classes}
    return {}


@dataclass(frozen=True, eq=False)
class LabelSource:
    """Labels of one source: truth, true shadow, or another method's masks."""

    where: str
    """The topic, the folder, or the topic and its log, in words."""
    pictures: LabelPictures
    meaning: Meaning
    pairing: Pairing
    why: str
    """Why they were chosen, or how they are paired, in words."""
    digest: Callable[[], str] | None = None
    """Computes the digest in hexadecimal of labels beside the log."""
    notes: tuple[str, ...] = ()
    """Warnings about labels beside the log, a sentence each."""
    corrections: tuple[LabelSource, ...] = ()
    """Labels that replace the labels of their frames; the first that has one counts."""

    @property
    def is_confidence(self) -> bool:
        """Whether they are probabilities of road, from which a threshold makes masks."""
        return isinstance(self.meaning, Confidence)

    def partners(self, logged_ns: int, *, few: bool = False) -> Partners:
        """Begin to pair images, perhaps only a few, at an image with this log time."""
        near = int(np.searchsorted(self.pictures.log_times, logged_ns))
        return Partners(self.pairing, near, few=few)


def read_or_error(pictures: PictureSequence, position: int) -> Picture | FrameError:
    """Return a picture, or the error of reading it."""
    try:
        return pictures.picture(position)
    except FrameError as error:
        return error


def samples(pictures: LabelPictures) -> Iterator[tuple[int, Picture]]:
    """Read the first pictures and some spread over the rest; yield them with their positions.

    Unreadable ones are left out. The first ones of a large log lie in at most two chunks.
    """
    count = len(pictures)
    first = range(min(LOOKED_AT, count))
    if isinstance(pictures, TopicReader) and not pictures.is_small:
        first = first[: sum(pictures.chunks_of(first[: n + 1]) <= 2 for n in first)]
    spread = np.linspace(0, count - 1, LOOKED_AT, dtype=int).tolist() if count else []
    for looked, position in enumerate(positions := sorted({*first, *spread})):
        if looked == 1 and isinstance(pictures, TopicReader):  # often the first one does
            pictures.expect(pictures.parts(pictures.log_times[positions]))
        with suppress(FrameError):
            picture = pictures.picture(position)
            pictures.stamp(position)  # this shows how late labels are logged
            yield position, picture


def source_beside_log(
    labels: LabelPictures,
    settings: MaskSettings,
    camera: Camera,
    digest: Callable[[], str],
    log: str = "",
    *,
    offset_ms: float = 0.0,
    names: Mapping[str, str] | None = None,
) -> LabelSource:
    """Return the source of labels in files, or in a topic of another ``log``.

    ``offset_ms`` is added to their stamps; `meaning_of` explains ``names``. A `LogError` if no
    label belongs to a frame, or they have another size or no clear meaning.
    """
    notes: tuple[str, ...] = ()
    if isinstance(labels, NamedLabels):
        by, what, where, notes = labels.by, "labels", labels.name, labels.origin.notes
        words = f"{by}, from {labels.first}" if labels.first else by
    elif settings.images is None:
        by, what = settings.pair or "stamp", "messages"
        where, words = f"{labels.name} of {log}" if log else labels.name, by
        words = words if settings.pair else camera.clock
    else:
        problem = "only labels in files can be paired by name, and these are in a log"
        raise LogError(problem, setting="truth.images")
    if by == "stamp":
        pairing = by_time(labels, camera, offset_ms)
        check_times(pairing, labels.name)
    elif offset_ms:
        problem = f"only stamps can be moved, but {where} is paired by {by}"
        raise LogError(problem, setting="topics.sync_offset_ms")
    else:
        pairing = by_number(labels, settings, camera.images)
    meaning = meaning_of(labels, settings, camera, pairing, names=names)
    notes += (pairing.note,) if pairing.note else ()
    why = f"{len(labels)} {what}, paired by {words}"
    return LabelSource(where, labels, meaning, pairing, why, digest, notes)


def log_and_topic(path: str) -> tuple[str | None, str | None]:
    """Return the log and the topic in a path of labels; no log for a folder or a file.

    >>> log_and_topic("night/masks.mcap:/net/road")
    ('night/masks.mcap', '/net/road')
    """
    if (match := _TOPIC_OF_A_LOG.fullmatch(path)) is not None:
        return match[1], match[2]
    return (path if path.endswith(".mcap") else None), None


def label_files(settings: LabelPlace) -> list[Path]:
    """Return the files with labels, and the images by which they are paired.

    They need not exist. An OSError if a folder cannot be listed.
    """
    paths = [Path(log_and_topic(settings.path)[0] or settings.path)]
    paths += [] if settings.images is None else [Path(settings.images)]
    files = [f for path in paths for f in (sorted(path.rglob("*")) if path.is_dir() else [path])]
    return [*filter(is_shown, files)]


def size_problem(label: str, theirs: Size, image: str, ours: Size, *, resize: bool) -> str:
    """Return the problem of a label with another size than its image; empty if it is scaled.

    If width and height are exchanged, one of both is turned, and scaling would hide that.
    """
    is_turned = theirs[0] * ours[0] == theirs[1] * ours[1] and theirs[0] != theirs[1]
    if theirs == ours or (resize and not is_turned):
        return ""
    sizes = f"{label} is {theirs[0]}x{theirs[1]}, {image} {ours[0]}x{ours[1]}"
    if is_turned:
        return Sentence(
            "{}: one of them is turned by a quarter: turn the labels as the images are shown, "
            "or leave these as they are stored with {frames.unturned}",
            sizes,
        )
    if is_stretched(theirs, ours):
        return Sentence(
            "{}, another shape: fill labels of a part of the image up to its size, or stretch "
            "labels of the whole image with {topics.resize_truth}",
            sizes,
        )
    return Sentence("{}: scale the labels with {topics.resize_truth}", sizes)


def is_stretched(theirs: Size, ours: Size) -> bool:
    """Return whether scaling changes a label's shape, by more than sizes are rounded."""
    return abs(theirs[0] * ours[1] - theirs[1] * ours[0]) > max(theirs + ours)


def check_size(
    size: Size | None, labels: LabelPictures, position: int, camera: Camera, pairing: Pairing
) -> tuple[str, ...]:
    """Return a warning if scaling changes a label's shape.

    A `LogError` if a label has another size than its image, and labels are not scaled.
    """
    expected = camera.topic.size
    if size is None or expected is None or size == expected:
        return ()
    image = next(frames_of(pairing, position, position + 1), None)
    if image is not None:
        with suppress(BadMessage, FrameError):
            expected = size_of(camera.images.picture(image), camera.images.limits) or expected
    sizes = labels.place(position), size, f"but {camera.topic.name} is", expected
    if problem := size_problem(*sizes, resize=camera.resize_labels):
        raise LogError(problem)
    stretch = "labels of {}x{} are stretched to {}x{}, another shape".format(*size, *expected)
    warning = f"{stretch}: if they show a part of the image, they do not fit it"
    return (warning,) if is_stretched(size, expected) else ()


def undecodable(pictures: LabelPictures, problem: str) -> LogError:
    """Return the error that no picture can be decoded, with the reason of the first one."""
    if not problem:
        first = read_or_error(pictures, 0) if len(pictures) else "it holds no picture"
        problem = first.sentence if isinstance(first, FrameError) else str(first)
    return LogError(Sentence("nothing of {} can be decoded: {}", pictures.name, problem))


def meaning_of(
    labels: LabelPictures,
    settings: MaskSettings,
    camera: Camera | None = None,
    pairing: Pairing | None = None,
    *,
    shown: str = "road",
    names: Mapping[str, str] | None = None,
) -> Meaning:
    """Return the meaning of labels from some of them; check the size of those beside the log.

    The masks show road, or what ``shown`` names; ``names`` are the log's names of values. A
    `LogError` if the values have no clear meaning.
    """
    origin = labels.origin if isinstance(labels, NamedLabels) else LabelSet(())
    stated = settings.labels.with_values(labels.name, names, origin.classes)
    confidence = None if settings.threshold is None else Confidence(settings.threshold)
    counts: list[Mapping[int, int]] = []
    palettes: dict[str, Mapping[int, int]] = {}
    problem, notes = "", tuple[str, ...]()
    for position, picture in samples(labels):
        file = labels.labels[position].path if isinstance(labels, NamedLabels) else None
        try:
            if camera and pairing:
                size = size_of(picture, labels.limits)
                notes = check_size(size, labels, position, camera, pairing) or notes
            if confidence is None:
                values = count_values(picture, stated, labels.name, labels.limits, file)
                palettes[labels.place(position)] = palette_colours(picture, values)
            else:
                values = {int(confidence.codes(picture, labels.limits).max()): 1}
            counts.append(values)
        except BadMessage as error:
            problem = problem or error.sentence
    if not counts:
        raise undecodable(labels, problem)
    if confidence is not None:
        greatest = max(map(max, counts))
        confidence.check(greatest, labels.name)
        return replace(confidence, notes=(*notes, *confidence.doubts(greatest)))
    if origin.occurring:
        meaning = find_class_meaning(stated, origin, labels.name)
    else:
        meaning = find_meaning(stated, counts, labels.name, shown)
        colours = {} if meaning.by_color else merge_colours(palettes)
        check_brightness(meaning, colours, labels.name, is_named=bool(stated.road))
        meaning = replace(meaning, colours=colours)
    meaning = replace(meaning, notes=(*meaning.notes, *notes))
    pixels = sum(map(Counter, counts), Counter[int]())
    of_truth = Counter[int]()
    for value, count in pixels.items():
        of_truth[meaning.meaning.get(value, meaning.others)] += count
    road, labelled = of_truth[ROAD], pixels.total() - of_truth[IGNORE]
    is_named = stated.road or stated.road_colors
    if not is_named or road >= RARE * labelled:
        return meaning
    shares = ", ".join(
        f"{meaning.names.get(value) or (_color_name(value) if meaning.by_color else value)} "
        f"({100 * count / pixels.total():.1f} %)"
        for value, count in pixels.most_common(8)
    )
    doubt = Sentence(
        "road is {} % of the labelled pixels that were looked at, which are {}: does "
        "{labels.road} name the road?",
        f"{100 * road / labelled:.2f}",
        shares,
    )
    return replace(meaning, notes=(*meaning.notes, doubt))

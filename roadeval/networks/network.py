"""The road mask that a network gives for a frame, and the settings that its file completes."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from fractions import Fraction
from functools import lru_cache, reduce
from itertools import chain
from pathlib import Path
from typing import Any, Final, Literal, Self

import cv2
import numpy as np

from roadeval.data import CERTAIN, Output, Packed, Probability, Rgb
from roadeval.data.arrays import Values, sigmoid
from roadeval.data.words import first_of
from roadeval.networks.makers import is_ultralytics
from roadeval.networks.onnx_file import SHOWN, Array, OnnxFile, Tensor, load
from roadeval.networks.settings import MIB, NetSettings
from roadeval.runtime.sentence import Sentence, Setting
from roadeval.runtime.text import elide, visible
from roadeval.runtime.threads import map_ordered


@dataclass(frozen=True, eq=False)
class Network:
    """A network with complete settings; any thread may call its methods."""

    settings: NetSettings
    file: OnnxFile
    shapes: tuple[tuple[int, ...], ...]
    """Shapes of its outputs, which hold for every frame."""

    @classmethod
    def of(cls, settings: NetSettings) -> Self:
        """Open the network of some settings.

        A `NetworkError` if it cannot be used, or a setting stands neither here nor in its file.
        """
        file = load(settings)
        settings = complete_settings(settings, file)
        return cls(settings, file, tuple(sample.shape for sample in samples_of(settings, file)))

    def road(self, image: Rgb) -> Output:
        """Find the road in an ``(H, W, 3)`` uint8 RGB image.

        Logits and probabilities of a class are interpolated linearly to the frame's size; numbers
        of classes are resized to the nearest pixel. If there are several outputs, the greatest
        probability of road counts. There are no probabilities if the network gives only classes. A
        `NetworkError` if the network fails on the image, or gives NaN or another shape than for
        other images.
        """
        frame = image.shape[1], image.shape[0]
        settings = fit_size(self.settings, frame)
        shapes = self.shapes
        if settings.size != self.settings.size:
            shapes = tuple(sample.shape for sample in samples_of(settings, self.file))
        values = input_values(fit_image(image, settings), settings, self.file.inputs[0].dtype)
        outputs = self.file.run(values, settings.outputs or (), settings.seconds)
        for name, output, shape in zip(settings.outputs or (), outputs, shapes, strict=True):
            if output.shape != shape:
                raise self.file.error(_VARIES.format(name, output.shape, shape))
        pairs = [self._codes(output, frame, settings) for output in outputs]
        codes = np.maximum.reduce([total for total, _ in pairs])
        limit = round((0.5 if settings.threshold is None else settings.threshold) * CERTAIN)
        by_class = tuple(chain(*zip(*(single for _, single in pairs), strict=True)))
        return Output(
            mask=Packed.of(codes > limit),
            probability=None if settings.activation == "classes" else codes,
            by_class=by_class if len(by_class) > 1 else (),
        )

    def facts(self) -> Mapping[str, Any]:
        """Return facts about the network for results, beside its settings."""
        from onnxruntime import __version__

        licence = self.file.metadata.get("license") or self.file.metadata.get("licence") or ""
        return {
            "onnxruntime": __version__,
            "file": Path(self.settings.file).absolute().name,
            "sha256": self.file.sha256,
            "licence": visible(" ".join(licence.split())) or None,
            "inputs": [*map(str, self.file.inputs)],
            "outputs": [*map(str, self.file.outputs)],
            "taken_for": TAKEN_FOR.get(self.settings.activation or "", "logits"),
            "road": [*map(str, self.settings.road or ())],
            "reading": self.reading(),
        }

    def reading(self) -> str:
        """Return how outputs are read: ``road = class 0 of 19; letterbox 8x8; logits at 1/4``."""
        settings, file = self.settings, self.file
        assert settings.size is not None
        scores = as_scores(np.empty(self.shapes[0], np.int8), settings.layout)
        assert scores is not None
        count = len(file.names) if settings.activation == "classes" else len(scores)
        road = f"class{'es' * (len(settings.road or ()) > 1)} "
        road += ", ".join(name_class(number, file) for number in settings.road or ())
        if count == 1:
            road = f"its only class, {name_class(0, file)}"
        elif count:
            road += f" of {count}"
        way = "letterbox" if settings.resize == "letterbox" else "stretched to"
        size = "{}x{}".format(*settings.size)
        smaller = f" or less, by steps of {settings.stride}" if settings.stride else ""
        kind = TAKEN_FOR.get(settings.activation or "", "logits")
        share = Fraction(scores.shape[1], settings.size[1])
        at = "full size" if share == 1 else share
        return f"road = {road}; {way} {size}{smaller}; {kind} at {at}"

    def _codes(
        self, output: Array, frame: Size, settings: NetSettings
    ) -> tuple[Probability, list[Probability]]:
        """Return the codes of road, and of each class of road; none by class for class numbers."""
        scores = as_scores(output, settings.layout)
        assert scores is not None
        if not np.isfinite(scores).all():
            if np.isnan(scores).any():
                raise self.file.error("gives NaN")
            scores = np.clip(scores, -HUGE, HUGE)  # infinity times 0 would be NaN
        if settings.activation == "none" and not is_probable(scores.min(), scores.max()):
            see = Sentence("see {net.activation}")
            raise self.file.error("leaves 0 to 1, so it gives no probabilities", see)
        if settings.activation == "classes":
            road = np.isin(scores[0], settings.road or ()).astype(np.uint16)
            nearest = (
                cv2.INTER_NEAREST if is_ultralytics(self.file.metadata) else cv2.INTER_NEAREST_EXACT
            )
            return resize_to_frame(CERTAIN * road, frame, settings, nearest), []

        def plane(number: int) -> Values:
            values = scores[number].astype(np.float32)
            return resize_to_frame(values, frame, settings, cv2.INTER_LINEAR)

        def encode(shares: Values) -> Probability:
            return np.rint(np.clip(shares, 0, 1) * CERTAIN).astype(np.uint16)

        total, single = road_probability(plane, len(scores), settings)
        return encode(total), [*map(encode, single)]


HUGE: Final = 3e4
"""A score that stands for infinity; float16 holds it, and its exponential is 0."""
TAKEN_FOR: Final = {"none": "probabilities", "classes": "classes"}
"""The kind of an output by `NetSettings.activation`; logits for any other."""


def road_probability(
    plane: Callable[[int], Values], count: int, settings: NetSettings
) -> tuple[Values, list[Values]]:
    """Compute the probabilities of road and of each of its classes, float32 in 0..1.

    ``plane`` returns the scores of a class by its number. With ``argmax`` the probability is that
    of the best class of road against the best other one, so that road is where it is above one
    half. With ``threshold`` it is the sum over the classes of road, for a ``sigmoid`` their
    greatest.
    """
    numbers = settings.road or ()
    road = [plane(number) for number in numbers]
    others = [number for number in range(count) if number not in numbers]
    best = reduce(np.maximum, road)
    if settings.decide != "argmax" and settings.activation != "softmax":
        if settings.activation == "sigmoid":
            return sigmoid(best), [*map(sigmoid, road)]
        return reduce(np.add, road), road
    rest = reduce(np.maximum, map(plane, others), np.full_like(best, -HUGE))
    if settings.decide == "argmax":

        def against(one: Values, other: Values) -> Values:
            if settings.activation != "none":
                return sigmoid(one - other)
            total = one + other
            return np.divide(one, total, out=np.zeros_like(one), where=total > 0)

        rivals = [
            reduce(np.maximum, [*road[:place], *road[place + 1 :]], rest)
            for place in range(len(road))
        ]
        return against(best, rest), [*map(against, road, rivals)]
    most = np.maximum(best, rest)
    powers: list[Values] = [np.exp(scores - most) for scores in road]
    total = reduce(np.add, chain(powers, (np.exp(plane(number) - most) for number in others)))
    shares: list[Values] = [power / total for power in powers]
    return reduce(np.add, shares), shares


GREY: Final = 114
"""Grey level around an image that does not fill a letterbox."""

Size = tuple[int, int]
"""Width and height."""


def inside(frame: Size, settings: NetSettings) -> tuple[slice, slice]:
    """Return the rows and columns in the middle of the input that show the frame."""
    assert settings.size is not None
    width, height = settings.size
    if settings.resize == "stretch":
        return slice(height), slice(width)
    ratio = min(width / frame[0], height / frame[1])
    columns, rows = (
        slice((full - side) // 2, (full - side) // 2 + side)
        for full, side in zip(
            settings.size, (max(1, round(side * ratio)) for side in frame), strict=True
        )
    )
    return rows, columns


def fit_size(settings: NetSettings, frame: Size) -> NetSettings:
    """Return settings with the input's size for this frame, which a stride may reduce."""
    if settings.stride is None or settings.resize != "letterbox" or settings.size is None:
        return settings
    rows, columns = inside(frame, settings)
    width, height = (
        part.stop - part.start + (full - part.stop + part.start) % settings.stride
        for part, full in zip((columns, rows), settings.size, strict=True)
    )
    return replace(settings, size=(width, height))


def fit_image(image: Rgb, settings: NetSettings) -> Rgb:
    """Return the input's pixels, ``(h, w, 3)`` uint8, for an ``(H, W, 3)`` uint8 frame."""
    assert settings.size is not None
    pixels = np.full((*settings.size[::-1], 3), GREY, np.uint8)
    inner = pixels[inside((image.shape[1], image.shape[0]), settings)]
    if not settings.antialias:
        inner[...] = cv2.resize(image, inner.shape[1::-1], interpolation=cv2.INTER_LINEAR)
        return pixels
    from PIL import Image

    how = Image.Resampling[str(settings.antialias).upper().replace("TRUE", "BILINEAR")]
    inner[...] = np.asarray(Image.fromarray(image).resize(inner.shape[1::-1], how))
    return pixels


def resize_to_frame(plane: Array, frame: Size, settings: NetSettings, how: int) -> Array:
    """Resize an ``(h, w)`` map of the input, which may be smaller, to the frame's size."""
    if settings.resize != "stretch":
        plane = cv2.resize(plane, settings.size, interpolation=how)
        plane = np.ascontiguousarray(plane[inside(frame, settings)])
    return cv2.resize(plane, frame, interpolation=how)


def input_values(image: Rgb, settings: NetSettings, dtype: str) -> Array:
    """Compute ``(level scale - mean) / deviation`` of an ``(h, w, 3)`` uint8 RGB image.

    The image has the input's size, the settings are complete; integers are rounded.
    """
    if settings.channels == "bgr":
        image = image[..., ::-1]
    elif settings.channels == "grey":
        image = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)[..., None]
    levels = np.arange(256)[:, None] * (settings.scale or 1) - np.array(settings.mean)
    table = np.broadcast_to(levels / np.array(settings.deviation), (256, image.shape[2]))
    if np.dtype(dtype).kind == "u":
        table = np.clip(np.rint(table), 0, 255)
    table = table.astype(dtype).astype(np.result_type(dtype, np.float32))  # LUT has no float16
    values = cv2.LUT(image, table[None]).reshape(image.shape)
    planes = values.transpose(2, 0, 1) if settings.layout == "NCHW" else values
    return np.ascontiguousarray(planes[None], dtype)


STATED: Final = ("resize", "antialias", "layout", "channels", "scale", "mean", "deviation")
"""Settings that are taken from the makers if the user does not give them."""
FED: Final = frozenset({"float32", "float16", "float64", "uint8"})
"""Types of an input that takes an image."""


def complete_settings(settings: NetSettings, file: OnnxFile) -> NetSettings:
    """Return settings without any missing value.

    A `NetworkError` if the network cannot be used, or a value cannot be read from its file: it asks
    for the value and lists the network's inputs and outputs.
    """
    if settings.outputs is None and has_instances(file):
        raise file.question(
            "finds instances, as boxes or queries with masks, and gives no map of classes",
            Sentence(
                "export a network for semantic segmentation (of Ultralytics one called -sem), or "
                "name an output that is a map by {net.outputs}"
            ),
        )
    task = visible(file.metadata.get("task", "semantic"))
    if is_ultralytics(file.metadata) and task != "semantic":
        raise file.question(f"is for the task {task}, and gives no map of classes")
    settings = complete_input(replace(settings, sha256=file.sha256), file)
    names = tuple(output.name for output in file.outputs)
    if settings.outputs is None and len(names) > 1:
        name_them = Sentence("name those that show road by {net.outputs}")
        line = f"outputs = [?]  # some of {', '.join(map(json.dumps, names[:SHOWN]))}"
        raise file.question("gives several outputs", name_them, line, settings)
    outputs = settings.outputs or names
    if unknown := [name for name in outputs if name not in names]:
        see = Sentence("see {net.outputs}")
        raise file.question(f"has no output {unknown[0]!r}", see)
    settings = replace(settings, outputs=outputs)
    by_output = [
        complete_output(settings, file, name, sample)
        for name, sample in zip(outputs, samples_of(settings, file), strict=True)
    ]
    if any(settings != by_output[0] for settings in by_output):
        name_some = Sentence("name some of one kind by {net.outputs}")
        raise file.question("its outputs differ in kind", name_some)
    return by_output[0]


@dataclass(frozen=True)
class Sample:
    """An output's values on the test images: its range, and whether they are integers."""

    shape: tuple[int, ...]
    kind: str
    """As NumPy's ``dtype.kind``."""
    low: float
    high: float
    """Its least and greatest number."""
    integral: bool
    """Whether all its numbers are integers."""
    several: bool
    """Whether it has more different integers than `MOST_CLASSES`."""

    @classmethod
    def of(cls, arrays: Sequence[Array]) -> Sample:
        """Sum up an output on several images."""
        kind = arrays[0].dtype.kind
        several = kind in "iu" and len(np.unique(arrays)) > MOST_CLASSES
        integral = all((array == np.rint(array)).all() for array in arrays)
        filled = [array for array in arrays if array.size]
        low = min((float(np.fmin.reduce(array, None)) for array in filled), default=0.0)
        high = max((float(np.fmax.reduce(array, None)) for array in filled), default=0.0)
        return cls(arrays[0].shape, kind, low, high, integral, several)


MOST_CLASSES: Final = 64
"""Classes that test images may show; more different integers are quantised scores."""
SLACK: Final = 1 / 64
"""How far a quantised probability may lie outside 0 to 1."""


def is_probable(low: float, high: float) -> bool:
    """Return whether numbers of a range can be probabilities, maybe quantised ones."""
    return low >= -SLACK and high <= 1 + SLACK


def samples_of(settings: NetSettings, file: OnnxFile) -> tuple[Sample, ...]:
    """Return samples of the outputs on test images; a `NetworkError` if the network fails."""
    alike = replace(settings, road=None, activation=None, decide=None, threshold=None)
    return _samples(alike, file)


@lru_cache(maxsize=8)
def _samples(settings: NetSettings, file: OnnxFile) -> tuple[Sample, ...]:
    limit, outputs = settings.megabytes * MIB, settings.outputs or ()
    by_name = {tensor.name: tensor for tensor in file.outputs}
    file.check_size(replace(file.inputs[0], shape=settings.input_shape), limit)
    for name in outputs:
        file.check_size(by_name[name], limit)

    def run(image: Rgb) -> list[Array]:
        values = input_values(image, settings, file.inputs[0].dtype)
        arrays = file.run(values, outputs, settings.seconds, WORKING * limit)
        for name, array in zip(outputs, arrays, strict=True):
            file.check_size(Tensor(name, str(array.dtype), array.shape), limit)
        return arrays

    # A black image, and two with saturated colours in large and in small spots.
    assert settings.size is not None
    images, rng = [np.zeros((*settings.size[::-1], 3), np.uint8)], np.random.default_rng(0)
    for spots in (4, 32):
        colours = 255 * rng.integers(0, 2, (spots, spots, 3), np.uint8)
        images.append(cv2.resize(colours, settings.size, interpolation=cv2.INTER_LINEAR))
    # In a thread, so that a signal is heard meanwhile.
    by_output = [*zip(*map_ordered(run, images, 1), strict=True)]
    for name, arrays in zip(outputs, by_output, strict=True):
        if len({array.shape for array in arrays}) > 1:
            raise file.error(_VARIES.format(name, arrays[1].shape, arrays[0].shape))
    return tuple(map(Sample.of, by_output))


WORKING: Final = 8
"""Factor of an output's memory that a network may take while it computes."""
_VARIES: Final = (
    "the shape of its output {!r} depends on the image ({} and {}): export it with a fixed one"
)


def has_instances(file: OnnxFile) -> bool:
    """Return whether a file finds objects one by one, by its metadata or its outputs.

    Such a file has a list of objects beside masks: an output of three dimensions that is not a map.
    """
    names = " ".join(tensor.name.lower() for tensor in file.outputs)
    shapes = [tensor.shape for tensor in file.outputs]
    maps = {sides for shape in shapes if len(shape) == 4 for sides in (shape[1:3], shape[2:])}
    return (
        file.metadata.get("task") in ("detect", "segment", "pose", "obb")
        or any(word in names for word in ("queries", "boxes", "dets", "pred_masks"))
        or (bool(maps) and any(len(shape) == 3 and shape[1:] not in maps for shape in shapes))
    )


def as_scores(output: Array, layout: str | None) -> Array | None:
    """Return an output as classes, rows and columns; None if it is not a map of the image.

    A map is ``(1, C, h, w)``, or ``(1, h, w, C)`` if the input's layout is ``NHWC``; the first
    dimension, or the dimension of the classes, may be absent.
    """
    array = output[0] if output.ndim > 2 and len(output) == 1 else output
    if array.ndim == 3 and layout == "NHWC" and len(array) != 1:
        array = array.transpose(2, 0, 1)
    if array.ndim == 2:
        array = array[None]
    return array if array.ndim == 3 and len(array) and min(array.shape[1:]) > 1 else None


def check_image(file: OnnxFile) -> None:
    """Raise a `NetworkError` if the input is not an image."""
    taken = file.inputs[0]
    shape = taken.shape if len(file.inputs) == 1 else ()
    if len(shape) == 4 and (shape[0] or 1) > 1:
        raise file.question(f"takes {shape[0]} images at once: export it with a batch of one")
    if len(shape) == 4 and taken.dtype == "int8":
        raise file.question("takes int8 by a scale that it does not state: export float inputs")
    if len(shape) != 4 or taken.dtype not in FED:
        raise file.question("takes no image: export it with one input of shape (1, C, H, W)")


def complete_input(settings: NetSettings, file: OnnxFile) -> NetSettings:
    """Return settings with all values of the input."""
    check_image(file)
    shape, dtype = file.inputs[0].shape, file.inputs[0].dtype
    stated = asdict(file.stated)
    unset = (name for name in STATED if getattr(settings, name) is None)
    settings = replace(settings, **{name: stated[name] for name in unset})
    layout = settings.layout or ("NCHW" if shape[1] in (1, 3) else "NHWC")
    count, rows, columns = shape[1:] if layout == "NCHW" else (shape[3], shape[1], shape[2])
    settings = replace(
        settings,
        resize=settings.resize or "stretch",
        antialias=settings.antialias or False,
        channels=settings.channels or ("grey" if count == 1 else "rgb"),
        scale=settings.scale or (1.0 if dtype == "uint8" else 1 / 255),
        mean=settings.mean or (0.0,),
        deviation=settings.deviation or (1.0,),
    )
    if settings.layout is None and count not in (1, 3):
        give = Sentence("give it by {net.layout}")
        problem = "does not say the order of its input's dimensions"
        raise file.question(problem, give, 'layout = ?  # "NCHW" or "NHWC"', settings)
    settings = replace(settings, layout=layout)
    size = settings.size or ((columns, rows) if columns and rows else file.stated.size)
    if size is None:
        give = Sentence("give width and height by {net.size}")
        line = "size = [?, ?]  # width and height, such as [512, 256]"
        raise file.question("takes images of any size", give, line, settings)
    width, height = size
    if columns not in (None, width) or rows not in (None, height):
        see = Sentence("see {net.size}")
        raise file.question(f"takes no input of {width}x{height}", see)
    if columns is None and rows is None and settings.size is None:
        settings = replace(settings, stride=settings.stride or file.stated.stride)
    settings = replace(settings, size=size)
    if count not in (None, expected := settings.channel_count):
        raise file.question(
            f"its input has {count} channels, and {settings.channels} has {expected}"
        )
    for name in ("mean", "deviation"):
        if len(getattr(settings, name)) not in (1, expected):
            problem = f"must hold one number, or one for each of {expected} channels"
            raise file.error(Sentence("{} {}", Setting(f"net.{name}"), problem))
    return settings


def complete_output(
    settings: NetSettings, file: OnnxFile, name: str, sample: Sample
) -> NetSettings:
    """Return settings completed by an output's sample on test images."""
    assert settings.size is not None
    width, height = settings.size
    scores = as_scores(np.broadcast_to(np.int8(), sample.shape), settings.layout)
    count, rows, columns = (0, 0, 0) if scores is None else scores.shape
    is_integer = sample.kind in "iub"
    # Class maps are often cast to float.
    guessed = sample.integral and 0 <= sample.low <= sample.high > 0 and count == 1
    is_classes = is_integer or (settings.activation or ("classes" * guessed)) == "classes"
    # A map has about the proportions of the input; numbers of classes fill one channel.
    is_map = rows and abs(rows - height * columns / width) <= max(2.0, 0.1 * rows)
    if not is_map or (is_classes and count != 1):
        raise file.question(f"its output {name!r} is not a map of the image, but {sample.shape}")
    is_scored = sample.low < 0 or sample.several or settings.activation in ("sigmoid", "softmax")
    if is_integer and is_scored:
        raise file.question(
            f"its output {name!r} holds whole numbers that look like quantised scores, and not "
            "like classes: end the network with DequantizeLinear"
        )
    if is_classes:
        return complete_classes(settings, file, name)
    usual: Literal["none", "sigmoid", "softmax"] = "sigmoid" if count == 1 else "softmax"
    usual = "none" if is_probable(sample.low, sample.high) else usual
    above = settings.threshold is not None or count == 1
    decide = settings.decide or ("threshold" if above else "argmax")
    road = choose_road(settings, file, f"tells {count} classes apart", count)
    if max(road) >= count:
        see = Sentence("see {net.road}")
        raise file.question(f"has no class {max(road)}, but {count} from 0", see)
    if decide == "argmax" and len(road) == count:
        raise file.question(
            f"all classes of its output {name!r} are road",
            Sentence("name at least one that is not (see {net.road} and {net.decide})"),
        )
    if count == 1 and settings.activation is None and 0 <= sample.low < sample.high > 1 + SLACK:
        raise file.question(
            f"its output {name!r} has numbers from {sample.low:.3g} to {sample.high:.3g} on test "
            "images: no probabilities, and as logits they would call every pixel road",
            Sentence("end it with values from 0 to 1, or say what they are by {net.activation}"),
            'activation = ?  # "sigmoid" if these are logits',
            settings,
        )
    return replace(
        settings,
        road=road,
        activation=settings.activation or usual,
        decide=decide,
        threshold=0.5 if settings.threshold is None else settings.threshold,
    )


def complete_classes(settings: NetSettings, file: OnnxFile, name: str) -> NetSettings:
    """Return complete settings for an output that holds numbers of classes."""
    if settings.threshold is not None:
        leave = Sentence("leave {net.threshold} out")
        raise file.question(f"its output {name!r} holds only classes", leave)
    if is_ultralytics(file.metadata) and len(file.names) == 1:
        settings = replace(settings, road=(1,))  # it is written as 1, whatever its number is
    road = choose_road(settings, file, "gives numbers of classes")
    return replace(settings, road=road, activation="classes", decide="argmax")


LIKE_ROAD: Final = ("road", "driv", "street", "lane", "asphalt", "highway", "carriageway")
"""Parts of names of classes that may be road."""


def choose_road(
    settings: NetSettings, file: OnnxFile, problem: str, count: int | None = None
) -> tuple[int, ...]:
    """Return the classes of road: those in the settings, those called road, or the last of two.

    A `NetworkError` if there is none: it begins with ``problem`` and lists names like road.
    """
    names = {n: name for n, name in file.names.items() if count is None or n < count}
    default = (count - 1,) if count == 1 or (count == 2 and not names) else ()
    if road := settings.road or tuple(n for n in names if names[n] == "road") or default:
        return road
    like = [n for n, name in names.items() if any(part in name for part in LIKE_ROAD)]
    listed = first_of([name_class(n, file) for n in like or names], SHOWN)
    give = Sentence("give the numbers of those that are road by {net.road}")
    if listed:
        problem = f"{problem}, none of them called road"
        give = Sentence("{}: {} {}", give, "maybe" if like else "they are", listed)
    raise file.question(problem, give, f"road = [?]{f'  # {listed}' if listed else ''}", settings)


def name_class(number: int, file: OnnxFile) -> str:
    """Return the number of a class with its name, if it has one: ``0 "road"``."""
    name = file.names.get(number)
    return str(number) if name is None else f'{number} "{elide(name, 40)}"'

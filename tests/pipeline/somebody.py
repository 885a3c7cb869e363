"""Methods as users write them, named by ``tests.pipeline.somebody:...``."""

from dataclasses import dataclass

import numpy as np

from roadeval.data import Layer, LayerKind, LayerSpec, Output, Packed, mask_spec
from roadeval.pipeline.stage import Stage

LEVEL = LayerSpec("level", LayerKind.SCALAR, "Grey level", value_range=(0, 255), exact=False)
BRIGHT = mask_spec("bright", "Brighter than the training frames' verge")


def lower_half(image):
    """Road is the lower half of every image."""
    mask = np.zeros(image.shape[:2], bool)
    mask[len(mask) // 2 :] = True
    return mask


@dataclass(frozen=True)
class Share:
    """Settings of the share."""

    top: float = 0.25


def below(image, settings=Share()):
    mask = np.zeros(image.shape[:2], np.uint8)
    mask[round(settings.top * len(mask)) :] = 7
    return mask


def gradual(image):
    """More road from row to row."""
    return np.repeat(np.linspace(0, 1, len(image))[:, None], image.shape[1], axis=1)


def gradual_in_half_precision(image):
    return gradual(image).astype(np.float16)


def levels_of_grey(image):
    return image[..., 1]


def minus_one_elsewhere(image):
    return lower_half(image).astype(int) - 1


def writes_into_the_image(image):
    image[:] = 255
    return lower_half(image)


def fails_on_13(image, moment):
    if moment is not None and moment.number == 13:
        raise ZeroDivisionError("no\nroad")
    return lower_half(image)


def fails_in_the_dark(image):
    if image.mean() < 20:
        raise ValueError("dark")
    return lower_half(image)


def always_fails(image):
    raise KeyError("weights")


def leaves(image):
    raise SystemExit(0)


def wrong_size(image):
    return np.zeros((2, 2))


def wrong_argument(image, frame):
    """Takes what nobody gives."""


class Callable:
    def __call__(self, image):
        return lower_half(image)


an_object = Callable()


@dataclass(frozen=True)
class Level:
    value: float


def fit(sample, _settings):
    return Level(
        float(sample.colours()[~sample.road].mean() + sample.colours()[sample.road].mean()) / 2
    )


def bind(_settings, level):
    def run(view):
        grey = view.image.mean(axis=2, dtype=np.float32)
        road = Packed.of(grey > level.value)
        return Output((Layer(LEVEL, grey), Layer(BRIGHT, road)), mask=road)

    return run


def _bind_writing(_settings, _parameters):
    return lambda view: view.image.fill(0)


WRITES = Stage("writes", "Writes", Share, _bind_writing, (BRIGHT,))
LEARNS = Stage("bright", "Brightness", Share, bind, (LEVEL, BRIGHT), fit=fit, parameters=Level)


def _unfit(_sample, _settings):
    raise ValueError("nothing here")


UNFIT = Stage("unfit", "Unfit", Share, bind, LEARNS.layers, fit=_unfit, parameters=Level)
TAKEN = Stage("svm", "Not ours", Share, bind, LEARNS.layers)
UNNAMEABLE = Stage("a b", "Unnameable", Share, bind, LEARNS.layers)
LAYERS = Stage("unannounced", "Unannounced", Share, lambda s, _: bind(s, Level(0)), (BRIGHT,))

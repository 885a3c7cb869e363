"""A metric, a region, a label format and a disturbance that a package adds."""

import numpy as np

from roadeval.data.arrays import pack
from roadeval.evaluation.metric import Metric, Shown, ratio
from roadeval.evaluation.region import Region
from roadeval.images.disturbing import DisturbanceKind
from roadeval.logs.truth.shapes import DrawnLabel, LabelFormat, Outline, flatten, has_keys

CAUTION = Metric(
    "caution",
    "false road in all that is called road",
    "FP / (TP + FP)",
    lambda counts: ratio(counts.fp, counts.tp + counts.fp),
    higher_is_better=False,
    order=100,
    shown=Shown.IN_FULL,
)


def _middle(labelled):
    """Return the middle third of the columns."""
    height, width = labelled.truth.shape
    middle = np.zeros((height, width), bool)
    middle[:, width // 3 : 2 * width // 3] = True
    return {"middle": pack(middle)}


MIDDLE = Region({"middle": "middle third of the columns"}, order=60, find=_middle)


def _read(_path, content, size):
    for image, points in content["road_of"].items():
        yield DrawnLabel(image, size, [Outline("road", flatten(points))])


OUTLINES = LabelFormat("outlines", ".json", has_keys("road_of"), _read)


def _fade(image, strength, _depth, _random):
    """Mix the image with grey; all of it is grey at strength 1."""
    return np.uint8(image + (128.0 - image) * strength)


FADE = DisturbanceKind("fade", "share of grey", _fade, 0, 1)

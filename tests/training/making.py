"""Small frames that can be learnt from: grey road below, dark green verge above."""

import numpy as np

from roadeval.data import Frame
from tests.pipeline.making import default

GREY, GREEN = (170, 170, 175), (40, 80, 35)


def frame(number: int = 0, *, labelled: bool = True) -> Frame:
    """Make a 24x32 frame: verge in the upper half, road in the lower, and noise."""
    noise = np.random.default_rng(number).integers(-30, 31, (24, 32, 3))
    image = np.empty((24, 32, 3))
    image[:12], image[12:] = GREEN, GREY
    image = (image + noise).clip(0, 255).astype(np.uint8)
    truth = np.repeat([[0], [1]], 12, axis=0).repeat(32, axis=1).astype(np.uint8)
    return Frame(number, number, number, image, image.tobytes(), truth=truth if labelled else None)


def pipelines():
    """The pipelines of the two default variants."""
    pipeline = default("shadow", "similarity", "svm", "post")
    return {"filtered": pipeline, "unfiltered": pipeline.without_filter()}

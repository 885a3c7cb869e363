"""Small logs and short ways to say how they are replayed."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from roadeval import RunConfig, configure
from roadeval.logs.writing.writer import LogWriter
from tests.training.making import frame

FRAMES: Final = 26
NS: Final = 100_000_000
PIXELS: Final = 50

TABLES: Final = {
    **dict.fromkeys(("start", "end", "every", "max_frames", "scale"), "frames"),
    **dict.fromkeys(("max_pixels", "disturb"), "frames"),
    **dict.fromkeys(("masks", "resize_truth", "sync_tolerance_ms", "image", "truth"), "topics"),
    **dict.fromkeys(("road", "ignore", "road_colors", "ignore_colors"), "labels"),
    **dict.fromkeys(("model", "gap", "train_frames", "source", "seed"), "training"),
    "record": "output",
    "jobs": "run",
}


def settings(**values: Any) -> RunConfig:
    """A configuration by its keys alone; ``train_frames`` is ``training.frames``.

    Few pixels train, which is quicker: how good a method is, is not what small logs show.
    """
    tables: dict[str, Any] = {"training": {"pixels_per_class": PIXELS}}
    for key, value in values.items():
        if key in TABLES:
            plain = str(value) if isinstance(value, Path) else value
            tables.setdefault(TABLES[key], {})[key.removeprefix("train_")] = plain
        else:
            tables[key] = tables.get(key, {}) | value if key == "training" else value
    return configure(tables)


def write_log(
    path: Path,
    *,
    truth: bool = True,
    net: bool = False,
    broken: int = -1,
    codes: tuple[int, int] = (0, 255),
    numbers: Sequence[int] = range(FRAMES),
) -> Path:
    """Write a log of small frames; some have no truth, one may be broken.

    ``codes`` are the values of non-road and road in the truth, and ``numbers`` the frames
    that are written.
    """
    with LogWriter(path) as writer:
        for number in numbers:
            made, stamp = frame(number), (number + 1) * NS
            # The verge creeps over the road, so that no fixed mask is right everywhere.
            made.image[12 : 12 + number // 8] = made.image[0]
            made.truth[12 : 12 + number // 8] = 0
            _, png = cv2.imencode(".png", made.image[..., ::-1])
            data = b"no image" if number == broken else png.tobytes()
            writer.image("/camera/image", stamp, data, "png")
            if truth and number != 20:
                writer.mask("/truth/road", stamp, np.array(codes, np.uint8)[made.truth])
            if net:
                writer.mask("/net/road_mask_prediction", stamp, made.truth * 255)
    return path

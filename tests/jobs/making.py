"""Small logs and short ways to say how they are replayed."""

import importlib
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from roadeval import RunConfig, configure
from roadeval.pipeline.stages import import_stage
from tests.fixtures.logged import write_drive
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


def write_module(path: Path, text: str) -> None:
    """Write a module with stages in place of the one of its name that was imported before."""
    import_stage.cache_clear()
    sys.modules.pop(path.stem, None)
    path.write_text(text)
    importlib.invalidate_caches()


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

    def messages(number: int) -> dict[str, Any]:
        made = frame(number)
        # The verge creeps over the road, so that no fixed mask is right everywhere.
        made.image[12 : 12 + number // 8] = made.image[0]
        made.truth[12 : 12 + number // 8] = 0
        return {
            "/camera/image": b"no image" if number == broken else made.image,
            "/truth/road": np.uint8(codes)[made.truth] if truth and number != 20 else None,
            "/net/road_mask_prediction": made.truth * 255 if net else None,
        }

    return write_drive(path, (((number + 1) * NS, messages(number)) for number in numbers))

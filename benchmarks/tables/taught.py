"""`robust` on CamVid's logs: taught by other drives alone, and adapted to each log besides."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import roadeval
from benchmarks.tables.drives import DRIVES, Drive, Sources
from benchmarks.tables.idd import SEEDS_OF_ROBUST, read_drives
from benchmarks.tables.measure import of_others
from roadeval.training import save_model
from roadeval.training.learning import train_on

IDD_LITE: Final = "idd"
PUPILS: Final = (
    ("camvid_0016E5_15hz", "camvid_0006R0_1hz", False),
    (IDD_LITE, "camvid_0016E5_15hz", False),
    (IDD_LITE, "camvid_0006R0_1hz", False),
    (IDD_LITE, "camvid_0016E5_15hz", True),
    (IDD_LITE, "camvid_0006R0_1hz", True),
)
"""Who teaches, which drive is scored, and whether its own first ten labelled frames are added."""


def measured(sources: Sources, idd_lite: Path) -> Iterator[dict[str, Any]]:
    """Yield what each of `PUPILS` comes to, with each seed; the models are made once."""
    for teacher, pupil, adapt in PUPILS:
        outcomes = []
        for seed in range(SEEDS_OF_ROBUST):
            path = sources.work / f"{teacher}.{seed}.model"
            if not path.exists():
                _teach(teacher, seed, path, sources, idd_lite)
            training = {"seed": seed, "model": str(path), "adapt": adapt}
            outcomes.append(_summary(DRIVES[pupil], training, sources))
        yield {"teacher": teacher, "pupil": pupil, "adapt": adapt, **of_others(outcomes)}


def _teach(teacher: str, seed: int, path: Path, sources: Sources, idd_lite: Path) -> None:
    """Train on a log's frames as `roadeval train` draws them, or on IDD Lite's train part."""
    tables: dict[str, Any] = {"preset": "robust", "training": {"seed": seed}}
    if teacher == IDD_LITE:
        config = roadeval.configure(tables)
        frames = [frame for drive in read_drives(idd_lite).values() for frame in drive]
        save_model(train_on(frames, config.pipelines(), config.training), path)
        return
    drive = DRIVES[teacher]
    config = roadeval.configure(tables | {"labels": drive.labels})
    roadeval.train([drive.find(sources, teacher)], path, config)


def _summary(drive: Drive, training: dict[str, Any], sources: Sources) -> dict[str, Any]:
    tables = {"preset": "robust", "labels": drive.labels, "training": training}
    outcome = roadeval.replay(
        drive.find(sources, drive.name),
        roadeval.configure(tables | {"output": {"record": "none"}}),
        reports=sources.work / f"{drive.name}.taught",
    )
    return outcome.summary

"""`robust` on CamVid's logs: taught by other drives alone, and adapted to each log besides."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import roadeval
from benchmarks.tables.drives import DRIVES, Drive, Sources
from benchmarks.tables.idd import SEEDS_OF_ROBUST, read_drives
from benchmarks.tables.measure import TEACHER, of_others
from roadeval.training.learning import fit
from roadeval.training.model import save_model

IDD_LITE: Final = "idd"
PUPILS: Final[tuple[tuple[str, str, str | None], ...]] = (
    ("camvid_0016E5_15hz", "camvid_0006R0_1hz", None),
    (IDD_LITE, "camvid_0016E5_15hz", None),
    (IDD_LITE, "camvid_0006R0_1hz", None),
    (IDD_LITE, "camvid_0016E5_15hz", "truth"),
    (IDD_LITE, "camvid_0006R0_1hz", "truth"),
    (IDD_LITE, "camvid_0016E5_15hz", "patch"),
    (IDD_LITE, "camvid_0006R0_1hz", "patch"),
)
"""Training drive, scored drive, and the labels that adapt the model to its first ten frames."""


def measure(sources: Sources, idd_lite: Path) -> list[dict[str, Any]]:
    """Return the rates of each of `PUPILS` with each seed; the models are made once."""
    rows = []
    for teacher, pupil, adapt in PUPILS:
        outcomes = []
        for seed in range(SEEDS_OF_ROBUST):
            model = model_of(teacher, seed, sources, idd_lite)
            training: dict[str, Any] = {"seed": seed, "model": str(model)}
            if adapt is not None:
                training |= {"adapt": True, "source": adapt}
            tables = {"training": training, "trees": {"reach_weight": 1.0}}
            outcomes.append(summary(DRIVES[pupil], tables, sources))
        about = {"teacher": teacher, "pupil": pupil, "adapt": adapt}
        rows.append({**about, **of_others(outcomes)})
    return rows


def trained_elsewhere(drive: Drive, sources: Sources) -> dict[str, Any]:
    """Train `robust` on `TEACHER` with each seed; return its ERR on another drive.

    The differences from the baseline, which is the teacher's mean truth, are of the first seed.
    """
    models = [model_of(TEACHER, seed, sources) for seed in range(SEEDS_OF_ROBUST)]
    return of_others([summary(drive, {"training": {"model": str(m)}}, sources) for m in models])


def model_of(teacher: str, seed: int, sources: Sources, idd_lite: Path | None = None) -> Path:
    """Return the model of a log's frames as `roadeval train` draws them, or of IDD's train part.

    It is made if it does not exist yet.
    """
    path = sources.work / f"{teacher}.{seed}.model"
    if path.exists():
        return path
    tables: dict[str, Any] = {"preset": "robust", "training": {"seed": seed}}
    if idd_lite is not None and teacher == IDD_LITE:
        config = roadeval.configure(tables)
        frames = [frame for drive in read_drives(idd_lite).values() for frame in drive]
        save_model(fit(frames, config.pipelines(), config.training), path)
        return path
    drive = DRIVES[teacher]
    config = roadeval.configure(tables | {"labels": drive.labels})
    roadeval.train([drive.find(sources, teacher)], path, config)
    return path


def summary(drive: Drive, tables: Mapping[str, Any], sources: Sources) -> dict[str, Any]:
    """Replay a drive with `robust` and some more settings; return its summary."""
    settings = {"preset": "robust", "labels": drive.labels, "output": {"record": "none"}, **tables}
    reports = sources.work / f"{drive.name}.taught"
    return roadeval.replay(
        drive.find(sources, drive.name), roadeval.configure(settings), reports=reports
    ).summary

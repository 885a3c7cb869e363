"""Fleets made up: random but plausible frames, written as the results of replays."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pandas as pd

from roadeval.data import OUTCOMES
from roadeval.evaluation import metrics, tables
from roadeval.evaluation.metrics import COMPARED, METRICS
from roadeval.evaluation.score.scoreboard import Effect
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.stats.difference import Difference
from roadeval.results.facts import DriveFacts, Facts, FrameAccount, LogFacts, Member
from roadeval.results.fleet import FleetWriter, Made, results_path
from roadeval.results.folder import ResultsWriter
from roadeval.results.rows import Key, csv_lines
from roadeval.results.schema import DAMAGED, FAILED, SCORED, TABLES, UNSCORED

STAGES = ("similarity", "svm", "post")
MASKS = [(v, s) for v in ("filtered", "unfiltered") for s in STAGES] + [("blind", "post")]
LEVELS = {"similarity": 1.6, "svm": 1.3, "post": 1.0}
"""A stage's ERR in that of the final mask."""
REGIONS = ("shadow", "lit", "boundary")
PIXELS = 10_000
REASONS = ("{}: no image topic; the log has: no topics at all", "{}: is not an MCAP file")
CAMERA = "/camera/image"
RUN = {
    "preset": "paper",
    "svm": {"kernel": "rbf"},
    "frames": {"scale": 1.0, "every": 1},
    "training": {"seed": 0},
    "fleet": {"folds": None},
}
Counts = dict[tuple[str, str], npt.NDArray[np.int64]]
"""TP, TN, FP and FN of each mask, ``(n, 4)``."""


def status_of(place: int) -> str:
    """Which drives failed, have no truth, or lost a part."""
    if place % 20 == 9:
        return UNSCORED
    return {7: FAILED, 8: DAMAGED}.get(place % 10, SCORED)


def fleet_of(
    folder: str | Path,
    count: int,
    seed: int = 0,
    *,
    frames: int = 20,
    change: float = 0.0,
    pictures: int = 0,
    status: Callable[[int], str] = status_of,
) -> Path:
    """Write a fleet of drives, and return its folder.

    The same seed gives the same drives. Filtered's ERR is higher by ``change`` on every third of
    them; the first ``pictures`` have pictures of their three worst frames.
    """
    writer = FleetWriter(Path(folder))
    writer.begin()
    members = [_member(place) for place in range(count)]
    for place, member in enumerate(members):
        rng, problem = np.random.default_rng((seed, place)), ""
        if status(place) == FAILED:
            problem = REASONS[place // 10 % 2].format(f"{member.name}.mcap")
        else:
            masks = _counts(place, rng, frames, change) if status(place) != UNSCORED else {}
            _write(writer.folder, place, member, masks, lost=status(place) == DAMAGED)
            for number in _worst(masks) if place < pictures and masks else ():
                path = writer.folder / "pictures" / member.drive / f"{number}.jpg"
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(_picture())
        how = {"problem": problem, "exit_code": int(bool(problem)), "seconds": 10.0 + place % 7}
        Made(member.drive, "asked", None, **how).write(writer.folder)
    writer.finish(members, EvaluationSettings(), RUN, "")
    return Path(folder)


def _member(i: int) -> Member:
    name = f"drive_{i:04}"
    group = f"route_{i // 4}" if i % 4 < 2 else None
    tags = {"weather": ("sun", "rain", "fog")[i % 3]}
    tags |= {"place": ("city", "country")[i % 2]} if i % 5 else {}
    return Member(f"{name}-{i:08x}", name, f"/logs/{name}.mcap", group, tags)


def _counts(i: int, rng: np.random.Generator, n: int, change: float) -> Counts:
    """Return each mask's counts, frame by frame."""
    level = 0.04 * math.exp(0.6 * rng.standard_normal())
    helps = -0.008 + 0.015 * rng.standard_normal() + 0.01 * (i % 3 - 1)
    slow = 0.01 * np.cumsum(rng.standard_normal(n)) / math.sqrt(n)
    made = {}
    for variant, stage in MASKS:
        err = LEVELS[stage] * (level + slow) + 0.006 * rng.standard_normal(n)
        err += {"filtered": helps, "unfiltered": 0.0, "blind": 0.03}[variant]
        again = rng.standard_normal(n)
        if variant == "filtered" and i % 3 == 0:
            err += change * (1 + 0.5 * again)
        wrong = np.rint(PIXELS * np.clip(err, 0.001, 0.6)).astype(np.int64)
        fp, road = wrong // 3, 3 * PIXELS // 10
        fn = np.minimum(wrong - fp, road - 1)
        made[variant, stage] = np.stack([road - fn, PIXELS - road - fp, fp, fn], axis=1)
    return made


def _write(folder: Path, i: int, member: Member, masks: Counts, *, lost: bool) -> None:
    """Write the results of a drive, as its replay would."""
    n = len(masks["blind", "post"]) if masks else 0
    rows = {name: [*_rows(masks, name)] for name in ("frames", "regions")}
    sums: Any = {}
    if masks:
        names = TABLES["frames"].names[2:]
        frames = pd.DataFrame(rows["frames"], columns=names)
        sums = tables.as_trees(tables.totals(frames))
    facts = Facts(
        verdict="",
        drive=DriveFacts(member.name, CAMERA, 640, 480, 10.0),
        frames=FrameAccount(in_log=n + 10, trained_on=10, evaluated=n),
        totals=sums,
        effects=[*_effects(masks)] if masks else [],
        losses=[f"frame {i} cannot be decoded", "3 records are cut off"] if lost else [],
        warnings=[] if masks else ["no truth"],
        log=LogFacts(member.source, f"{i:064x}"),
    )
    with ResultsWriter(results_path(folder, member.drive)) as results:
        results.append(csv_lines(Key(member.name, CAMERA), rows))
        results.finish(facts, "")


def _rows(masks: Counts, name: str) -> Any:
    """Yield the rows of ``frames`` or ``regions``, without the key."""
    for (variant, stage), counts in masks.items():
        mask = variant, stage
        if name == "frames":
            rates = metrics.table(counts, METRICS).tolist()
            for frame, (four, own) in enumerate(zip(counts.tolist(), rates, strict=True)):
                yield (frame, *[_stamp(frame)] * 2, *mask, *four, sum(four), *own, 1 + frame)
        else:
            for place, region in enumerate(REGIONS, 2):
                for frame, four in enumerate((counts // place).tolist()):
                    yield frame, *mask, region, *four, sum(four)


def _stamp(frame: int) -> int:
    return 1_700_000_000_000_000_000 + 100_000_000 * frame


def _effects(masks: Counts) -> Any:
    """Yield the differences of the drive, with the intervals of independent frames."""
    pairs = [("unfiltered", "filtered", s) for s in STAGES]
    pairs += [("blind", v, "post") for v in ("filtered", "unfiltered")]
    for base, variant, stage in pairs:
        mine, theirs = masks[variant, stage], masks[base, stage]
        rates = {}
        for place, metric in enumerate(METRICS):
            if metric in COMPARED:
                change = (metrics.table(mine, METRICS) - metrics.table(theirs, METRICS))[:, place]
                mean, n = float(change.mean()), len(change)
                error = float(change.std(ddof=1)) / math.sqrt(n)
                p = math.erfc(abs(mean) / (math.sqrt(2) * error)) if error else 1.0
                ends = mean - 2 * error, mean + 2 * error
                rates[metric] = Difference(mean, *ends, p, 0.95, "frames", n, effective=float(n))
        yield Effect(base, variant, stage, stage == "post", rates)


def _worst(masks: Counts) -> list[int]:
    """Return the three frames whose final mask errs most."""
    wrong = masks["filtered", "post"][:, [OUTCOMES.index("FP"), OUTCOMES.index("FN")]].sum(axis=1)
    return np.argsort(-wrong, kind="stable")[:3].tolist()


def _picture() -> bytes:
    image = np.random.default_rng(0).integers(0, 255, (12, 16, 3), np.uint8)
    large = cv2.resize(image, (320, 240), interpolation=cv2.INTER_CUBIC)
    return cv2.imencode(".jpg", large)[1].tobytes()

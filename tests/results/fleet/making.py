"""Fleets made up: random but plausible rows, written by the real writer."""

import math
from pathlib import Path

import cv2
import numpy as np
import pyarrow as pa
from pyarrow import parquet

from roadeval.data import Counts
from roadeval.evaluation import metrics
from roadeval.evaluation.metrics import COMPARED, METRICS
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.results.facts import Member
from roadeval.results.fleet import FleetWriter, Record, frames_path
from roadeval.results.rows import Key, cells
from roadeval.results.schema import TABLES
from roadeval.runtime.files import put

STAGES = ("similarity", "svm", "post")
MASKS = [(v, s) for v in ("filtered", "unfiltered") for s in STAGES] + [("blind", "post")]
LEVELS = {"similarity": 1.6, "svm": 1.3, "post": 1.0}
"""A stage's ERR in that of the final mask."""
REGIONS = ("shadow", "lit", "boundary")
PIXELS = 10_000
REASONS = ("{}: no image topic; the log has: no topics at all", "{}: is no MCAP file")
RUN = {
    "preset": "paper",
    "svm": {"kernel": "rbf"},
    "frames": {"scale": 1.0, "every": 1},
    "training": {"seed": 0},
    "fleet": {"folds": None},
}


def fleet_of(folder, count, seed=0, *, frames=20, change=0.0, pictures=0):
    """Write a fleet of drives, and return its folder.

    The same seed gives the same drives. Filtered's ERR is higher by ``change`` on every third of
    them; the first ``pictures`` have pictures. Without ``frames`` no table of frames is there, and
    rows are as of 20.
    """
    folder = Path(folder)
    writer = FleetWriter(folder)
    writer.begin()
    members = [_member(i) for i in range(count)]
    for i, member in enumerate(members):
        rng = np.random.default_rng((seed, i))
        rows = _broken(i, member)
        if rows is None:
            masks = _counts(i, rng, frames or 20, change)
            rows = _scored(i, member.drive, masks)
            if frames:
                _write_frames(folder, member.drive, masks)
            if i < pictures:
                _write_pictures(folder, member.drive)
        key = Key(member.drive, "/camera/image")
        tables = {name: cells(name, key, own) for name, own in rows.items()}
        Record(member.drive, "asked", None, tables).write(folder)
    writer.finish(members, EvaluationSettings(), RUN, "")
    return folder


def _member(i):
    name = f"drive_{i:04}"
    group = f"route_{i // 4}" if i % 4 < 2 else None
    tags = {"weather": ("sun", "rain", "fog")[i % 3]}
    tags |= {"place": ("city", "country")[i % 2]} if i % 5 else {}
    return Member(f"{name}-{i:08x}", name, f"/logs/{name}.mcap", group, tags)


def _broken(i, member):
    """Return the rows of a drive that failed or has no truth; None of the others."""
    row = {"drive": member.drive, "evaluated": 0}
    if i % 10 == 7:
        reason = REASONS[i // 10 % 2].format(f"{member.name}.mcap")
        own = row | {"status": "failed", "exit_code": 1, "reason": reason}
    elif i % 20 == 9:
        own = row | {
            "status": "unscored",
            "exit_code": 0,
            "reason": "no truth",
            "log_digest": f"{i:x}",
        }
    else:
        return None
    return {"drives": [own], "scores": [], "effects": [], "worst": []}


def _scored(i, drive, masks):
    lost, n = i % 10 == 8, len(masks["blind", "post"])
    own = {
        "drive": drive,
        "status": "damaged" if lost else "scored",
        "exit_code": 3 if lost else 0,
        "losses": f"frame {i} cannot be decoded\n3 records are cut off" if lost else None,
        "seconds": 10.0 + i % 7,
        "log_digest": f"{i:064x}",
        "evaluated": n,
        "trained_on": 10,
        "in_log": n + 10,
    }
    return {
        "drives": [own],
        "scores": list(_scores(drive, masks)),
        "effects": list(_effects(drive, masks)),
        "worst": list(_worst(drive, masks)),
    }


def _counts(i, rng, n, change):
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


def _rates(counts):
    means = dict(zip(METRICS, metrics.table(counts).mean(axis=0).tolist(), strict=True))
    sums = dict(zip(("TP", "TN", "FP", "FN"), counts.sum(axis=0).tolist(), strict=True))
    pooled = metrics.of(Counts(*sums.values()))
    about = {"frames": len(counts), "N": sum(sums.values()), **sums, **means}
    return about | {f"pooled_{name}": value for name, value in pooled.items()}


def _scores(drive, masks):
    for (variant, stage), counts in masks.items():
        mask = {"drive": drive, "variant": variant, "stage": stage, "final": stage == "post"}
        yield mask | {"region": "all", **_rates(counts)}
        for place, region in enumerate(REGIONS, 2):
            yield mask | {"region": region, **_rates(counts // place)}


def _effects(drive, masks):
    pairs = [("filtered", s, "unfiltered", s) for s in STAGES]
    pairs += [(v, "post", "blind", "post") for v in ("filtered", "unfiltered")]
    for variant, stage, base, of_base in pairs:
        mine, theirs = masks[variant, stage], masks[base, of_base]
        differences = metrics.table(mine) - metrics.table(theirs)
        means = differences.mean(axis=0).tolist()
        errors = (differences.std(axis=0, ddof=1) / math.sqrt(len(mine))).tolist()
        for place, metric in enumerate(METRICS):
            if metric in COMPARED:
                mean, error = means[place], errors[place]
                yield {
                    "drive": drive,
                    "base": base,
                    "variant": variant,
                    "stage": stage,
                    "final": stage == "post",
                    "metric": metric,
                    "mean": mean,
                    "standard_error": error,
                    "low": mean - 2 * error,
                    "high": mean + 2 * error,
                    "p": math.erfc(abs(mean) / (math.sqrt(2) * error)) if error else 1.0,
                    "frames": len(mine),
                    "effective_frames": float(len(mine)),
                }


def _worst(drive, masks):
    rates = metrics.table(masks["filtered", "post"])
    order = np.argsort(-rates[:, [*METRICS].index("ERR")], kind="stable")[:3].tolist()
    for rank, frame in enumerate(order, 1):
        own = dict(zip(METRICS, rates[frame].tolist(), strict=True))
        yield {
            "rank": rank,
            "drive": drive,
            "frame": frame,
            "stamp_ns": _stamp(frame),
            "variant": "filtered",
            "stage": "post",
            **{name: own[name] for name in ("ERR", "FPR", "FNR")},
            "picture": f"pictures/{drive}/{frame}.jpg",
        }


def _stamp(frame):
    return 1_700_000_000_000_000_000 + 100_000_000 * frame


def _write_frames(folder, drive, masks):
    n = len(masks["blind", "post"])
    counts = np.concatenate([*masks.values()])
    columns = {
        "drive": [drive] * len(counts),
        "camera": ["/camera/image"] * len(counts),
        "frame": np.tile(np.arange(n), len(masks)),
        "stamp_ns": _stamp(np.tile(np.arange(n), len(masks))),
        "log_time_ns": _stamp(np.tile(np.arange(n), len(masks))),
        "variant": [v for v, _ in masks for _ in range(n)],
        "stage": [s for _, s in masks for _ in range(n)],
        "final": [s == "post" for _, s in masks for _ in range(n)],
        **dict(zip(("TP", "TN", "FP", "FN"), counts.T, strict=True)),
        "N": counts.sum(axis=1),
        **dict(zip(METRICS, metrics.table(counts).T, strict=True)),
        "truth": np.tile(np.arange(n), len(masks)),
    }
    path = frames_path(folder, drive)
    path.parent.mkdir(parents=True, exist_ok=True)
    table = pa.table(columns, schema=TABLES["frames"].arrow())
    parquet.write_table(table, path, compression="zstd")


def _write_pictures(folder, drive):
    rng = np.random.default_rng(0)
    image = rng.integers(0, 255, (12, 16, 3), np.uint8)
    large = cv2.resize(image, (320, 240), interpolation=cv2.INTER_CUBIC)
    content = cv2.imencode(".jpg", large)[1].tobytes()
    for frame in range(20):
        put(folder / "pictures" / drive / f"{frame}.jpg", content)

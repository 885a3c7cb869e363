"""Replays of the drives, and the numbers of their summaries that tables show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import roadeval
from benchmarks.tables.drives import COMMA10K, DRIVES, Drive, Sources
from benchmarks.tables.idd import SEEDS_OF_ROBUST
from roadeval.data import BASELINE, FILTERED, FINAL_STAGE, UNFILTERED

SEEDS: Final = 5
RATES: Final = ("ERR", "FPR", "FNR")
KEPT: Final = ("mean", "low", "high", "p", "p_holm", "comparisons", "units")


@dataclass(frozen=True, slots=True)
class Replay:
    """A replay of drives."""

    tables: Mapping[str, Any]
    """Its configuration, without the labels of the drive's truth."""
    options: str = ""
    """The same for the terminal; empty where that takes files, too."""
    seeds: int = SEEDS
    """How often it trains."""
    drives: tuple[str, ...] = tuple(DRIVES)


TEACHER: Final = "camvid_0006R0_1hz"
"""The drive that a model for others is trained on."""
STRANGERS: Final = {
    **{name: DRIVES[name] for name in ("synthetic_0", "camvid_0016E5_15hz")},
    COMMA10K.name: COMMA10K,
}
"""Drives of other cameras, and of other journeys of the same one."""

DEVELOPED: Final = tuple(
    name for name, drive in DRIVES.items() if drive.tuned or name.startswith("synthetic")
)
"""Drives that `gated` was replayed on since it learns its gate, and `robust` since it has boosted
trees: the others are for an examination that nobody tunes for."""

REPLAYS: Final[Mapping[str, Replay]] = {
    "paper": Replay(
        {"variants": {name: {"preset": name} for name in ("printed_order", "hsi")}},
        "--variant printed_order --variant hsi",
    ),
    "gated": Replay({"preset": "gated"}, "--preset gated", drives=DEVELOPED),
    "robust": Replay(
        {"preset": "robust"}, "--preset robust", seeds=SEEDS_OF_ROBUST, drives=DEVELOPED
    ),
    "spread": Replay(
        {"preset": "robust", "training": {"placement": "spread"}},
        "--preset robust --train-on spread",
        seeds=SEEDS_OF_ROBUST,
        drives=DEVELOPED,
    ),
    "patch": Replay(
        {"preset": "robust", "training": {"source": "patch"}},
        "--preset robust --config patch.toml",
        seeds=SEEDS_OF_ROBUST,
        drives=DEVELOPED,
    ),
}


def command(replay: str) -> str:
    """Return the command that makes a replay's numbers of a drive again."""
    return f"roadeval replay DRIVE {REPLAYS[replay].options}"


def replay_seeds(replay: str, drive: Drive, sources: Sources) -> dict[str, Any]:
    """Replay a drive with each seed of the training; return the numbers of the summaries."""
    tables = dict(REPLAYS[replay].tables)
    tables |= {"labels": drive.labels, "output": {"record": "none"}}
    summaries = []
    for seed in range(REPLAYS[replay].seeds):
        training = {**REPLAYS[replay].tables.get("training", {}), "seed": seed}
        config = roadeval.configure(tables | {"training": training})
        reports = sources.work / f"{drive.name}.{replay}.{seed}"
        path = drive.find(sources, drive.name)
        summaries.append(roadeval.replay(path, config, reports=reports).summary)
    return numbers_of(summaries)


def of_others(summaries: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the numbers of summaries with models of other drives, one for each seed."""
    first = summaries[0]
    (variant,) = first["against_blind"]
    return {
        "ERR": [round_all(summary["totals"][variant][FINAL_STAGE]["ERR"]) for summary in summaries],
        "blind": round_all(first["totals"]["blind"][FINAL_STAGE]["ERR"]),
        "against_blind": change_of(first["against_blind"][variant]["ERR"]),
    }


def numbers_of(summaries: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the numbers that tables show, of the summaries with the seeds from 0.

    All are fractions for the final mask of the first seed, except the rates of each seed.
    """
    summary = summaries[0]
    variants = {
        variant: {
            **{
                rate: round_all([s["totals"][variant][FINAL_STAGE][rate] for s in summaries])
                for rate in RATES
            },
            "flicker": round_all(summary["beyond"][variant]["flicker"]),
        }
        for variant in summary["totals"]
        if variant != BASELINE
    }
    results: dict[str, Any] = {
        "frames": summary["frames"]["evaluated"],
        "seeds": [*range(len(summaries))],
        "variants": variants,
        "blind": {rate: round_all(summary["totals"]["blind"][FINAL_STAGE][rate]) for rate in RATES},
        "against_blind": {
            variant: change_of(rates["ERR"]) for variant, rates in summary["against_blind"].items()
        },
        "claims": summary["claims"],
        "truth_flicker": round_all(summary["beyond"][next(iter(variants))]["truth_flicker"]),
    }
    perfect = summary.get("oracles", {}).get(FILTERED, {}).get("shadow", {})
    if perfect:
        results["perfect_shadow"] = {
            "perfect": round_all(perfect[FINAL_STAGE]["ERR"]),
            **{
                name: round_all(summary["totals"][name][FINAL_STAGE]["ERR"])
                for name in (FILTERED, UNFILTERED)
            },
        }
    if changes := summary["difference"].get(FINAL_STAGE):
        results["filter"] = {
            rate: {
                **change_of(changes[rate]),
                "seeds": round_all([e["difference"][FINAL_STAGE][rate]["mean"] for e in summaries]),
            }
            for rate in RATES
        }
    return results


def change_of(change: Mapping[str, Any]) -> dict[str, Any]:
    """Return the numbers of a paired difference."""
    return {name: round_all(change[name]) for name in KEPT}


def round_all(value: Any) -> Any:
    """Round numbers to six digits; tables show less."""
    if isinstance(value, dict):
        return {key: round_all(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [round_all(inner) for inner in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value

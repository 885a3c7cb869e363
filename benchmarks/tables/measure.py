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
    """Its configuration, without what the drive's truth needs."""
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
"""Those others: other cameras, and other journeys of the same one."""

DEVELOPED: Final = tuple(
    name for name, drive in DRIVES.items() if drive.tuned or name.startswith("synthetic")
)
"""Those that `gated` was replayed on since it learns its gate, and `robust` since it has boosted
trees: the others are kept for an examination that nobody tunes for."""

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


def replayed(replay: str, drive: Drive, sources: Sources) -> dict[str, Any]:
    """Replay a drive with each seed of the training; return what is kept of the summaries."""
    tables = dict(REPLAYS[replay].tables)
    tables |= {"labels": drive.labels, "output": {"record": "none"}}
    summaries = []
    for seed in range(REPLAYS[replay].seeds):
        training = {**REPLAYS[replay].tables.get("training", {}), "seed": seed}
        config = roadeval.configure(tables | {"training": training})
        reports = sources.work / f"{drive.name}.{replay}.{seed}"
        path = drive.find(sources, drive.name)
        summaries.append(roadeval.replay(path, config, reports=reports).summary)
    return kept(summaries)


def of_others(found: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return what is kept of summaries with models of other drives, one for each seed."""
    first = found[0]
    (variant,) = first["against_blind"]
    return {
        "ERR": [rounded(each["totals"][variant][FINAL_STAGE]["ERR"]) for each in found],
        "blind": rounded(first["totals"]["blind"][FINAL_STAGE]["ERR"]),
        "against_blind": change_of(first["against_blind"][variant]["ERR"]),
    }


def kept(summaries: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the numbers that tables show, of the summaries with the seeds from 0.

    All are of the final mask, as fractions; but for the rates of each seed, of the first one.
    """
    summary = summaries[0]
    variants = {
        variant: {
            **{
                rate: rounded([each["totals"][variant][FINAL_STAGE][rate] for each in summaries])
                for rate in RATES
            },
            "flicker": rounded(summary["beyond"][variant]["flicker"]),
        }
        for variant in summary["totals"]
        if variant != BASELINE
    }
    found: dict[str, Any] = {
        "frames": summary["frames"]["evaluated"],
        "seeds": [*range(len(summaries))],
        "variants": variants,
        "blind": {rate: rounded(summary["totals"]["blind"][FINAL_STAGE][rate]) for rate in RATES},
        "against_blind": {
            variant: change_of(rates["ERR"]) for variant, rates in summary["against_blind"].items()
        },
        "claims": summary["claims"],
        "truth_flicker": rounded(summary["beyond"][next(iter(variants))]["truth_flicker"]),
    }
    perfect = summary.get("oracles", {}).get(FILTERED, {}).get("shadow", {})
    if perfect:
        found["perfect_shadow"] = {
            "perfect": rounded(perfect[FINAL_STAGE]["ERR"]),
            **{
                name: rounded(summary["totals"][name][FINAL_STAGE]["ERR"])
                for name in (FILTERED, UNFILTERED)
            },
        }
    if own := summary["difference"].get(FINAL_STAGE):
        found["filter"] = {
            rate: {
                **change_of(own[rate]),
                "seeds": rounded([e["difference"][FINAL_STAGE][rate]["mean"] for e in summaries]),
            }
            for rate in RATES
        }
    return found


def change_of(change: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is kept of a paired difference."""
    return {name: rounded(change[name]) for name in KEPT}


def rounded(value: Any) -> Any:
    """Round what is kept to six digits; tables show less."""
    if isinstance(value, dict):
        return {key: rounded(each) for key, each in value.items()}
    if isinstance(value, list):
        return [rounded(each) for each in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value

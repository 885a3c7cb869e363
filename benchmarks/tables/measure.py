"""Replays of the drives, and the numbers of their summaries that tables show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import roadeval
from benchmarks.tables.drives import COMMA10K, DRIVES, Drive, Sources
from benchmarks.tables.idd import SEEDS_OF_ROBUST
from roadeval.data import FILTERED, FINAL_STAGE, UNFILTERED

SEEDS: Final = 5
RATES: Final = ("ERR", "FPR", "FNR")
KEPT: Final = ("mean", "low", "high", "p", "p_holm", "comparisons", "units")


@dataclass(frozen=True, slots=True)
class Replay:
    """One replay of a drive.

    Parameters
    ----------
    tables
        Its configuration, without what the drive's truth needs.
    options
        The same for the terminal; empty where that takes files, too.
    seeds
        How often it trains.
    drives
        Those that it is made of; all by default.
    """

    tables: Mapping[str, Any]
    options: str = ""
    seeds: int = SEEDS
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
    return f"roadeval replay DRIVE {REPLAYS[replay].options} --seeds {REPLAYS[replay].seeds}"


def replayed(replay: str, drive: Drive, sources: Sources) -> dict[str, Any]:
    """Replay a drive; return what is kept of its summary."""
    tables = dict(REPLAYS[replay].tables)
    training = {**tables.get("training", {}), "seeds": REPLAYS[replay].seeds}
    tables |= {"labels": drive.labels, "training": training, "output": {"record": "none"}}
    outcome = roadeval.replay(
        drive.find(sources, drive.name),
        roadeval.configure(tables),
        reports=sources.work / f"{drive.name}.{replay}",
    )
    return kept(outcome.summary)


def of_others(found: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return what is kept of summaries with models of other drives, one for each seed."""
    first = found[0]
    (variant,) = first["against_blind"]
    return {
        "ERR": [rounded(each["totals"][variant][FINAL_STAGE]["ERR"]) for each in found],
        "blind": rounded(first["totals"]["blind"][FINAL_STAGE]["ERR"]),
        "against_blind": change_of(first["against_blind"][variant]["ERR"]),
    }


def kept(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Return the numbers of a summary that tables show; all of the final mask, as fractions."""
    seeds = summary["seeds"]
    variants = {
        variant: {
            **{rate: rounded(stages[FINAL_STAGE][rate]) for rate in RATES},
            "flicker": rounded(summary["beyond"][variant]["flicker"]),
        }
        for variant, stages in seeds["totals"].items()
    }
    found: dict[str, Any] = {
        "frames": summary["frames"]["evaluated"],
        "seeds": seeds["seeds"],
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
            rate: {**change_of(own[rate]), "seeds": rounded(seeds["difference"][FINAL_STAGE][rate])}
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

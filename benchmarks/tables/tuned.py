"""A network as it comes, with the threshold of labelled frames, and tuned on them, beside `robust`.

The network is any that was trained elsewhere, by its ONNX file. A log's first ten frames teach, and
each half of IDD's drives teaches the model of the other half.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

import roadeval
from benchmarks.tables import idd
from benchmarks.tables.drives import DRIVES, MissingSourceError, Sources
from benchmarks.tables.idd import SEEDS_OF_ROBUST
from benchmarks.tables.measure import DEVELOPED, change_of, round_all
from roadeval.config.run import RunConfig
from roadeval.config.variants import network_variant
from roadeval.data import FINAL_STAGE

NAMES: Final = {"robust": "robust", "network": "net", "threshold": "at", "tuned": "net_tuned"}
"""The compared methods, and their variants."""


def measure(sources: Sources, network: Path) -> dict[str, Any]:
    """Return ERR of each of `NAMES` on each drive and on IDD, with three seeds, as fractions."""
    if sources.idd is None:
        raise MissingSourceError(f"tuned: name the folder of {idd.SOURCE} (--idd)")
    digest = hashlib.sha256(network.read_bytes()).hexdigest()
    drives = {name: _on(name, sources, network) for name in DEVELOPED}
    return {"sha256": digest, "drives": {**drives, "idd": _on_idd(sources.idd, sources, network)}}


def _on(name: str, sources: Sources, network: Path) -> dict[str, Any]:
    drive = DRIVES[name]
    places = [sources.work / f"{name}.tuned.{seed}" for seed in range(SEEDS_OF_ROBUST)]
    summaries = []
    for seed, reports in enumerate(places):
        tables = {"labels": drive.labels, "training": {"seed": seed}}
        config = _config(tables, sources, network)
        outcome = roadeval.replay(drive.find(sources, name), config, reports=reports)
        summaries.append(outcome.summary)
    compared = roadeval.compare(places[0], variants=["robust", "net_tuned"])
    (tuned,) = compared.comparison.finals()
    return of_summaries(summaries, asdict(tuned.difference["ERR"]))


def _config(tables: dict[str, Any], sources: Sources, network: Path) -> RunConfig:
    """Return `robust` and the variants of a network beside it."""
    with TemporaryDirectory(dir=sources.work) as folder:
        trained = Path(folder, "at.toml")
        trained.write_text(f'file = "{network.resolve()}"\ndecide = "trained"\n')
        nets = [network_variant("net", str(network)), network_variant("at", str(trained))]
        robust = {"preset": "robust", "output": {"record": "none"}, **tables}
        return roadeval.configure(robust).with_variants(nets).with_tuned(["net"])


def _on_idd(folder: Path, sources: Sources, network: Path) -> dict[str, Any]:
    """Return ERR over all pixels of IDD together, with intervals of a bootstrap over drives."""
    config, folds = _config({}, sources, network).resolved(), idd.both_ways(folder)
    blind = np.concatenate([idd.count_blind(*fold) for fold in folds])
    counted = {}
    for key, variant in NAMES.items():
        alone = replace(config, pipeline=config.pipelines()[variant])
        seeds = 1 if key in ("network", "threshold") else SEEDS_OF_ROBUST
        counted[key] = idd.with_each_seed(alone, seeds, folds)
    return told_of_idd(blind, counted)


def told_of_idd(blind: idd.Counted, counted: Mapping[str, list[idd.Counted]]) -> dict[str, Any]:
    """Return ERR of outcomes by drive with each seed, and differences of the first one."""
    tuned, robust, network = (counted[key][0] for key in ("tuned", "robust", "network"))
    return {
        "blind": idd.err(blind.sum(axis=0)),
        "change": idd.difference(idd.err, tuned, robust),
        "against_network": idd.difference(idd.err, tuned, network),
        **{
            key: [idd.err(drives.sum(axis=0)) for drives in seeds] for key, seeds in counted.items()
        },
    }


def of_summaries(
    summaries: Sequence[Mapping[str, Any]], change: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the numbers of the summaries of replays, one a seed of the training from 0.

    ``change`` is the difference of ERR between the tuned network and `robust`, with the first seed.

    The unchanged network learns nothing: its ERR is there once.
    """
    summary = summaries[0]
    totals = summary["totals"]
    errors = {
        key: [
            seed["totals"][variant][FINAL_STAGE]["ERR"]
            for seed in (summaries[:1] if key == "network" else summaries)
        ]
        for key, variant in NAMES.items()
    }
    numbers: dict[str, Any] = round_all(
        {
            "blind": totals["blind"][FINAL_STAGE]["ERR"],
            "own": summary["thresholds"]["net"]["own"],
            "chosen": summary["thresholds"]["net"]["threshold"],
            "change": change_of(change),
            "against_network": change_of(summary["against_method"]["net_tuned"]["ERR"]),
            **errors,
        }
    )
    return numbers

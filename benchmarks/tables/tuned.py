"""A network as it comes, with the threshold of ten frames, and tuned on them, beside `robust`.

The network is any that was trained elsewhere, by its ONNX file.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import roadeval
from benchmarks.tables.drives import DRIVES, Sources
from benchmarks.tables.idd import SEEDS_OF_ROBUST
from benchmarks.tables.measure import DEVELOPED, change_of, rounded
from roadeval.config import network_variant
from roadeval.data import FINAL_STAGE

NAMES: Final = {
    "robust": "unfiltered",
    "network": "net",
    "threshold": "at",
    "tuned": "net_tuned",
}
"""What is compared, and its variant."""


def measured(sources: Sources, network: Path) -> dict[str, Any]:
    """Return ERR of each of `NAMES` on each drive, with three seeds, as fractions."""
    digest = hashlib.sha256(network.read_bytes()).hexdigest()
    drives = {name: _on(name, sources, network) for name in DEVELOPED}
    return {"sha256": digest, "drives": drives}


def _on(name: str, sources: Sources, network: Path) -> dict[str, Any]:
    drive = DRIVES[name]
    tables = {
        "preset": "robust",
        "labels": drive.labels,
        "training": {"seeds": SEEDS_OF_ROBUST},
        "output": {"record": "none"},
    }
    with TemporaryDirectory(dir=sources.work) as folder:
        trained = Path(folder, "at.toml")
        trained.write_text(f'file = "{network.resolve()}"\ndecide = "trained"\n')
        nets = [network_variant("net", str(network)), network_variant("at", str(trained))]
        config = roadeval.configure(tables).with_variants(nets).with_tuned(["net"])
        reports = sources.work / f"{name}.tuned"
        summary = roadeval.replay(drive.find(sources, name), config, reports=reports).summary
    return of_summary(summary)


def of_summary(summary: dict[str, Any]) -> dict[str, Any]:
    """Return what is kept of a replay's summary."""
    seeds, totals = summary["seeds"]["totals"], summary["totals"]
    once = {name: [own[FINAL_STAGE]["ERR"]] for name, own in totals.items()}
    each = {name: own[FINAL_STAGE]["ERR"] for name, own in seeds.items() if FINAL_STAGE in own}
    found: dict[str, Any] = {
        "blind": totals["blind"][FINAL_STAGE]["ERR"],
        "own": summary["thresholds"]["net"]["own"],
        "chosen": summary["thresholds"]["net"]["threshold"],
        "change": change_of(summary["against_unfiltered"]["net_tuned"]["ERR"]),
        **{key: {**once, **each}[variant] for key, variant in NAMES.items()},
    }
    kept: dict[str, Any] = rounded(found)
    return kept

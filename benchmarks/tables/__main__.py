"""The tables in the documents, and a check that they have the measured numbers.

python -m benchmarks.tables             checks all texts against benchmarks/tables/numbers.json
python -m benchmarks.tables --write     writes the tables of all anew
python -m benchmarks.tables --measure   replays the drives and writes the numbers

A drive comes from the folder named for it; see PRESETS.md for where to get them. ``--measure NAME``
measures one drive, ``idd``, ``idd_features``, ``idd_filters``, ``synthetic_shadow``,
``stage_times``, ``overlap``, ``elsewhere``, ``taught``, ``reach_weights`` or ``tuned``, and leaves
the other numbers as they are.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from benchmarks.tables import (
    idd,
    idd_filters,
    overlap,
    reach_weights,
    stage_times,
    synthetic_shadow,
    taught,
    tuned,
)
from benchmarks.tables.drives import DRIVES, SEGNET, MissingSourceError, Sources
from benchmarks.tables.measure import REPLAYS, SEEDS, STRANGERS, replay_seeds, round_all
from benchmarks.tables.text import DOCUMENTS, NUMBERS, faults, load, write_tables
from roadeval.version import VERSION

ELSEWHERE = "elsewhere"
TUNED = "tuned"
WITH_A_PATH: Mapping[str, Callable[[Sources, Path], Any]] = {
    "idd": lambda _, folder: idd.measure(folder, SEEDS),
    "idd_features": lambda _, folder: idd.without_each_group(folder),
    "idd_filters": lambda _, folder: idd_filters.measure(folder),
    "taught": taught.measure,
    "reach_weights": reach_weights.measure,
    TUNED: tuned.measure,
}
"""Names of the folder of IDD Lite and of a network in messages."""
WHAT = {"idd": f"folder idd20k_lite of {idd.SOURCE}", "net": "ONNX file of a road network"}
WITHOUT_FILES: Mapping[str, Callable[[], Any]] = {
    "synthetic_shadow": synthetic_shadow.measure,
    "stage_times": stage_times.measure,
    "overlap": overlap.measure,
}
OTHERS = (*WITH_A_PATH, *WITHOUT_FILES, ELSEWHERE)


def main() -> int:
    """Check, write or measure; return the exit code."""
    options = parse_arguments()
    if options.measure is not None:
        with tempfile.TemporaryDirectory() as made:
            try:
                measure_parts(options, Path(options.work or made))
            except MissingSourceError as error:
                sys.exit(str(error))
        if not options.write:
            return 0
    numbers = load()
    if options.write:
        for path in DOCUMENTS:
            path.write_text(write_tables(path.read_text(), numbers))
    problems = [
        f"{path.name}: {fault}" for path in DOCUMENTS for fault in faults(path.read_text(), numbers)
    ]
    for problem in problems:
        print(problem, file=sys.stderr)
    return 1 if problems else 0


def measure_parts(options: argparse.Namespace, work: Path) -> None:
    """Measure the named parts, or everything, and store every result at once."""
    work.mkdir(parents=True, exist_ok=True)
    sources = Sources(work, options.logs, options.camvid, options.comma10k, options.idd)
    names = options.measure or [*DRIVES, *([] if options.replays else OTHERS)]
    for name in names:
        if name in WITHOUT_FILES:
            numbers = WITHOUT_FILES[name]()
            store(numbers if name == "overlap" else round_all(numbers), name)
            continue
        if name in WITH_A_PATH:
            flag = "net" if name == TUNED else "idd"
            path = getattr(options, flag)
            if path is None:
                sys.exit(f"{name}: name the {WHAT[flag]} (--{flag})")
            store(round_all(WITH_A_PATH[name](sources, path)), name)
            continue
        if name == ELSEWHERE:
            for stranger in STRANGERS.values():
                store(taught.trained_elsewhere(stranger, sources), ELSEWHERE, stranger.name)
            continue
        for key, replay in REPLAYS.items():
            if name in replay.drives and key in (options.replays or REPLAYS):
                begin = time.monotonic()
                store(replay_seeds(key, DRIVES[name], sources), "drives", name, key)
                print(f"{name} {key}: {time.monotonic() - begin:.0f} s", flush=True)


def store(result: Any, *place: str) -> None:
    """Store a result in its place in the file."""
    numbers = load() if NUMBERS.exists() else {}
    numbers |= {"roadeval": VERSION, "seeds": SEEDS}
    here = numbers
    for name in place[:-1]:
        here = here.setdefault(name, {})
    here[place[-1]] = result
    NUMBERS.write_text(json.dumps(numbers, indent=1, sort_keys=True) + "\n")


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.tables",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--write", action="store_true", help="write the tables of all texts")
    parser.add_argument(
        "--measure",
        nargs="*",
        choices=(names := [*DRIVES, *OTHERS]),
        metavar="NAME",
        help=f"all by default, or some of {', '.join(names)}",
    )
    parser.add_argument("--replays", nargs="+", choices=REPLAYS, help="of each drive")
    parser.add_argument("--work", type=Path, help="keep the logs and results made here")
    parser.add_argument("--logs", type=Path, help="the folder of the two CamVid logs")
    parser.add_argument("--camvid", type=Path, help=f"the folder CamVid of {SEGNET}")
    parser.add_argument("--comma10k", type=Path, help="a folder with its imgs and masks")
    parser.add_argument("--idd", type=Path, help=f"the folder idd20k_lite of {idd.SOURCE}")
    parser.add_argument("--net", type=Path, help="an ONNX file with a road network")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())

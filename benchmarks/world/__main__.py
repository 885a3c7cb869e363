"""Render a synthetic drive into a log: ``python -m benchmarks.world -o DRIVE.mcap --seed 1``."""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.world import RenderSettings, write_drive


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DRIVE.mcap")
    parser.add_argument("--seed", type=int, default=0, help="0 is the drive that ships")
    options = parser.parse_args()
    write_drive(options.output, RenderSettings(seed=options.seed))


if __name__ == "__main__":
    main()

"""Render a synthetic drive into a log: ``python -m benchmarks.world -o DRIVE.mcap --seed 1``.

Without a seed it is the drive that ships.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.world import DEMO, RenderSettings, write_drive


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DRIVE.mcap")
    parser.add_argument("--seed", type=int, help="another drive: 10 seconds at 10 Hz")
    options = parser.parse_args()
    settings = DEMO if options.seed is None else RenderSettings(seed=options.seed)
    write_drive(options.output, settings)


if __name__ == "__main__":
    main()

"""``python -m tests.faults``: real runs killed, two at once, and on full disks.

The rounds of full disks mount small ones, which needs root.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from tests.faults.campaign import Campaign, rounds

ROOT = Path(__file__).resolve().parents[2]


def main() -> int:
    """Run the rounds that the command line asks for; 1 if a promise was broken."""
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    parser.add_argument("--kills", type=int, default=0, metavar="ROUNDS")
    parser.add_argument("--together", type=int, default=0, metavar="ROUNDS")
    parser.add_argument("--full", type=int, default=0, metavar="ROUNDS")
    parser.add_argument("--drive", type=Path, default=ROOT / "recordings" / "demo.mcap")
    parser.add_argument("--seed", type=int, default=0)
    words = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="roadeval-faults-") as folder:
        campaign = Campaign(Path(folder), words.drive, words.seed)
        print(f"a run takes {campaign.seconds:.1f} s", flush=True)
        tallies = [
            rounds(step, number)
            for step, number in (
                (campaign.killed, words.kills),
                (campaign.together, words.together),
                (campaign.full, words.full),
            )
            if number
        ]
    return int(any(tally.broken for tally in tallies))


if __name__ == "__main__":
    sys.exit(main())

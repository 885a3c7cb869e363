"""``python -m tests.fuzz``: look for input that breaks a promise, for as long as one likes."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from tests.fuzz.campaign import ROOT, Job, Result, guidance, run
from tests.fuzz.harness import NAMES, harness_of, run_case


def main() -> int:
    """Run the campaign that the command line describes; 1 if anything was found."""
    words = _parser().parse_args()
    if words.case:
        return _again(words.harness or NAMES[0], words.case)
    names = [words.harness] if words.harness else list(NAMES)
    seconds = (words.seconds or (0 if words.cases else 60)) / len(names)
    guided, is_found = guidance() and not words.plain, False
    for name in names:
        seeds = range(words.seed, words.seed + words.jobs)
        result = run([Job(name, "", n, guided, words.cases, seconds) for n in seeds], words.save)
        _tell(result, guided=guided)
        is_found |= bool(result.findings)
    return int(is_found)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("harness", nargs="?", choices=NAMES, help="all of them by default")
    parser.add_argument("--seconds", type=float, default=0, help="for all together; 60 by default")
    parser.add_argument("--cases", type=int, default=0, help="cases of each harness and job")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1, help="processes side by side")
    parser.add_argument("--plain", action="store_true", help="without Atheris, where there is one")
    parser.add_argument("--case", type=Path, help="try one case again, which was kept as this file")
    parser.add_argument(
        "--save", type=Path, default=ROOT / "build/fuzz", help="where cases are kept"
    )
    return parser


def _again(name: str, path: Path) -> int:
    outcome = run_case(harness_of(name), path.read_bytes())
    print(f"{outcome.kind or 'as promised'} {outcome.where}")
    return int(bool(outcome.kind))


def _tell(result: Result, *, guided: bool) -> None:
    kinds = ", ".join(sorted({kind for kind, _, _ in result.findings})) or "nothing found"
    print(
        f"{result.harness}: {result.cases} {'guided' if guided else 'random'} cases in "
        f"{result.seconds:.0f} s, slowest {result.slowest:.1f} s, biggest "
        f"{result.biggest / 1e6:.0f} MB: {kinds}",
        flush=True,
    )
    for (kind, where, file), times in sorted(result.findings.items()):
        print(f"  {kind}: {where}; {times} times, kept as {file}", flush=True)


if __name__ == "__main__":
    sys.exit(main())

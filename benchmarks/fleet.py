"""Many drives: one process against several, and the time for thousands of hours of video.

    python -m benchmarks.fleet

Copies of the demo drive, each under a name of its own, are scored by one model, without recordings.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import roadeval
from benchmarks.processes import ROADEVAL

DEMO = Path(__file__).resolve().parents[1] / "recordings" / "demo.mcap"
HOURS = 5_000
RATE_HZ = 10
DRIVE_HOURS = 1


def main() -> None:
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("--drives", type=int, default=40)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    with TemporaryDirectory(prefix="roadeval-fleet-") as scratch:
        folder = Path(scratch)
        model = folder / "demo.model"
        roadeval.train([DEMO], model)
        logs = folder / "logs"
        logs.mkdir()
        for number in range(options.drives):
            shutil.copy(DEMO, logs / f"drive_{number}.mcap")
        frame_s, frames = _frame_seconds(logs / "drive_0.mcap", model, folder)
        walls = {n: _wall(logs, model, folder / f"fleet_{n}", n) for n in (1, options.workers)}
        again = _wall(logs, model, folder / f"fleet_{options.workers}", options.workers)
        _show(walls, again, frame_s, frames * options.drives)
        _extrapolate(folder / f"fleet_{options.workers}", walls, frame_s)


def _frame_seconds(drive: Path, model: Path, folder: Path) -> tuple[float, int]:
    """Return the seconds of a frame in one thread, the median of three drives, and their frames."""
    config = roadeval.configure(
        {
            "training": {"model": str(model)},
            "output": {"record": "none", "figures": False},
            "run": {"jobs": 1},
        }
    )
    times = []
    for _ in range(4):
        begun: dict[str, float] = {}

        def watch(progress: roadeval.Progress, begun: dict[str, float] = begun) -> None:
            begun.setdefault(progress.stage, perf_counter())

        outcome = roadeval.replay(drive, config, reports=folder / "one", on_progress=watch)
        times.append(begun["writing"] - begun["replaying"])
    frames = outcome.summary["frames"]["read"]
    return sorted(times[1:])[1] / frames, frames


def _wall(logs: Path, model: Path, folder: Path, workers: int) -> float:
    words = [ROADEVAL, "fleet", logs, "-o", folder, "--model", model, "--jobs", workers, "-q"]
    begun = perf_counter()
    subprocess.run(list(map(str, words)), check=True)
    return perf_counter() - begun


def _show(walls: dict[int, float], again: float, frame_s: float, frames: int) -> None:
    (one, alone), (many, together) = walls.items()
    bare = frames * frame_s
    print(f"a frame alone, in one thread: {1000 * frame_s:.1f} ms; {frames} of them: {bare:.1f} s")
    print(f"{one} worker: {alone:.1f} s, {alone / bare:.2f} times the frames' own time")
    print(f"{many} workers: {together:.1f} s, {together / alone:.2f} times one worker's, ")
    print(f"    {many * together / bare:.2f} times the frames' own time in all processes")
    print(f"the same command again: {again:.1f} s")


def _extrapolate(folder: Path, walls: dict[int, float], frame_s: float) -> None:
    """Print the time and space for `HOURS` of video, in drives of `DRIVE_HOURS`."""
    fleet = roadeval.Result(folder)
    drives, frames = len(fleet.drives), int(fleet.drives["read"].sum())
    per_drive = (walls[1] - frames * frame_s) / drives
    count = HOURS // DRIVE_HOURS
    total = HOURS * 3600 * RATE_HZ
    size = sum(Path(source).stat().st_size for source in fleet.drives["source"]) / frames
    sizes = {
        "frames/": sum(f.stat().st_size for f in folder.glob("frames/*/*")) / frames,
        "results/": sum(f.stat().st_size for f in folder.glob("results/*/*")) / frames,
    }
    hours = (total * frame_s + count * per_drive) / 3600
    print(f"{HOURS} hours at {RATE_HZ} Hz, in {count} drives: {total:,} frames")
    print(f"    {hours:.0f} core hours, of them {count * per_drive / 3600:.1f} beside the frames")
    print(f"    logs: {total * size / 1e12:.1f} TB, read at {size / frame_s / 1e6:.1f} MB/s a core")
    for name, bytes_ in sizes.items():
        print(f"    {name:<9} {bytes_:.0f} bytes a frame, {total * bytes_ / 1e9:.0f} GB")


if __name__ == "__main__":
    main()

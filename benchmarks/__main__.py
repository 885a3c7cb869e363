"""How fast roadeval is, against what: see benchmarks/README.md.

python -m benchmarks [--drive FILE] [--sizes 640x480 ...] [--jobs 1 2] [--repeat 3]
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import tempfile
from contextlib import nullcontext
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks import drives, processes
from benchmarks.drives import Source
from benchmarks.plainly import PlainWay
from benchmarks.replaying import (
    Held,
    NoRecorder,
    hold,
    library_codecs,
    lines_of,
    measure_floor,
    measure_loop,
    measure_replay,
)
from benchmarks.timing import Spread, ratios, table, timed
from roadeval.config.run import configure
from roadeval.data import Frame, Role
from roadeval.jobs.progress import ignore
from roadeval.jobs.run import frame as runner
from roadeval.jobs.run.prepared import prepare, process
from roadeval.logs.log import open_log
from roadeval.pipeline.stage import View
from roadeval.recording.layout import RecordRule
from roadeval.recording.recorder import Recorder
from roadeval.runtime.threads import one_thread_each

Rows = list[dict[str, Any]]
TURNS = 3
"""Turns of loop and floors for each `--repeat`: a turn takes seconds, and so does a slow-down."""
PARTS = ("replay", "stages", "plain", "process")


def main() -> None:
    """Measure the chosen parts, print the tables and write the JSON."""
    options = parse_arguments()
    source = Source(options.drive, tuple(options.road_label), tuple(options.ignore_label))
    frames = source.frames(options.frames)
    results: dict[str, Any] = {
        "machine": describe_machine(),
        "drive": options.drive.name,
        "sizes": {},
    }
    with tempfile.TemporaryDirectory() as folder:
        for size in options.sizes:
            name = "{}x{}".format(*size)
            measured = measure_size(frames, size, Path(folder), options)
            results["sizes"][name] = measured
            for part, rows in measured.items():
                print(table(f"{options.drive.stem} {name}: {part}", rows), flush=True)
    if options.output:
        options.output.write_text(json.dumps(results, indent=2, default=to_json) + "\n")


def measure_size(
    frames: list[Frame], size: tuple[int, int], folder: Path, options: argparse.Namespace
) -> dict[str, Rows]:
    drive = drives.write(folder / "drive.mcap", frames, size)
    run = configure({"run": {"jobs": 1}})
    tables: dict[str, Rows] = {}
    if "replay" in options.parts:
        held = hold(drive, run)
        tables["end to end and the codec floor"] = [
            measure_against_floor(drive, held, folder, jobs, options) for jobs in options.jobs
        ]
    if {"stages", "plain"} & set(options.parts):
        mine = measure_stages(drive, folder)
        tables["each stage alone, ms a frame"] = [
            {"stage": name, "ms": Spread.of([1e3 * t for t in times])}
            for name, times in mine.items()
        ]
        if "plain" in options.parts:
            tables["against the plain way, ms a frame"] = measure_plain(
                drive, mine, folder, options
            )
    if "process" in options.parts:
        tables["processes"] = measure_processes(frames, size, folder, options)
        tables["commands"] = measure_commands(frames, size, folder)
    return tables


def measure_against_floor(
    drive: Path, held: Held, folder: Path, jobs: int, options: argparse.Namespace
) -> dict[str, Any]:
    """Measure loop and floor in turns, so that a busy machine slows both; then the whole replay."""
    run, count = configure({"run": {"jobs": jobs}}), len(held.files)
    for work in (measure_loop, measure_replay):
        work(drive, run, folder)  # warms the caches
    turns = [
        (
            measure_loop(drive, run, folder),
            measure_floor(held, folder, jobs, library_codecs()),
            measure_floor(held, folder, jobs, nullcontext()),
        )
        for _ in range(TURNS * options.repeat)
    ]
    loops, floors, own_floors = ([cost.wall for cost in way] for way in zip(*turns, strict=True))
    loops_cpu, floors_cpu, _ = ([cost.cpu for cost in way] for way in zip(*turns, strict=True))
    wholes = [measure_replay(drive, run, folder).wall for _ in range(options.repeat)]
    loop_s, floor_s = Spread.of(loops).median, Spread.of(floors).median
    once = Spread.of([seconds - loop_s for seconds in wholes])
    spare = 1.5 * floor_s - loop_s
    return {
        "jobs": jobs,
        "frames": count,
        "floor ms/frame": Spread.of([1e3 * seconds / count for seconds in floors]),
        "loop ms/frame": Spread.of([1e3 * seconds / count for seconds in loops]),
        "loop / floor": ratios(loops, floors),
        "loop / floor, CPU": ratios(loops_cpu, floors_cpu),
        "loop / floor of own codecs": ratios(loops, own_floors),
        "whole / floor": Spread.of([seconds / floor_s for seconds in wholes]),
        "once, s": once,
        "whole <= 1.5 floor from": f"{once.median / spare * count:.0f} frames"
        if spare > 0
        else "never",
        "layers kB/frame": round(held.layer_bytes / 1e3),
    }


def measure_stages(drive: Path, folder: Path) -> dict[str, list[float]]:
    """Return the seconds of each part of every frame, one after the other in one thread."""
    times: dict[str, list[float]] = {}

    def lap(name: str, seconds: float) -> None:
        times.setdefault(name, []).append(seconds)

    config = configure({"run": {"jobs": 1}})
    with open_log(drive) as log, one_thread_each():
        run = prepare(log, config, ignore)
        recorder = Recorder(folder / "stages.rrd", run.layout(), RecordRule.parse("all"))
        with recorder:
            for position, logged in enumerate(log.frames(run.selection)):
                frame, seconds = timed(logged.decode)
                lap("decode", seconds)
                seen = View.of(frame.image)
                variants = tuple(runner.run_variant(n, c, seen) for n, c in run.chains.items())
                for variant in variants:
                    for stage in variant.stages:
                        lap(f"{variant.variant} {stage.stage}", stage.seconds)
                score = partial(run.board.score, frame, Role.EVALUATED, variants)
                result, seconds = timed(score)
                lap("score", seconds)
                encoded, seconds = timed(partial(recorder.encode, result, position))
                lap("encode", seconds)
                lap("write", timed(partial(recorder.write, encoded, lines_of(result)))[1])
            recorder.finish({})
    return times


def measure_plain(
    drive: Path, mine: dict[str, list[float]], folder: Path, options: argparse.Namespace
) -> Rows:
    config = configure({"run": {"jobs": 1}})
    with open_log(drive) as log:
        run = prepare(log, config, ignore)
        frames = [logged.decode() for logged in log.frames(run.selection)]
        step = max(1, len(frames) // options.plain_frames)
        chosen = range(len(frames))[step // 2 :: step][: options.plain_frames]
        results = [
            done.encoded
            for i, (_, done) in enumerate(process([run], NoRecorder(), ignore))
            if i in chosen
        ]
    plain = PlainWay(frames, config)
    for name, parameters in run.model.parameters.items():
        plain.require_same_machine(name, parameters["svm"])
    plain.save(folder / "plain.rrd")
    for result in results:
        plain.run(result.frame, result.variants)
    ours = {name: Spread.of(times).median for name, times in mine.items()}
    mean_write = sum(mine["write"]) / len(mine["write"])  # it writes every eighth frame
    ours["all record"] = ours["encode"] + mean_write
    theirs = {name: Spread.of(times).median for name, times in plain.times.items()}
    rows = [compare_row(name, theirs[name], ours[name]) for name in theirs]
    for title, left_out in (("sum", ""), ("sum without svm", "svm")):
        names = [name for name in theirs if not left_out or not name.endswith(left_out)]
        sums = [sum(seconds[name] for name in names) for seconds in (theirs, ours)]
        rows.append(compare_row(title, *sums))
    return rows


def compare_row(name: str, theirs: float, ours: float) -> dict[str, Any]:
    return {
        "stage": name,
        "plain": f"{1e3 * theirs:.4g}",
        "roadeval": f"{1e3 * ours:.4g}",
        "times faster": f"{theirs / ours:.4g}",
    }


def measure_processes(
    frames: list[Frame], size: tuple[int, int], folder: Path, options: argparse.Namespace
) -> Rows:
    short = drives.write(folder / "short.mcap", frames, size, options.memory_frames)
    first, end = processes.seconds(short, folder)
    rows: Rows = [
        {"what": "first recorded frame after, s", "value": f"{first:.3g}"},
        {"what": f"{options.memory_frames} frames, s", "value": f"{end:.3g}"},
    ]
    for times in (1, 10):
        count = times * options.memory_frames
        drive = drives.write(folder / "long.mcap", frames, size, count)
        peak = processes.peak_mib(drive, folder)
        rows.append({"what": f"peak memory, {count} frames, MiB", "value": f"{peak:.0f}"})
    return rows


def measure_commands(frames: list[Frame], size: tuple[int, int], folder: Path) -> Rows:
    short = drives.write(folder / "eleven.mcap", frames, size, 11)
    drive = drives.write(folder / "whole.mcap", frames, size)
    return [
        {
            "command": name,
            "wall, s": Spread.of([cost.wall for cost in costs]),
            "CPU, s": Spread.of([cost.cpu for cost in costs]),
        }
        for name, costs in processes.costs(short, drive, folder).items()
    ]


def describe_machine() -> dict[str, Any]:
    return {
        "platform": platform.platform(),
        "python": platform.python_version(),
        "cores": os.cpu_count(),
        "load": os.getloadavg(),
    }


def to_json(value: Any) -> Any:
    return asdict(value) if isinstance(value, Spread) else str(value)


def parse_size(text: str) -> tuple[int, int]:
    width, height = text.split("x")
    return int(width), int(height)


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--drive", type=Path, default=Path("recordings/demo.mcap"))
    parser.add_argument("--road-label", type=int, action="append", default=[])
    parser.add_argument("--ignore-label", type=int, action="append", default=[])
    parser.add_argument(
        "--sizes", type=parse_size, nargs="+", default=[(640, 480), (1280, 720), (1920, 1080)]
    )
    parser.add_argument("--jobs", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--repeat", type=int, default=3, help="rounds after the warming one")
    parser.add_argument("--frames", type=int, default=100, help="of the drive, at most")
    parser.add_argument("--plain-frames", type=int, default=2)
    parser.add_argument("--memory-frames", type=int, default=40, help="and ten times as many")
    parser.add_argument("--parts", choices=PARTS, nargs="+", default=PARTS)
    parser.add_argument("-o", "--output", type=Path, help="the results as JSON")
    return parser.parse_args()


if __name__ == "__main__":
    main()

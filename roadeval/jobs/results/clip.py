"""Short films of the frames on which a result fails, and their messages in the log."""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import count
from pathlib import Path

import numpy as np

from roadeval.data import Rgb, as_plain
from roadeval.data.words import percent
from roadeval.errors import RoadevalError, check_count
from roadeval.evaluation.metrics import TESTED
from roadeval.fleet.remote import open_source
from roadeval.jobs.outputs import holding
from roadeval.jobs.progress import OnProgress, Progress, ignore
from roadeval.jobs.results.frames import FramePicker, facts_of
from roadeval.jobs.results.inspect import rank_frames
from roadeval.jobs.results.pick import find_recordings
from roadeval.jobs.results.result import DriveResult, Result, local_path
from roadeval.logs.log import open_log
from roadeval.logs.writing.writer import VIDEO_SUFFIXES
from roadeval.report.film import clip_picture, encode
from roadeval.results.facts import focus_of
from roadeval.results.verdict import lowest
from roadeval.runtime.files import AnyPath, put, writing


def clip(
    result: AnyPath,
    output: AnyPath = "clips",
    *,
    worst: int | None = None,
    frames: Container[int] | None = None,
    focus: str | None = None,
    mcap: bool = False,
    on_progress: OnProgress = ignore,
) -> tuple[list[Path], list[str]]:
    """Write short films of where a result fails; return them, and the losses of the log, if any.

    Errors are painted over the camera image: the errors of the ``focus`` on the left, and the
    errors of the best other variant beside them. The result is a recording, its results folder, or
    a fleet; the output is a folder, or the MP4 or GIF of one clip. The ``worst`` scenes are filmed,
    one clip each, or the given ``frames``, such as ``range(40, 81)``. With ``mcap`` the messages of
    the log lie beside each clip. A `RoadevalError` if there are no pictures, both ``worst`` and
    ``frames`` are given, or a file cannot be written.
    """
    if worst is not None:
        check_count("worst", worst)
        if frames is not None:
            raise RoadevalError("worst and frames do not go together")
    place, films, losses = Path(output), list[Path](), list[str]()
    form = {".mp4": "mp4", ".gif": "gif"}.get(place.suffix.lower())
    if form is None and place.suffix.lower() in VIDEO_SUFFIXES:
        raise RoadevalError("a clip ends in .mp4 or .gif", where=place)
    results = [Result(path, focus=focus) for path in find_recordings(local_path(result))]
    drives = [drive for opened in results for drive in (*opened.rig, opened.drive) if drive]
    scenes = [*_scenes(drives, worst or (1 if form else 5), frames)]
    if not scenes:
        none = "no pictures of such frames were kept; --record keeps some, and in a fleet --keep"
        if frames is not None and (held := [n for drive in drives for n in drive.pictured]):
            none = f"no pictures of such frames; there are some of {min(held)} to {max(held)}"
        raise RoadevalError(none, where=result)
    if form and len(scenes) > 1:
        raise RoadevalError("a file holds one clip: name a folder", where=place)
    # The colour matrix is stated, because a player would guess it from the size. x264's tree of
    # macroblocks is off: with it (build 165, AVX-512) one encoding in a hundred of equal pictures
    # has other bytes.
    options = {"crf": "20", "preset": "veryfast", "colorspace": "smpte170m"}
    options["x264-params"] = "mbtree=0"
    total = sum(len(numbers) for _, numbers, _ in scenes)
    steps = map(on_progress, (Progress(done, total, "filming") for done in count(1)))
    titles = [drive.title for drive in drives]
    for drive, numbers, name in scenes:
        part = drive.path.stem if titles.count(drive.title) > 1 else ""  # names may repeat
        path = place if form else place / part / f"{name}.mp4"
        log = path.with_suffix(".mcap") if mcap else None
        inputs = [result, drive.path, getattr(drive.facts.log, "path", None)]
        with holding(path, log, inputs=inputs), writing(path, RoadevalError):
            losses += _write_log(drive, numbers, log) if log else ()
            rate, pictures = _film(drive, numbers, steps)
            put(path, encode(pictures, form or "mp4", rate, options))
        films.append(path)
    return films, [*dict.fromkeys(losses)]


def _scenes(
    drives: Sequence[DriveResult], number: int, frames: Container[int] | None
) -> Iterator[tuple[DriveResult, list[int], str]]:
    """Yield the drive, the frames and the name of each clip."""
    ranked = []
    for drive in drives:
        if frames is None:
            ranked += [(drive, frame) for frame in rank_frames(drive, number, drive.pictured)]
        elif numbers := [frame for frame in drive.pictured if frame in frames]:
            yield drive, numbers, f"{as_plain(drive.title)}-{numbers[0]:04d}-{numbers[-1]:04d}"
    # Errors come first: the doubt of a camera without truth is not an error rate.
    ranked.sort(key=lambda pair: (pair[1].by != TESTED, -(pair[1].rates[pair[1].by] or 0.0)))
    for drive, worst in ranked[:number]:
        times = drive.recording.stamps if drive.recording else {}
        stamps = np.array([times[frame] for frame in drive.pictured])
        near = abs(stamps - worst.stamp_ns) <= max(2e9, 2.5 * np.ptp(stamps) / len(stamps))
        numbers = np.array(drive.pictured)[near].tolist()
        yield drive, numbers, f"{as_plain(drive.title)}-{worst.frame:04d}"


def _film(
    drive: DriveResult, frames: Sequence[int], steps: Iterator[None]
) -> tuple[Fraction, Iterator[Rgb]]:
    """Return 2 to 30 frames a second, and the pictures: the focus and the best other variant."""
    recording, picker = drive.recording, FramePicker(drive)
    assert recording is not None
    variants = [variant.name for variant in recording.variants]
    focus, finals = focus_of(variants, drive.focus), drive.facts.final_totals
    best = lowest({n: finals[n] for n in finals if n in variants and n != focus})
    shown = [*dict.fromkeys(filter(None, [focus, best, *variants]))][:2]
    rows = facts_of(drive) if len(drive.rows) else ()
    rates_of = {(row.frame, name): row.rates[name] for row in rows for name in row.rates}
    span_s = (recording.stamps[frames[-1]] - recording.stamps[frames[0]]) / 1e9
    rate = min(max((len(frames) - 1) / max(span_s, 0.001), 2), 30)
    speed = f"{span_s * rate / (len(frames) - 1):.1f}" if span_s > 0 else "1.0"
    title = drive.title if speed == "1.0" else f"{drive.title}, {speed} x speed"

    def picture(frame: int) -> Rgb:
        next(steps)
        panels = []
        for name in shown:
            panel, rates = picker.outcome(recording, name, frame), rates_of.get((frame, name), {})
            numbers = ", ".join(f"{rate} {percent(value)} %" for rate, value in rates.items())
            panels.append(replace(panel, title=f"frame {frame}, {name}: {numbers or 'not scored'}"))
        return clip_picture(panels, drive.truth(frame), title)

    return Fraction(round(100 * rate), 100), map(picture, frames)


def _write_log(drive: DriveResult, frames: Sequence[int], path: Path) -> tuple[str, ...]:
    """Write the log's own messages of frames; return the losses of the log."""
    if (log_facts := drive.facts.log) is None:
        raise RoadevalError("a partial recording, which names no log", where=drive.path)
    with open_log(open_source(log_facts.path), every_topic=True) as log:
        if log.digest != log_facts.digest:
            raise RoadevalError("another log than that of this result", where=log_facts.path)
        log.write_excerpt(str(drive.properties["image_topic"]), frames[0], frames[-1], path)
        return log.losses

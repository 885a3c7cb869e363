"""Short films of the frames on which a result fails, and the log's own messages of these."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import replace
from itertools import chain, count
from pathlib import Path

import numpy as np

from roadeval.data import Rgb, as_plain
from roadeval.data.words import percent
from roadeval.errors import RoadevalError
from roadeval.evaluation.metrics import SHORT
from roadeval.evaluation.tables import finals
from roadeval.fleet.remote import open_source
from roadeval.jobs.outputs import holding
from roadeval.jobs.progress import OnProgress, Progress, ignore
from roadeval.jobs.results.frames import FramePicker, rates_by_frame
from roadeval.jobs.results.inspect import rank_frames
from roadeval.jobs.results.pick import find_recordings
from roadeval.jobs.results.result import DriveResult, Result
from roadeval.logs.log import open_log
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

    Errors are painted over the camera, those of the ``focus`` on the left, of the best other
    variant beside it. The result is a recording, the folder of its results, or a fleet. The output
    is a folder, or the MP4 or GIF of one clip. Each of the ``worst`` 5 scenes is filmed, or one
    into a file; or these ``frames``, as ``range(40, 81)``. With ``mcap`` the log's own messages lie
    beside each clip, from 2 s before it. A `RoadevalError` if there are no pictures, or a file
    cannot be written.
    """
    place, films, losses, done = Path(output), list[Path](), list[str](), count(1)
    form = place.suffix.lower().removeprefix(".")
    is_file = form in ("mp4", "gif")
    results = [Result(path, focus=focus) for path in find_recordings(Path(result))]
    drives = [*chain(*(opened.rig or filter(None, [opened.drive]) for opened in results))]
    scenes = [*_scenes(drives, worst or (1 if is_file else 5), frames)]
    if not scenes or (is_file and len(scenes) > 1):
        problem = "a file holds one clip: name a folder" if scenes else "no pictures of such frames"
        raise RoadevalError(problem, where=place if scenes else result)
    # With its matrix stated, no player guesses it from the size.
    options = {"crf": "20", "preset": "veryfast", "colorspace": "smpte170m"}
    total = sum(len(numbers) for _, numbers, _ in scenes)
    for drive, numbers, name in scenes:
        path = place if is_file else place / f"{name}.mp4"
        log = path.with_suffix(".mcap") if mcap else None
        with holding(path, log, inputs=[result, drive.path]), writing(path, RoadevalError):
            losses += _write_log(drive, numbers, log) if log else ()
            step = lambda: on_progress(Progress(next(done), total, "filming"))  # noqa: E731
            rate, pictures = _film(drive, numbers, step)
            put(path, encode(pictures, form if is_file else "mp4", rate, options))
        films.append(path)
    return films, [*dict.fromkeys(losses)]


def _scenes(
    drives: Sequence[DriveResult], number: int, frames: Container[int] | None
) -> Iterator[tuple[DriveResult, list[int], str]]:
    """Yield the drive, the frames and the name of each clip."""
    ranked = []
    for drive in drives:
        name = "-".join(filter(None, map(as_plain, (drive.name, drive.camera))))
        if frames is None:
            ranked += [(drive, f, name) for f in rank_frames(drive, number, drive.pictured)]
        elif numbers := [frame for frame in drive.pictured if frame in frames]:
            yield drive, numbers, f"{name}-{numbers[0]:04d}-{numbers[-1]:04d}"
    ranked.sort(key=lambda scene: -(scene[1].rates[scene[1].by] or 0.0))
    for drive, worst, name in ranked[:number]:
        times = drive.recording.stamps if drive.recording else {}
        stamps = np.array([times[frame] for frame in drive.pictured])
        near = abs(stamps - worst.stamp_ns) <= max(2e9, 2.5 * np.ptp(stamps) / len(stamps))
        numbers = np.array(drive.pictured)[near].tolist()
        yield drive, numbers, f"{name}-{worst.frame:04d}"


def _film(
    drive: DriveResult, frames: Sequence[int], step: Callable[[], None]
) -> tuple[float, Iterator[Rgb]]:
    """Return frames a second, 2 to 30, and the pictures: the focus, and the best other variant."""
    recording, picker = drive.recording, FramePicker(drive)
    assert recording is not None
    variants = [variant.name for variant in recording.variants]
    focus, totals, final = focus_of(variants, drive.focus), drive.facts.totals, drive.facts.finals
    best = lowest({n: totals[n][final[n]] for n in final if n in variants and n != focus})
    shown = [*dict.fromkeys(filter(None, [focus, best, *variants]))][:2]
    rates_of = {frame: rates for frame, _, rates in rates_by_frame(finals(drive.rows), [*SHORT])}
    span_s = (recording.stamps[frames[-1]] - recording.stamps[frames[0]]) / 1e9
    rate = min(max((len(frames) - 1) / max(span_s, 0.001), 2), 30)
    speed = f"{span_s * rate / (len(frames) - 1):.1f}" if span_s > 0 else "1.0"
    about = drive.title if speed == "1.0" else f"{drive.title}, {speed} x speed"

    def picture(frame: int) -> Rgb:
        step()
        panels = []
        for name in shown:
            panel, rates = picker.outcome(name, frame), rates_of.get(frame, {}).get(name, {})
            numbers = ", ".join(f"{rate} {percent(value)} %" for rate, value in rates.items())
            text = f"frame {frame}, {f'{name}: {numbers}' if numbers else panel.title}"
            panels.append(replace(panel, title=text))
        return clip_picture(panels, drive.truth(frame), about)

    return rate, map(picture, frames)


def _write_log(drive: DriveResult, frames: Sequence[int], path: Path) -> tuple[str, ...]:
    """Write the log's own messages of frames; return the losses of the log."""
    if (about := drive.facts.log) is None:
        raise RoadevalError("a partial recording, which names no log", where=drive.path)
    with open_log(open_source(about.path), every_topic=True) as log:
        if log.digest != about.digest:
            raise RoadevalError("another log than that of this result", where=about.path)
        log.write_excerpt(str(drive.properties["image_topic"]), frames[0], frames[-1], path)
        return log.losses

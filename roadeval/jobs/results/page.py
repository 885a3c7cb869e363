"""The content of a drive's page: its video, its frames with pictures, and the reader's choices."""

from __future__ import annotations

import json
from bisect import bisect_right
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

import numpy as np

from roadeval.data import OUTCOMES
from roadeval.evaluation import tables
from roadeval.evaluation.metrics import SHORT
from roadeval.evaluation.score.thresholds import LEVELS
from roadeval.evaluation.score.unlabelled import SIGNS
from roadeval.evaluation.tables import finals, only, values_of
from roadeval.jobs.progress import OnProgress, Progress, ignore
from roadeval.jobs.results.frames import FramePicker, evenly, facts_of
from roadeval.jobs.results.result import DriveResult
from roadeval.report import film
from roadeval.report.blocks import Strip
from roadeval.report.charts.standard import over_frames, ribbons
from roadeval.report.sections.frames import FrameBrowser, ThresholdSlider
from roadeval.results.verdict import verdicts

if TYPE_CHECKING:
    import numpy.typing as npt

PICTURED: Final = 8
"""Greatest number of frames of a page with pictures of all layers."""
BYTES: Final = 9_900_000
"""Greatest size of a page."""
FILMED: Final = 500
"""Greatest number of frames of a page's video; a longer drive is thinned."""
PROBABILITY_LAYER: Final = "probability"
"""The layer of a stage that tells how probable road is."""
FILM_BYTES: Final = 30_000
"""Greatest number of bytes of a page's video for each frame; the text of the page has a third
more."""


def browsed(result: DriveResult) -> FrameBrowser:
    """Collect the frames of a result for a page, without their pictures."""
    frames, names = result.rows, [*SHORT]
    if not len(frames):
        frames = result.table("unlabelled")
        names = [sign for sign in SIGNS if frames[sign].notna().any()]
    charts = over_frames(frames, names)
    masks = finals(result.rows)
    variants = values_of(frames, "variant")
    return FrameBrowser(
        rows=[*facts_of(result)],
        variants=variants,
        titles=names,
        charts=charts,
        command=result.inspect("{}") if result.recording else "",
        ribbons=ribbons(charts[:1]),
        counts={
            name: dict(
                zip(rows["frame"].tolist(), rows[[*OUTCOMES]].to_numpy().tolist(), strict=True)
            )
            for name in variants
            if len(rows := only(masks, variant=name))
        },
        verdicts=verdicts(result.facts, result.table("unlabelled")),
        focus=result.focus or "",
        worst={
            name: tables.worst(only(masks, variant=name), PICTURED)["frame"].tolist()
            for name in variants
        },
        thresholds=[*_thresholds_of(result)],
    )


def _thresholds_of(result: DriveResult) -> Iterator[ThresholdSlider]:
    """Yield the threshold of each stage that tells how probable road is; the reader can move it."""
    facts, levels = result.facts, result.table("probabilities")
    for variant, stages in facts.curves.items():
        for stage in stages:
            rows = only(levels, variant=variant, stage=stage)
            best, settings = facts.thresholds.get(variant, {}), facts.settings.get(variant, {})
            used = settings.get(stage, {}).get("threshold", best.get("own"))
            if used is None or not len(rows):
                continue
            by_level = np.zeros((2, LEVELS), np.int64)
            by_level[:, rows["level"]] = rows[["other", "road"]].to_numpy().T
            counts = [facts.totals[variant][stage][name] for name in OUTCOMES]
            line, is_own = "threshold = {}", stage in settings
            if stage == "net":
                network = json.dumps(settings["net"]["file"])
                line = f"# for --net {variant}={variant}.toml\nfile = {network}\n{line}"
            elif is_own:
                line = f"# in the settings of {variant}\n[{stage}]\n{line}"
            yield ThresholdSlider(variant, stage, used, line, counts, by_level, reached=not is_own)


def film_of(result: DriveResult, room: int, on_progress: OnProgress = ignore) -> film.Film | None:
    """Return the video of a drive, of at most ``room`` bytes; None without pictures or room.

    A long drive is thinned evenly; frames with pictures of all layers are kept if there is room.
    """
    recording = result.recording
    if recording is None or not result.pictured or room < FILM_BYTES:
        return None
    scored = {*result.rows["frame"]}
    pictured = [frame for frame in result.pictured if frame in scored] or [*result.pictured]
    frames = sorted({*evenly(pictured, FILMED), *_choose_frames(result, PICTURED)})
    finals_of = {variant.name: variant.stages[-1] for variant in recording.variants}
    layers = {
        variant.name: {spec.name for spec in variant.layers} for variant in recording.variants
    }
    probable = [name for name in result.facts.curves if PROBABILITY_LAYER in layers.get(name, ())]
    panels = [
        *(film.CAMERA, *[film.TRUTH_PANEL] * bool(scored)),
        *map(film.MASK.format, finals_of),
        *map(film.PROBABILITY.format, probable),
    ]

    def read(frame: int) -> Iterator[tuple[str, npt.NDArray[np.uint8]]]:
        on_progress(Progress(bisect_right(frames, frame), len(frames), "filming"))
        yield film.CAMERA, recording.image(frame)
        if frame in scored:
            yield film.TRUTH_PANEL, film.shade_truth(recording.truth(frame))
        for name, stage in finals_of.items():
            if (mask := result.layer(name, stage, frame)) is not None:
                yield film.MASK.format(name), mask * np.uint8(255)
        for name in probable:
            if (probability := result.layer(name, PROBABILITY_LAYER, frame)) is not None:
                yield film.PROBABILITY.format(name), (probability * 255).astype(np.uint8)

    while True:
        film_file = film.make_film(frames, panels, lambda frame: dict(read(frame)), room)
        if len(film_file.content) <= room or len(frames) < 2:
            return film_file
        frames = frames[::2]


def strips_of(result: DriveResult, room: int, on_progress: OnProgress = ignore) -> list[Strip]:
    """Return the worst frames, and others, with their pictures in the drive's order.

    There are at most `PICTURED`, and no more than fit into so many bytes of a page.
    """
    if result.recording is None:
        return []
    frames = _choose_frames(result, PICTURED)
    picker, strips = FramePicker(result, None, None), []
    for done, frame in enumerate(frames, 1):
        pictures = picker.strip(frame)
        # A page holds a picture as a text, and has words around it.
        room -= sum(len(image.content) * 4 // 3 + 400 for image in pictures.images())
        if room < 0:
            break
        strips.append(pictures)
        on_progress(Progress(done, len(frames), "reading"))
    return sorted(strips, key=lambda strip: strip.frame)


def _choose_frames(result: DriveResult, count: int) -> list[int]:
    """Return the frames to show: first the worst of the focus, then others, evenly spread."""
    rows = result.rows
    scored_frames = {*rows["frame"]}
    pictured_frames = [number for number in result.pictured if number in scored_frames]
    pictured = pictured_frames or [*result.pictured]
    focus = result.facts.focus
    spread = evenly(pictured, count)
    if focus is None:
        unlabelled = result.facts.unlabelled
        look_at = unlabelled.look_at if unlabelled else ()
        doubtful = [frame for frame in look_at if frame in pictured]
        return list(dict.fromkeys([*doubtful, *spread]))[:count]
    masks = finals(only(rows, variant=focus))
    worst = tables.worst(masks[masks["frame"].isin(pictured)], count)["frame"].tolist()
    return list(dict.fromkeys([*worst, *spread]))[:count]

"""Labels that look wrong: found in a recording, and written for an annotation tool."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.config.run import RunConfig
from roadeval.data import IGNORE, ROAD, colours
from roadeval.data.arrays import Image, Plane
from roadeval.errors import RoadevalError
from roadeval.evaluation.score.label_errors import (
    BLOCK,
    LabelledView,
    find_suspects,
    rank_suspects,
)
from roadeval.evaluation.tables import concatenate
from roadeval.images.decoding import png_of
from roadeval.jobs.progress import OnProgress, ignore
from roadeval.jobs.results.pick import PNG, open_drives
from roadeval.jobs.results.result import DriveResult
from roadeval.logs.settings import AUDIT
from roadeval.logs.truth.audits import FORMAT
from roadeval.logs.truth.formats.coco import as_coco
from roadeval.logs.truth.picks import IMAGES, LABELS, PROPOSALS
from roadeval.logs.truth.shapes import Proposal
from roadeval.recording.layout import DamagedError, RecordingError
from roadeval.results.folder import RUN
from roadeval.results.labels import describe_annotator, describe_suspect, describe_suspects
from roadeval.results.rows import records
from roadeval.runtime.files import AnyPath, put, writing

if TYPE_CHECKING:
    import pandas as pd

SUSPECTS: Final = "suspects"
"""The folder with a picture of each label that looks wrong."""


@dataclass(frozen=True)
class Audit:
    """The labels of a drive that look wrong."""

    suspects: pd.DataFrame
    """A row for each, the worst first: `Suspect`, whether it is ``clear``, ``rank``, and why."""
    labels: int
    """Number of labels that were examined."""
    sentences: list[str]
    """What does not fit as a whole, how many labels look wrong, and how far annotators differ."""
    log: str
    """Where the log lies."""
    config: Path | None
    """The file for ``--config`` that repeats its replay; None if there is none."""


def audit(
    source: AnyPath,
    count: int = 20,
    folder: AnyPath | None = None,
    config: RunConfig | None = None,
    *,
    labels: str = PNG,
    annotators: Sequence[str] = (),
    on_progress: OnProgress = ignore,
) -> Audit:
    """Find the labels of a drive that look wrong, and write them for correction.

    Parameters
    ----------
    source
        A recording or the results folder beside it, or a log, which is replayed first.
    count
        The most labels that are named, one a scene.
    folder
        Where images, labels to correct, and pictures of what looks wrong land; nowhere by default.
    config
        How a log is replayed.
    labels
        In which format the labels are written for correction: ``png`` or ``coco``.
    annotators
        The variants whose masks are another person's labels.

    Raises
    ------
    RoadevalError
        If there are no labels to look at, or the folder holds something else.
    """
    path = Path(source)
    if folder is not None and Path(folder).exists() and any(Path(folder).iterdir()):
        raise RoadevalError(f"{folder}: is not empty; name a folder of its own")
    with TemporaryDirectory(prefix="roadeval-") as place:
        drives = open_drives([path], Path(place), config or RunConfig(), on_progress)
        if len(drives) > 1:
            raise RoadevalError(f"{path}: a fleet: audit its drives one by one")
        ((path, drive, run),) = drives
        shares, tables, labelled = dict[str, list[float]](), [], 0
        frames, total = _labelled_views(drive, annotators, shares), len(drive.pictured)
        alike = -(-total // max(-(-total // BLOCK), 1))  # no block is much smaller than others
        while views := [*islice(frames, alike)]:
            tables.append(find_suspects(views))
            labelled += len(views)
        if not labelled:
            raise RoadevalError(
                f"{path}: no frame with truth and a picture: give --truth, or replay with "
                "--record masks"
            )
        suspects = rank_suspects(concatenate(tables), labelled, count)
        suspects.insert(0, "rank", range(1, len(suspects) + 1))
        suspects["why"] = [describe_suspect(row) for row in records(suspects)]
        sentences = [*drive.facts.misfits, describe_suspects(suspects)]
        for name in annotators:
            if name not in shares:
                raise RoadevalError(f"{path}: no masks of {name} on a frame with truth")
            share = float(np.mean(shares[name]))
            sentences.append(describe_annotator(name, share, len(shares[name])))
        if folder is not None:
            _write_audit(drive, suspects, Path(folder), labels, run)
        repeats = Path(folder, RUN) if run and folder is not None else None if run else path
        log = drive.facts.log
        return Audit(suspects, labelled, sentences, log.path if log else drive.name, repeats)


def _labelled_views(
    drive: DriveResult, annotators: Sequence[str], shares: dict[str, list[float]]
) -> Iterator[LabelledView]:
    """Yield the labelled frames; note on what share of pixels each annotator differs."""
    recording = drive.recording
    assert recording is not None
    for frame in drive.pictured:
        try:
            truth = recording.truth(frame)
        except DamagedError:
            raise
        except RecordingError:
            continue
        layers = ((v.name, drive.layer(v.name, v.stages[-1], frame)) for v in recording.variants)
        masks = {name: (mask == 1).astype(np.uint8) for name, mask in layers if mask is not None}
        labelled = truth != IGNORE
        for name in annotators:
            if name in masks and labelled.any():
                differ = (masks[name] != truth)[labelled]
                shares.setdefault(name, []).append(float(differ.mean()))
        stamp = recording.stamps[frame]
        yield LabelledView.of(frame, stamp, recording.image(frame), truth, masks)


def _write_audit(
    drive: DriveResult,
    suspects: pd.DataFrame,
    folder: Path,
    labels: str,
    run: str | None,
) -> None:
    """Write images, labels to correct and pictures, and last what was found."""
    recording, facts, rows = drive.recording, drive.facts, records(suspects)
    assert recording is not None
    if facts.run.get("frames", {}).get("scale", 1) != 1:
        raise RoadevalError("does not go with labels to correct", setting="frames.scale")
    with writing(folder, RoadevalError):
        for part in (IMAGES, PROPOSALS, LABELS, SUSPECTS):
            (folder / part).mkdir(parents=True, exist_ok=True)
        proposals, files = [], dict[str, bytes]()
        for suspect in rows:
            frame, name = suspect["frame"], f"{suspect['stamp_ns']:019d}.png"
            image, truth = recording.image(frame), recording.truth(frame)
            proposals.append(Proposal(name, truth == ROAD, truth == IGNORE))
            levels = np.select([truth == ROAD, truth == IGNORE], [255, 128], 0).astype(np.uint8)
            files[f"{PROPOSALS}/{name}"] = png_of(levels)
            files[f"{IMAGES}/{name}"] = png_of(image)
            shown = f"{SUSPECTS}/{suspect['rank']:02d}_frame_{frame:04d}.png"
            files[shown] = png_of(_mark(image, truth, suspect))
        if labels != PNG:
            files = {name: data for name, data in files.items() if not name.startswith(PROPOSALS)}
            files |= {f"{PROPOSALS}/{name}": data for name, data in as_coco(proposals).items()}
        for name, content in files.items():
            (folder / name).write_bytes(content)
        if run:
            put(folder / RUN, run.encode())
        put(folder / "audit.csv", suspects.to_csv(index=False).encode())
        about = {
            "format": FORMAT,
            "drive": drive.name,
            "camera": facts.drive.camera,
            "run": {name: facts.run.get(name, {}) for name in ("truth", "labels", "topics")},
            "suspects": rows,
        }
        put(folder / AUDIT, f"{json.dumps(about, indent=1)}\n".encode())


def _mark(image: Image, truth: Plane, suspect: Mapping[str, Any]) -> Image:
    """Return an image with its road in green, edged yellow, and a red box around an area."""
    import cv2

    marked, road, square = image.copy(), truth == ROAD, np.ones((3, 3), np.uint8)
    marked[road] = 0.7 * marked[road] + 0.3 * np.array(colours.ROAD)
    edge = cv2.morphologyEx(road.astype(np.uint8), cv2.MORPH_GRADIENT, square)
    marked[edge > 0] = colours.YELLOW
    corner = suspect["left"] - 4, suspect["top"] - 4
    opposite = suspect["right"] + 3, suspect["bottom"] + 3
    cv2.rectangle(marked, corner, opposite, colours.VERMILLION, 3)
    return marked

"""Labels that look wrong: found in a recording, and written for an annotation tool."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Final

import numpy as np
from pydantic import TypeAdapter

from roadeval.config.run import RunConfig, configure
from roadeval.data import IGNORE, ROAD, colours
from roadeval.errors import RoadevalError, check_count
from roadeval.evaluation.score.label_errors import BLOCK, LabelledView, find_suspects, rank_suspects
from roadeval.evaluation.tables import concatenate
from roadeval.images.decoding import png_of
from roadeval.jobs.progress import OnProgress, ignore
from roadeval.jobs.results.pick import PNG, check_format, open_drives, proposal_files
from roadeval.jobs.results.result import DriveResult
from roadeval.logs.settings import AUDIT
from roadeval.logs.truth.audits import FORMAT
from roadeval.logs.truth.picks import IMAGES, LABELS, PROPOSALS
from roadeval.logs.truth.shapes import Proposal
from roadeval.results.facts import is_fleet
from roadeval.results.folder import RUN
from roadeval.results.rows import records
from roadeval.results.sentences import describe_annotator, describe_suspect, describe_suspects
from roadeval.runtime.documents import read_bounded, read_json
from roadeval.runtime.files import AnyPath, put, writing
from roadeval.runtime.text import visible

if TYPE_CHECKING:
    import pandas as pd

PRESET: Final = "robust"
"""A method that is often wrong finds few wrong labels, so the default is the best preset."""
SUSPECTS: Final = "suspects"
"""The folder with a picture of each label that looks wrong."""


@dataclass(frozen=True)
class Audit:
    """The labels of a drive that look wrong."""

    suspects: pd.DataFrame
    """A row for each label, the worst first: `Suspect`, ``clear`` or not, ``rank``, and why."""
    labels: int
    """Number of labels that were examined."""
    sentences: list[str]
    """Sentences on misfits of the whole drive, on wrong labels, and on other annotators."""
    doubts: list[str]
    """The sentences that name wrong labels, or say how two people differ."""
    log: str
    """The place of the log."""
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
        Greatest number of labels that are named, one for each scene.
    folder
        Folder for images, labels to correct, and pictures of labels that look wrong; none by
        default.
    config
        Configuration for the replay of a log; by default the preset `PRESET`.
    labels
        Format of the labels that are written for correction: ``png`` or ``coco``.
    annotators
        The variants with another person's labels as masks.

    Raises
    ------
    RoadevalError
        If there are no labels to look at, or the folder is not empty.
    """
    check_count("count", count)
    check_format(labels)
    path, config = Path(source), config or configure({"preset": PRESET})
    output = None if folder is None else Path(folder)
    if output and output.exists() and any(output.iterdir()):
        raise RoadevalError(f"{output}: is not empty; name a folder of its own")
    if is_fleet(path):
        raise RoadevalError(f"{path}: a fleet: audit its drives one by one")
    if output:
        _check_scale(config.frames.scale)
    with TemporaryDirectory(prefix="roadeval-") as place:
        ((_, drive, run),) = open_drives([path], Path(place), config, on_progress)
        if output:
            _check_scale(drive.facts.run.get("frames", {}).get("scale", 1))
        frames = [frame for frame in drive.pictured if drive.truth(frame) is not None]
        if not frames:
            has_labels = drive.facts.frames.labelled
            problem = "no labelled frame has a picture" if has_labels else "no frame has a label"
            remedy = "replay with --record masks" if has_labels else "give labels with --truth"
            raise RoadevalError(problem, where=path, remedy=remedy)
        suspects = _find_suspects(drive, frames, count)
        on_labels = [describe_suspects(suspects)]
        for name in annotators:
            pairs = ((drive.truth(n), drive.final_masks(n).get(name)) for n in frames)
            shares = [
                float(((mask == 1) != truth)[truth != IGNORE].mean())
                for truth, mask in pairs
                if truth is not None and mask is not None and (truth != IGNORE).any()
            ]
            if not shares:
                raise RoadevalError(f"{path}: no masks of {name} on a frame with truth")
            on_labels.append(describe_annotator(name, float(np.mean(shares)), len(shares)))
        repeats = path if run is None else output and output / RUN
        log = drive.facts.log
        doubts = on_labels if suspects["clear"].any() else on_labels[1:]
        sentences, name = [*drive.facts.misfits, *on_labels], log.path if log else drive.name
        done = Audit(suspects, len(frames), sentences, doubts, name, repeats)
        if output:
            _write_audit(drive, done, output, labels, run)
        return done


def _check_scale(scale: float) -> None:
    if scale != 1:
        raise RoadevalError("does not go with labels to correct", setting="frames.scale")


def _find_suspects(drive: DriveResult, frames: Sequence[int], count: int) -> pd.DataFrame:
    """Return the suspects among the labels of some frames, with their ranks and why."""
    recording, tables = drive.recording, []
    assert recording is not None
    for block in np.array_split(frames, -(-len(frames) // BLOCK)):
        views = []
        for frame in block.tolist():
            truth, masks = recording.truth(frame), drive.final_masks(frame)
            about = frame, recording.stamps[frame], recording.image(frame)
            views.append(LabelledView.of(*about, truth, masks))
        tables.append(find_suspects(views))
    suspects = rank_suspects(concatenate(tables), len(frames), count)
    suspects.insert(0, "rank", range(1, len(suspects) + 1))
    suspects["why"] = [describe_suspect(row) for row in records(suspects)]
    return suspects


def read_doubts(folder: AnyPath, drive: DriveResult) -> list[str]:
    """Read the sentences on the labels of a drive from the folder of its audit.

    A `RoadevalError` if it is not such a folder, or of another drive.
    """
    path = Path(folder, AUDIT)
    try:
        about = read_json(read_bounded(path))
        sentences = TypeAdapter(list[str]).validate_python(about["sentences"])
        name, camera = about["drive"], about["camera"]
    except FileNotFoundError:
        problem = "is not a folder of roadeval audit"
        raise RoadevalError(problem, where=folder, remedy="make one with -o") from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        reason = str(error).partition("\n")[0]
        remedy = "audit into a new folder"
        raise RoadevalError(f"damaged ({reason})", where=path, remedy=remedy) from error
    if (name, camera) != (drive.name, drive.facts.drive.camera):
        about_other = visible(f"is of {name} {camera}, not of")
        raise RoadevalError(f"{about_other} {drive.title}", where=path)
    return [*map(visible, sentences)]


def _write_audit(
    drive: DriveResult, done: Audit, folder: Path, labels: str, run: str | None
) -> None:
    """Write images, labels to correct and pictures, and at the end the list of suspects."""
    import cv2

    recording, facts, rows = drive.recording, drive.facts, records(done.suspects)
    square = np.ones((3, 3), np.uint8)
    assert recording is not None
    with writing(folder, RoadevalError):
        for part in (IMAGES, PROPOSALS, LABELS, SUSPECTS):
            (folder / part).mkdir(parents=True, exist_ok=True)
        proposals = []
        for suspect in rows:
            frame, name = suspect["frame"], f"{suspect['stamp_ns']:019d}.png"
            image, truth = recording.image(frame), recording.truth(frame)
            proposals.append(Proposal(name, truth == ROAD, truth == IGNORE))
            (folder / IMAGES / name).write_bytes(png_of(image))
            marked, road = image.copy(), truth == ROAD
            marked[road] = 0.7 * marked[road] + 0.3 * np.array(colours.ROAD)
            edge = cv2.morphologyEx(road.astype(np.uint8), cv2.MORPH_GRADIENT, square)
            marked[edge > 0] = colours.YELLOW
            corner = suspect["left"] - 4, suspect["top"] - 4
            opposite = suspect["right"] + 3, suspect["bottom"] + 3
            cv2.rectangle(marked, corner, opposite, colours.VERMILLION, 3)
            shown = f"{suspect['rank']:02d}_frame_{frame:04d}_{name}"
            (folder / SUSPECTS / shown).write_bytes(png_of(marked))
        for name, content in proposal_files(proposals, labels).items():
            (folder / PROPOSALS / name).write_bytes(content)
        if run:
            put(folder / RUN, run.encode())
        put(folder / "audit.csv", done.suspects.to_csv(index=False).encode())
        about = {
            "format": FORMAT,
            "drive": drive.name,
            "camera": facts.drive.camera,
            "run": {name: facts.run.get(name, {}) for name in ("truth", "labels", "topics")},
            "sentences": done.doubts,
            "suspects": rows,
        }
        put(folder / AUDIT, f"{json.dumps(about, indent=1)}\n".encode())

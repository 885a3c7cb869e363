"""Opened results: of one drive, complete or partial, and of any number of drives."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data.arrays import Plane
from roadeval.data.result import AnyArray
from roadeval.errors import RoadevalError
from roadeval.evaluation import tables
from roadeval.evaluation.comparison.pairing import ComparedDrive
from roadeval.evaluation.score.scoreboard import drive_effects
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.tables import concatenate, values_of
from roadeval.recording.layout import DamagedError, RecordingError, SeveralCamerasError
from roadeval.results.facts import (
    FETCHED,
    SUMMARY,
    DriveFacts,
    Facts,
    FleetFacts,
    FrameAccount,
    TrainingFacts,
    focus_of,
    is_fleet,
)
from roadeval.results.fleet import FleetFolder, results_path
from roadeval.results.folder import RUN, ResultsFolder
from roadeval.results.rows import (
    Key,
    beyond_masks,
    drive_row,
    effect_rows,
    records,
    table_of,
    table_of_scores,
)
from roadeval.results.schema import TABLES
from roadeval.results.verdict import verdict, with_focus
from roadeval.runtime.text import likely, visible

if TYPE_CHECKING:
    import numpy.typing as npt
    import pandas as pd

    from roadeval.recording.recording import Recording

OF_ALL: Final = ("code of ", "network ")
"""Beginnings of the names that `input_digests` gives to files of all drives of a fleet."""
KEPT_ROWS: Final = 500_000
"""Greatest number of rows of a table that stays in memory; a larger one is read again if needed."""
NO_NUMBER: Final = ("output", "run", "fleet", "labels.names", "frames.disturb")
"""Tables of a run's settings that change no number."""


def _if_there(read: Callable[..., AnyArray], *address: Any) -> AnyArray | None:
    """Read a picture of a recording; None if it has none there."""
    try:
        return read(*address)
    except DamagedError:
        raise
    except RecordingError:
        return None


def local_path(result: str | Path) -> Path:
    """Return the path of a result; one behind a URL is fetched."""
    if "://" not in str(result):
        return Path(result)
    from roadeval.fleet.remote import fetch_result

    return fetch_result(str(result))


class DriveResult:
    """The result of a replay, from an ``.rrd`` or a results folder, of one ``camera`` of a rig.

    Its focus is ``focus`` if it has that variant, else the focus with which it was made. A
    `RoadevalError` if the path is neither, or was written by another program or format.
    """

    def __init__(self, path: str | Path, camera: str = "", focus: str | None = None) -> None:
        self.path = Path(path)
        self.camera: Final = camera
        self._chosen: Final = focus
        self.recording: Recording | None = None
        if not self.path.is_dir():
            # The import stands here, because a folder is read without the library of recordings.
            from roadeval.recording.recording import Recording

            self.recording = Recording(self.path, camera)
        self._tables: ResultsFolder | Recording = self.recording or ResultsFolder(self.path, camera)
        self._read: Final[dict[tuple[str, bool], pd.DataFrame]] = {}

    @property
    def complete(self) -> bool:
        """Whether the run reached its end."""
        return self.recording is None or self.recording.complete

    @property
    def warnings(self) -> tuple[str, ...]:
        """The warnings that a reader should see first."""
        return () if self.complete else (f"{self.path}: a partial recording: the end is missing",)

    @property
    def name(self) -> str:
        """The drive's name."""
        return self.recording.layout.drive if self.recording else self.facts.drive.name

    @property
    def title(self) -> str:
        """The drive's name, and in a rig the camera's."""
        return f"{self.name}, {self.camera}" if self.camera else self.name

    @property
    def again(self) -> str:
        """The command that makes the results again; empty if a run left no configuration."""
        path = self.path if self.recording else self.path / RUN
        has_configuration = self.recording.result("run") if self.recording else path.exists()
        if not has_configuration or self.facts.log is None:
            return ""
        return shlex.join(["roadeval", "replay", self.facts.log.path, "--config", str(path)])

    def inspect(self, frame: int | str) -> str:
        """Return the command that opens a frame in the viewer."""
        camera = ["--camera", self.camera] if self.camera else []
        path = self.viewable or self.path
        words = ["roadeval", "inspect", FETCHED.get(path, str(path)), *camera]
        return f"{shlex.join(words)} --frame {frame}"

    @property
    def written(self) -> Path:
        """The place where the run wrote its recording, if it made one."""
        place = self.facts.run.get("output", {}).get("save")
        return Path(place or Path("recordings", f"{self.name}.rrd"))

    @cached_property
    def viewable(self) -> Path | None:
        """The recording for the viewer: this one, or the recording of a results folder's run.

        It is None if no recording lies where the run wrote it, or if it is now of another drive.
        """
        if self.recording is not None:
            return self.path if self.pictured else None
        path = self.written
        # A summary from elsewhere may name a network share, which Windows would contact.
        if str(path).startswith(("//", "\\\\")) or not path.is_file():
            return None
        try:
            other = DriveResult(path, self.camera).facts.log_digest
        except RoadevalError:
            return None
        return path if other == self.facts.log_digest else None

    @cached_property
    def facts(self) -> Facts:
        """The facts; an incomplete run has only the facts that follow from its tables."""
        facts = self._written_facts()
        if self._chosen:
            return with_focus(facts, self._chosen, self.table("unlabelled"))
        return facts

    @property
    def focus(self) -> str | None:
        """The variant that the result is about, scored or not; None without any."""
        if self.facts.focus:
            return self.facts.focus
        doubts = self.facts.unlabelled
        return (
            doubts.variant if doubts else focus_of(values_of(self.table("unlabelled"), "variant"))
        )

    def _written_facts(self) -> Facts:
        if not self.complete:
            assert self.recording is not None
            layout, settings = self.recording.layout, EvaluationSettings()
            effects = drive_effects(self.rows, settings)
            totals = tables.as_trees(tables.totals(self.rows))
            return Facts(
                verdict(totals, effects),
                DriveFacts(
                    layout.drive,
                    str(layout.properties.get("image_topic", "")),
                    *(layout.width, layout.height),
                ),
                FrameAccount(
                    trained_on=int(layout.properties.get("training_frames", 0)),
                    evaluated=self.rows["frame"].nunique(),
                ),
                totals,
                training=TrainingFacts(str(layout.properties.get("trained_on"))),
                effects=effects,
            )
        assert self._tables.facts is not None
        return self._tables.facts

    @property
    def rows(self) -> pd.DataFrame:
        """The rows of ``frames``."""
        return self.table("frames")

    @property
    def key(self) -> Key:
        """Drive and camera, the first cells of every row of its tables."""
        return Key(visible(self.name), visible(self.facts.drive.camera))

    def table(self, name: str, *, final: bool = False) -> pd.DataFrame:
        """Return the rows of a table, such as ``oracles``; there are none if the run counted none.

        With ``final`` only rows of final masks are returned, from ``frames`` or ``regions``. A
        killed run may have cut one table: frames that are not in both of these are left out, and so
        are sums over all frames.
        """
        rows = self._read.get((name, final))
        if rows is None:
            rows = self._table(name, final)
            if len(rows) <= KEPT_ROWS:
                self._read[name, final] = rows
        return rows

    def _table(self, name: str, final: bool) -> pd.DataFrame:
        match name:
            case "drives":
                row = drive_row(self.facts, self.name, str(self.path))
                return table_of(name, [{**self.key._asdict(), **row}])
            case "effects":
                return table_of(name, effect_rows(self.facts, self.key))
            case "scores":
                return table_of_scores(
                    self.rows, self.table("regions"), beyond_masks(self.facts, self.key)
                )
            case "worst":
                return table_of(name, ())
        masks = tables.final_stages(tables.masks_of(self.rows)).items() if final else None
        rows = self._tables.table(name, masks)
        if self.complete or not len(rows) or name == "unlabelled":
            return rows
        return rows[rows["frame"].isin(self._both)] if "frame" in rows else rows[:0]

    @cached_property
    def pictured(self) -> tuple[int, ...]:
        """The frames that have pictures; empty for a results folder.

        A run may have kept few pictures. A killed run may have written only some layers of its last
        frames; these frames are left out.
        """
        if self.recording is None:
            return ()
        recording, unsure = self.recording, set(self.recording.unsure)
        counted = set(self.rows["frame"].tolist())
        return tuple(
            number
            for number in recording.frame_numbers
            if number not in unsure or recording.is_whole(number, scored=number in counted)
        )

    def layer(self, variant: str, name: str, frame: int) -> npt.NDArray[Any] | None:
        """Return a layer of a variant; None if the run did not keep it."""
        assert self.recording is not None
        return _if_there(self.recording.layer, variant, name, frame)

    def truth(self, frame: int) -> Plane | None:
        """Return the truth of a frame; None if there is none."""
        assert self.recording is not None
        return _if_there(self.recording.truth, frame)

    def final_masks(self, frame: int) -> dict[str, AnyArray]:
        """Return the final masks of a frame that the run kept, by their variants."""
        assert self.recording is not None
        layers = (
            (variant.name, self.layer(variant.name, variant.stages[-1], frame))
            for variant in self.recording.variants
        )
        return {name: mask for name, mask in layers if mask is not None}

    @property
    def properties(self) -> Mapping[str, str | int | float]:
        """The properties of the recording, which tell its origin; a folder has none."""
        return self.recording.layout.properties if self.recording else {}

    @cached_property
    def _both(self) -> list[int]:
        """The frames in both tables, of frames and of regions."""
        frames, regions = (self._tables.table(name)["frame"] for name in ("frames", "regions"))
        return np.intersect1d(frames, regions).tolist()


Opened = DriveResult | FleetFolder


class Result:
    """The results of any number of drives, with one table of each kind for all of them.

    A `RoadevalError` if a path leads to none of these, or to a result of another program or format,
    or if no result has the focus.

    Parameters
    ----------
    paths
        Recordings, results folders, fleets' folders, or URLs of recordings or of zips of these.
    focus
        The variant that they are about: verdict, worst frames, pictures. By default
        the focus with which they were made.

    Examples
    --------
    >>> import roadeval
    >>> for path in ("out.rrd", "monday"):
    ...     result = roadeval.Result(path)
    ...     final = result.scores.query("final and region == 'all'")
    ...     print(len(result.drives), *sorted(final.groupby("variant").ERR.mean().index))
    1 blind filtered unfiltered
    1 blind filtered unfiltered
    """

    def __init__(self, *paths: str | Path, focus: str | None = None) -> None:
        self.paths = tuple(map(local_path, paths))
        places = [path.resolve() for path in self.paths]
        if twice := [
            path for path, place in zip(paths, places, strict=True) if places.count(place) > 1
        ]:
            raise RoadevalError("it is named twice", where=twice[0], remedy="name each result once")
        self._chosen: Final = focus
        self._opened: list[Opened] = []
        for path in self.paths:
            if is_fleet(path):
                self._opened.append(FleetFolder(path, focus))
                continue
            try:
                drive = DriveResult(path, focus=focus)
            except SeveralCamerasError as error:
                self._opened += [DriveResult(path, name, focus) for name in error.cameras]
                continue
            except RoadevalError as error:
                raise error.of(error, FETCHED.get(path, "")) from error
            cameras = drive.facts.cameras if drive.recording is None else ()
            self._opened += [DriveResult(path, name, focus) for name in cameras] or [drive]
        if focus:
            scored = [[*result.facts.finals] for result in self._opened]
            doubts = [values_of(drive.table("unlabelled"), "variant") for drive in self._drives]
            focus_of(dict.fromkeys(chain.from_iterable(scored + doubts)), focus)

    @cached_property
    def cameras(self) -> dict[str, Result]:
        """The result of each camera by its name, if a single rig was opened; else none."""
        cameras = {}
        for drive in self.rig:
            result = cameras[drive.camera] = Result()
            result.paths, result._opened = self.paths, [drive]
        return cameras

    @property
    def rig(self) -> list[DriveResult]:
        """The results of the cameras, if a single rig was opened; else there are none."""
        return self._drives if len(self.paths) == 1 < len(self._drives) else []

    @property
    def _drives(self) -> list[DriveResult]:
        return [result for result in self._opened if isinstance(result, DriveResult)]

    @property
    def name(self) -> str:
        """The drive's or the fleet's name; several results have all their names."""
        return ", ".join(result.name for result in self.rig[:1] or self._opened)

    @property
    def fleet(self) -> FleetFolder | None:
        """The fleet's folder, if a single fleet was opened."""
        (first, *others) = self._opened
        return first if isinstance(first, FleetFolder) and not others else None

    @property
    def drive(self) -> DriveResult | None:
        """The result of the drive, if a single recording or results folder was opened."""
        return self._drives[0] if self._drives and len(self._opened) == 1 else None

    @cached_property
    def facts(self) -> Facts | FleetFacts:
        """The facts of the first result; a rig has the facts of all its cameras together."""
        (path, *_), first = self.paths, self._opened[0].facts
        if not self.rig:
            return first
        from roadeval.recording.recording import rig_facts

        facts = Facts.read(path / SUMMARY) if path.is_dir() else rig_facts(path)
        return with_focus(facts, self._chosen) if facts and self._chosen else facts or first

    @property
    def summary(self) -> dict[str, Any]:
        """The content of the first result's ``summary.json`` or ``fleet.json``."""
        return self.facts.as_dict()

    @property
    def complete(self) -> bool:
        """Whether every run reached its end."""
        return not self.warnings

    @property
    def warnings(self) -> tuple[str, ...]:
        """The warnings that a reader should see first."""
        return tuple(dict.fromkeys(chain(*(drive.warnings for drive in self._drives))))

    @property
    def recording(self) -> Path | None:
        """The recording, if a single one was opened."""
        alone = len(self.paths) == 1 and self._drives and self._drives[0].recording
        return self.paths[0] if alone else None

    @cached_property
    def variants(self) -> list[str]:
        """The variants that were scored, in order."""
        names = (
            result.facts.finals
            if isinstance(result, FleetFolder)
            else result.rows["variant"].unique()
            for result in self._opened
        )
        return [*dict.fromkeys(chain(*names))]

    @cached_property
    def compared(self) -> tuple[ComparedDrive, ...]:
        """The drives, as a comparison knows them."""
        drives = list[ComparedDrive]()
        for result in self._opened:
            settings = number_settings(result.facts.run)
            if isinstance(result, DriveResult):
                facts, frames = result.facts, result.rows["frame"].nunique()
                settings |= input_digests(facts)
                key, digest = result.key, facts.log_digest
                drives.append(ComparedDrive(*key, result.title, digest, frames, settings))
                continue
            rows = records(result.drives)
            scored = next((row["drive"] for row in rows if row["evaluated"]), None)
            if scored is not None:
                with suppress(RoadevalError):  # the folders of its drives may be gone
                    files = input_digests(ResultsFolder(results_path(result.path, scored)).facts)
                    # Masks and truth of one drive tell nothing about other drives.
                    settings |= {k: value for k, value in files.items() if k.startswith(OF_ALL)}
            drives += (
                ComparedDrive(
                    drive=row["drive"],
                    camera=row["camera"] or "",
                    name=result.names[row["drive"]],
                    digest=row["log_digest"] or None,
                    frames=row["evaluated"] or 0,
                    settings=settings,
                    group=row["group"],
                )
                for row in rows
            )
        return tuple(drives)

    @cached_property
    def drives(self) -> pd.DataFrame:
        """A row per drive and camera, scored or not."""
        return self.table("drives")

    @cached_property
    def scores(self) -> pd.DataFrame:
        """A row per drive, camera, variant, stage and region."""
        return self.table("scores")

    @cached_property
    def effects(self) -> pd.DataFrame:
        """A row per drive, camera, difference between two masks, and rate."""
        return self.table("effects")

    @cached_property
    def worst(self) -> pd.DataFrame:
        """A row per frame among the worst of a fleet; empty for single drives."""
        return self.table("worst")

    @cached_property
    def frames(self) -> pd.DataFrame:
        """A row per evaluated frame, variant and stage of every drive."""
        return self.table("frames")

    @cached_property
    def windows(self) -> pd.DataFrame:
        """A row per window of evaluated frames, variant and stage of every drive."""
        size = self.facts.evaluation.window
        return concatenate(
            [tables.windows(result.table("frames"), size) for result in self._opened]
        )

    def table(
        self,
        name: str,
        drives: Collection[tuple[str, str]] | None = None,
        *,
        final: bool = False,
    ) -> pd.DataFrame:
        """Return a table of all drives, or of some, by drive and camera.

        With ``final`` only the rows of final masks, of ``frames`` or ``regions``. The table
        ``regions`` of a fleet has only these. A `RoadevalError` if no table has the name.
        """
        if name not in TABLES:
            problem = f"there is no table {name}"
            raise RoadevalError(
                problem, remedy=f"{likely(name, TABLES)}the tables are: {', '.join(TABLES)}"
            )
        parts = []
        for result in self._opened:
            if isinstance(result, FleetFolder):
                names = None if drives is None else {drive for drive, _ in drives}
                rows = result.table(name, names)
                parts.append(tables.finals(rows) if final else rows)
            elif drives is None or result.key in drives:
                parts.append(result.table(name, final=final))
        return concatenate(parts)


def number_settings(run: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings of a run that may change its numbers, by ``table.key``."""
    settings: dict[str, Any] = {}
    for table, values in run.items():
        if table in NO_NUMBER:
            continue
        nested = values.items() if isinstance(values, dict) else [("", values)]
        settings |= {f"{table}.{key}".rstrip("."): value for key, value in nested}
    return {name: value for name, value in settings.items() if name not in NO_NUMBER}


def input_digests(facts: Facts) -> dict[str, str]:
    """Return the digests of what a run took from files, by names such as ``masks mine``."""
    digests = {}
    for variant, stages in facts.methods.items():
        for description in filter(lambda stage: isinstance(stage, Mapping), stages.values()):
            name = f"code of {variant} ({description.get('stage')})"
            digests[name] = _short_digest(description, "sha256")
    for variant in facts.settings:
        digests[f"network {variant}"] = _short_digest(facts.settings, variant, "net", "sha256")
    for name in facts.masks:
        label = name if name == "truth" else f"masks {name}"
        digests[label] = _short_digest(facts.masks, name, "sha256")
    return {name: digest for name, digest in digests.items() if digest}


def _short_digest(value: Any, *keys: str) -> str:
    """Return the first letters of the digest at some keys of a tree; empty if there is none."""
    for key in keys:
        value = value.get(key) if isinstance(value, Mapping) else None
    return value[:8] if isinstance(value, str) else ""

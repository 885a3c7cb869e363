"""A fleet's folder: the results folders of its drives, and a cache of their tables in Parquet.

A file beside a drive's results says how they were made; it is written last. A drive is done if that
file exists and names the same log, settings, model and version. The frames of each drive, and the
scores that follow from them, are cached. If a cache is missing or old, it is made again from the
results.
"""

from __future__ import annotations

import json
import shlex
import shutil
from collections import Counter, defaultdict
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from roadeval.data import is_plain
from roadeval.evaluation import tables
from roadeval.evaluation.metrics import TESTED
from roadeval.evaluation.regions import ALL
from roadeval.evaluation.score.degradation import Degradations
from roadeval.evaluation.score.scoreboard import Effect
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.evaluation.tables import concatenate, group_rows, is_final, only, values_of
from roadeval.results.facts import (
    DRIVE_RESULTS,
    FLEET,
    SUMMARY,
    Facts,
    FactsFile,
    FleetFacts,
    Member,
    Origin,
    check_format,
    is_fleet,
)
from roadeval.results.folder import RUN, ResultsFolder
from roadeval.results.over_drives import summarise
from roadeval.results.rows import (
    Key,
    beyond_masks,
    drive_row,
    effect_rows,
    table_of,
    table_of_scores,
)
from roadeval.results.schema import FAILED, OF_DRIVES, TABLES, TAG
from roadeval.results.tables import (
    AGAIN,
    FLEET_FORMAT,
    ResultsError,
    made_of,
    read_parquet,
    read_table,
    write_parquet,
)
from roadeval.results.verdict import with_focus
from roadeval.runtime.documents import read_bounded, read_json
from roadeval.runtime.files import check_output, claim_files, leads_outside, put, sha256_of, writing
from roadeval.runtime.text import is_utf8, visible

if TYPE_CHECKING:
    import pandas as pd

WRITTEN: Final = (*OF_DRIVES, "classes")
"""The tables of all drives in one file; older fleets have no ``classes``."""
FILES: Final = (FLEET, RUN, *(f"{table}.parquet" for table in WRITTEN))
"""The files of a fleet's folder; folders beside them have the files of its drives."""
PICTURES: Final = "pictures"
RECORDINGS: Final = "recordings"
WORST: Final = 50
"""Number of frames in the table of the worst."""
OF_A_DRIVE: Final = 3
"""Greatest number of frames of a drive that are among its worst."""
APART_NS: Final = 3_000_000_000
"""Neighbouring frames fail alike: if frames are closer than this, only the worst one counts."""
CACHED: Final = ("frames", "regions", "scores", "worst", "classes")
"""Tables of each drive that are cached in folders of these names. ``regions`` has the rows of final
masks. Older fleets have no ``classes``."""


def results_path(folder: Path, drive: str) -> Path:
    """Return the results folder of a drive."""
    return check_inside(folder / DRIVE_RESULTS / drive, folder)


def made_path(folder: Path, drive: str) -> Path:
    """Return the file that says how a drive's results were made."""
    return check_inside(folder / DRIVE_RESULTS / f"{drive}.json", folder)


def recording_path(folder: Path, drive: str) -> Path:
    """Return the path of a drive's recording, which may not exist."""
    return check_inside(folder / RECORDINGS / f"{drive}.rrd", folder)


def cached_path(folder: Path, name: str, drive: str) -> Path:
    """Return the path of a drive's cached table.

    Its folder is not called ``drive=ID``, as partitions are: pandas and Arrow would read that as a
    second column ``drive``, and refuse the folder.
    """
    return check_inside(folder / name / drive / f"{name}.parquet", folder)


def check_inside(path: Path, folder: Path) -> Path:
    """Return a path in a fleet's folder; a `ResultsError` if a link there leads out of it."""
    if leads_outside(path, folder):
        raise ResultsError(f"{path}: a link leads out of the fleet's folder; remove it")
    return path


@dataclass(frozen=True)
class Made(FactsFile):
    """How the results of a drive were made; its numbers are in the results."""

    drive: str
    """Its name in the fleet."""
    asked: str
    """Digest of the settings, the model and the version."""
    stamp: Mapping[Any, Any] | None
    """Sizes and times of the log's files, a cheap way to notice changes; None if they could not be
    read. A file's name may hold bytes that are not text."""
    fold: int | None = None
    model: str | None = None
    problem: str = ""
    """Reason why the drive failed; empty if there are results."""
    exit_code: int = 0
    seconds: float | None = None
    results: str = ""
    """SHA-256 of the results' summary, set by `write`; empty if the drive failed."""

    FORMAT = FLEET_FORMAT
    AGAIN = AGAIN
    RESULTS = ("drive", "asked", "stamp", "results", "problem")

    def write(self, folder: Path) -> None:
        """Write the file into a fleet's folder as a whole; an OSError if that fails."""
        summary = "" if self.problem else sha256_of(results_path(folder, self.drive) / SUMMARY)
        content = json.dumps(replace(self, results=summary).as_dict(), allow_nan=False)
        put(made_path(folder, self.drive), content.encode())


def read_made(folder: Path, drive: str) -> Made | None:
    """Read how a drive's results were made; None if they are missing or of another version."""
    path = made_path(folder, drive)
    try:
        made = Made.parse(read_bounded(path), path)
        summary = "" if made.problem else sha256_of(results_path(folder, drive) / SUMMARY)
    except (FileNotFoundError, NotADirectoryError, ValueError, ResultsError):
        return None  # the results are missing, old or incomplete
    except OSError as error:
        raise ResultsError(f"{path}: {error.strerror}") from error
    return made if (made.drive, made.results) == (drive, summary) else None


class FleetFolder:
    """Reads a fleet's folder, which may come from another machine and from anybody.

    Nothing outside it is read or written, even if its links and tables lead there. The focus is
    ``focus`` if it has that variant, else the focus with which it was made. A `ResultsError` if
    it is not a fleet's folder, or one of another version.
    """

    def __init__(self, folder: Path, focus: str | None = None) -> None:
        self.path = folder
        facts = FleetFacts.read(folder / FLEET)
        self.facts = with_focus(facts, focus) if focus else facts
        if not all(is_plain(member.drive) for member in self.facts.drives):
            raise ResultsError(
                f"{folder / FLEET}: damaged (a drive's name is not made of letters, digits, '-' "
                f"and '_' alone); {AGAIN}"
            )

    @property
    def name(self) -> str:
        """The folder's name."""
        return self.path.resolve().name

    def table(self, name: str, drives: Collection[str] | None = None) -> pd.DataFrame:
        """Read a table of all drives, or of some of them.

        The tables `roadeval.results.schema.OF_DRIVES` are files of the folder, and so are the
        tables `CACHED` of each drive; others are read from the drives' results. ``regions`` has the
        rows of final masks.
        """
        if name in OF_DRIVES or (self.has_classes and name == "classes"):
            rows = read_parquet([self.path / f"{name}.parquet"], name)
            return rows if drives is None else rows[rows["drive"].isin([*drives])]
        scored = self.drives["drive"][self.drives["evaluated"].fillna(0) > 0]
        chosen = [drive for drive in scored if drives is None or drive in drives]
        return table_of_drives(self.path, name, chosen)

    @property
    def has_classes(self) -> bool:
        """Whether ``classes`` of all drives is one file."""
        return (self.path / "classes.parquet").is_file()

    @cached_property
    def drives(self) -> pd.DataFrame:
        """The rows of ``drives``, with the drives' names in the fleet as the index."""
        rows = self.table("drives").set_index("drive", drop=False)
        if not rows.index.is_unique:
            raise ResultsError(
                f"{self.path}: damaged (a drive is in drives.parquet twice); {AGAIN}"
            )
        return rows

    @cached_property
    def names(self) -> dict[str, str]:
        """The drives' distinct names for people, by their names in the fleet."""
        names = dict(self.drives["name"])
        times = Counter(names.values())
        return {drive: name if times[name] == 1 else drive for drive, name in names.items()}

    @cached_property
    def scores(self) -> pd.DataFrame:
        """The rows of ``scores``."""
        return self.table("scores")

    @cached_property
    def effects(self) -> pd.DataFrame:
        """The rows of ``effects`` of the final masks' ERR, if it is known."""
        rows = self.table("effects")
        return rows[rows["final"] & (rows["metric"] == TESTED) & rows["mean"].notna()]

    @cached_property
    def focus_scores(self) -> pd.DataFrame:
        """The rows of ``scores`` of the focus's final mask, on all pixels, by drive."""
        scores = only(self.scores, final=True, region=ALL, variant=self.facts.focus)
        return scores.set_index("drive", drop=False)

    @cached_property
    def regions(self) -> pd.DataFrame:
        """`roadeval.evaluation.tables.by_region` of all drives together."""
        rows = only(self.scores, final=True)
        return tables.by_region(rows[rows["region"] != ALL])

    @cached_property
    def worst(self) -> pd.DataFrame:
        """The rows of ``worst``: the worst frames of the focus over all drives.

        They have no pictures if the focus of the replay was another one.
        """
        rows, focus = self.table("worst"), self.facts.focus
        if focus is None or focus in values_of(rows, "variant"):
            return rows
        frames = tables.finals(only(self.table("frames"), variant=focus))
        frames = frames.assign(rank=0, picture="")[[*rows]]
        parts = [
            tables.worst(of_drive, OF_A_DRIVE, apart_ns=APART_NS)
            for _, of_drive in group_rows(frames, ["drive"])
        ]
        return rank_worst(concatenate([frames[:0], *parts]))

    @cached_property
    def pictured(self) -> pd.DataFrame:
        """The rows of ``worst`` of every drive, before the worst of all drives are chosen."""
        scored = self.focus_scores["drive"]
        return read_parquet([cached_path(self.path, "worst", drive) for drive in scored], "worst")

    def picture(self, frame: Mapping[str, Any]) -> bytes | None:
        """Return the JPEG of a row of ``worst``; None if it lies elsewhere, or is cut off."""
        path = self.path / str(frame["picture"] or "")
        if not path.resolve().is_relative_to(self.path.resolve()):
            return None
        with suppress(OSError):
            content = path.read_bytes()
            if content.startswith(b"\xff\xd8\xff") and content.rstrip(b"\0").endswith(b"\xff\xd9"):
                return content
        return None

    def inspect(self, frame: Mapping[str, Any]) -> str:
        """Return the command that opens a row of ``worst`` in the viewer."""
        return shlex.join(["roadeval", "inspect", str(self.path), "--worst", str(frame["rank"])])

    @property
    def height(self) -> int:
        """Height of the frames in pixels; 0 if drives differ."""
        heights = self.drives["height"][self.drives["evaluated"].fillna(0) > 0].dropna().unique()
        return int(heights[0]) if len(heights) == 1 else 0


def rank_worst(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of ``worst`` with the highest ERR over all drives, with their ranks."""
    order = {TESTED: False, "drive": True, "frame": True}
    with_texts = rows.astype({"drive": "str"})
    ranked = with_texts.sort_values([*order], ascending=[*order.values()]).head(WORST)
    return ranked.assign(rank=np.arange(1, len(ranked) + 1))


def table_of_drives(folder: Path, name: str, drives: Sequence[str]) -> pd.DataFrame:
    """Read a table of some scored drives, from the cache or from their results."""
    if name in CACHED:
        paths = [cached_path(folder, name, drive) for drive in drives]
        paths = [path for path in paths if name != "classes" or path.is_file()]
        return read_parquet(paths, name)[[*TABLES[name].names]]
    folders = (ResultsFolder(results_path(folder, drive)) for drive in drives)
    rows = (of_drive(results, name, drive) for results, drive in zip(folders, drives, strict=True))
    return concatenate([read_table(name, ""), *rows])


def of_drive(results: ResultsFolder, name: str, drive: str) -> pd.DataFrame:
    """Return a table of a drive's results under the drive's name in its fleet."""
    import pandas as pd

    rows = results.table(name)
    return rows.assign(drive=pd.Categorical.from_codes([0] * len(rows), pd.Index([drive])))


def cache(folder: Path, drive: str) -> None:
    """Write the Parquet tables of a drive, unless they were made from its present results."""
    path = results_path(folder, drive)
    files = {name: cached_path(folder, name, drive) for name in CACHED}
    summary = sha256_of(path / SUMMARY)
    if all(made_of(file) == summary for file in files.values()):
        return
    results = ResultsFolder(path)
    key = Key(drive, visible(results.facts.drive.camera))
    frames, regions = (of_drive(results, name, drive) for name in ("frames", "regions"))
    frames = frames.assign(final=is_final(frames))
    place, worst = Path(PICTURES, drive), only(frames, final=True, variant=results.facts.focus)
    stems = [picture.stem for picture in check_inside(folder / place, folder).glob("*.jpg")]
    numbers = [int(stem) for stem in stems if stem.isascii() and stem.isdigit()]
    worst = worst[~worst.duplicated("frame") & worst["frame"].isin(numbers)]
    pictures = [(place / f"{number}.jpg").as_posix() for number in worst["frame"]]
    rows = {
        "frames": frames,
        "regions": tables.finals(regions),
        "classes": of_drive(results, "classes", drive),
        "scores": table_of_scores(frames, regions, beyond_masks(results.facts, key)),
        "worst": worst.assign(picture=pictures, rank=0),
    }
    write_parquet({files[name]: (name, rows[name]) for name in CACHED}, summary)


class FleetWriter:
    """Writes the folder of a fleet."""

    def __init__(self, folder: Path) -> None:
        self.folder = Path(folder).absolute()

    def begin(self) -> None:
        """Make the folder, or check that it is a fleet's folder of this version.

        A `ResultsError` if it is something else, or cannot be written to.
        """
        if not is_utf8(str(self.folder)):
            raise ResultsError(
                f"{self.folder}: its bytes are not UTF-8, and Parquet files cannot be written "
                "there: choose another name"
            )
        with writing(self.folder, ResultsError):
            check_output(self.folder, folder=True)
            if is_fleet(self.folder):
                with suppress(ValueError):  # a damaged file is written again
                    path = self.folder / FLEET
                    check_format(read_json(read_bounded(path)), FLEET_FORMAT, path)
            elif not (self.folder / DRIVE_RESULTS).is_dir() and any(self.folder.glob("*")):
                raise ResultsError(
                    f"{self.folder}: holds other files and is not a fleet's folder; name a new one"
                )
            (self.folder / DRIVE_RESULTS).mkdir(parents=True, exist_ok=True)
            for path in self.folder.iterdir():  # the folder may come from anybody
                check_inside(path, self.folder)

    def finish(
        self,
        members: Sequence[Member],
        settings: EvaluationSettings,
        run: Mapping[str, Any],
        run_toml: str,
        *,
        asked: Mapping[str, str] | None = None,
        origin: Origin | None = None,
    ) -> FleetFacts:
        """Write the tables of all drives and the facts that follow from them.

        ``members`` are in the order of the tables. ``run`` and ``run_toml`` are the configuration
        of the fleet, as plain data and as a text. ``asked`` has the accepted values of
        `Made.asked`; by default all are accepted.
        """
        # Two commands may replay drives of one folder together.
        with (
            writing(self.folder, ResultsError),
            claim_files(*(self.folder / name for name in FILES)),
        ):
            finals, within, disturbed = self._write_tables(members, asked or {})
            read = partial(table_of_drives, self.folder)
            basis = finals, members, settings, dict(run), within
            facts = summarise(*basis, disturbances=disturbed, read=read)
            facts = replace(facts, origin=origin)
            put(self.folder / RUN, run_toml.encode())
            put(self.folder / FLEET, facts.text().encode())
        return facts

    def _write_tables(
        self, members: Sequence[Member], digests: Mapping[str, str]
    ) -> tuple[dict[str, pd.DataFrame], list[Effect], dict[str, Degradations]]:
        """Write every table; the files get their names when all of them are written.

        Return the tables from which the facts follow (``drives``, and the rows of ``scores`` and
        ``effects`` of final masks on all pixels), the differences within the only scored drive
        (empty for several drives), and the disturbances of the drives that have any.
        """
        tags = sorted({key for member in members for key in member.tags})
        rows = defaultdict[str, list[Any]](list)
        for member in members:
            self._add(member, self._read_made(member.drive, digests), rows)
        try:
            cached = self._read_cache(rows["cached"])
        except ResultsError:  # a damaged cache is made again
            for name in CACHED:
                shutil.rmtree(check_inside(self.folder / name, self.folder), ignore_errors=True)
            cached = self._read_cache(rows["cached"], again=True)
        cached["drives"] = table_of("drives", rows["drives"], tags)
        cached["effects"] = table_of("effects", rows["effects"])
        cached["worst"] = rank_worst(cached["worst"])
        cached["classes"] = table_of_drives(self.folder, "classes", rows["cached"])
        write_parquet({self.folder / f"{name}.parquet": (name, cached[name]) for name in WRITTEN})
        finals = {
            "drives": cached["drives"],
            "scores": only(cached["scores"], final=True, region=ALL),
            "effects": only(cached["effects"], final=True),
        }
        within = rows["within"] if len(finals["effects"]["drive"].unique()) == 1 else []
        return finals, within, dict(rows["disturbed"])

    def _add(self, member: Member, made: Made, rows: Mapping[str, list[Any]]) -> None:
        """Add a drive's rows to the rows of each table."""
        row: dict[str, Any] = {"drive": member.drive, "name": member.name, "source": member.source}
        row |= {"group": member.group, "fold": made.fold, "model": made.model, "camera": ""}
        row |= {f"{TAG}{key}": value for key, value in member.tags.items()}
        if made.problem:
            failure = {"status": FAILED, "reason": made.problem, "exit_code": made.exit_code}
            rows["drives"].append({**row, **failure})
            return
        facts = Facts.read(results_path(self.folder, member.drive) / SUMMARY)
        key = Key(member.drive, visible(facts.drive.camera))
        row |= {"camera": key.camera, "seconds": made.seconds}
        rows["effects"] += effect_rows(facts, key)
        rows["within"] += facts.final_effects
        rows["disturbed"] += [(member.drive, facts.disturbances)] if facts.disturbances else []
        if facts.frames.evaluated:
            rows["cached"].append(member.drive)
        rows["drives"].append({**drive_row(facts, member.name, member.source), **row})

    def _read_cache(self, drives: Sequence[str], *, again: bool = False) -> dict[str, pd.DataFrame]:
        """Return the cached sums of drives; make missing and old ones from their results."""
        for drive in drives:
            try:
                cache(self.folder, drive)
            except ResultsError as error:
                if again:  # its results are damaged: it is not done
                    made_path(self.folder, drive).unlink(missing_ok=True)
                damaged = ResultsError.of(error)
                damaged.remedy = AGAIN
                raise damaged from error
        return {
            name: read_parquet([cached_path(self.folder, name, drive) for drive in drives], name)
            for name in ("scores", "worst")
        }

    def _read_made(self, drive: str, digests: Mapping[str, str]) -> Made:
        """Return how a drive's results were made; an error if they are missing or were replaced."""
        made = read_made(self.folder, drive)
        if made is None:
            raise ResultsError(
                f"{self.folder}: the results of {drive} have gone; run the same command again"
            )
        if digests.get(drive, made.asked) != made.asked:
            raise ResultsError(
                f"{self.folder}: another command has replayed {drive} with other settings "
                "meanwhile; run the same command again, or give each a folder of its own"
            )
        return made

"""The result of a replay: a recording, whole or partial, or a results folder."""

from __future__ import annotations

from collections.abc import Mapping, Sized
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from roadeval.data import Rows
from roadeval.errors import RoadevalError
from roadeval.evaluation import scored
from roadeval.evaluation.effects import as_parts, drive_effects
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.recording.layout import DamagedError, RecordingError
from roadeval.results.folder import RUN, ResultsFolder
from roadeval.results.sentences import verdict

if TYPE_CHECKING:
    import numpy.typing as npt
    import pandas as pd

    from roadeval.recording import Recording


class Result:
    """The result of a replay, from an ``.rrd`` or a results folder.

    Parameters
    ----------
    path
        Either.

    Raises
    ------
    RoadevalError
        If it is neither, or by another program or format.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.recording = None if self.path.is_dir() else _recording(self.path)
        self._tables: ResultsFolder | Recording = self.recording or ResultsFolder(self.path)

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
        return self.recording.layout.drive if self.recording else self.summary["drive"]["name"]

    @property
    def configuration(self) -> Path | None:
        """The file that holds the run's configuration; None where a run left none."""
        if self.recording is not None:
            return self.path if self.recording.result("run") else None
        path = self.path / RUN
        return path if path.exists() else None

    @cached_property
    def viewable(self) -> Path | None:
        """The recording that the viewer can open: its own, or of a folder that of the same run.

        None where that is not where the run wrote it, or is another drive's by now.
        """
        if self.recording is not None:
            return self.path if self.pictured else None
        written = self.summary.get("run", {}).get("output", {}).get("save")
        path = Path(written or Path("recordings", f"{self.name}.rrd"))
        # A summary from elsewhere may name a share of somebody's server, which Windows would ask.
        if str(path).startswith(("//", "\\\\")) or not path.is_file():
            return None
        try:
            other = Result(path).summary.get("log", {}).get("sha256")
        except RoadevalError:
            return None
        return path if other == self.summary["log"]["sha256"] else None

    @cached_property
    def summary(self) -> dict[str, Any]:
        """As ``summary.json``; of an incomplete run, what its tables give."""
        if not self.complete:
            return self._summary_of_part()
        return self._tables.summary

    @cached_property
    def rows(self) -> Rows:
        """The rows of ``frames.csv``, without pandas."""
        return self.table("frames")

    def table(self, name: str) -> Rows:
        """Return the rows of a table that grew frame by frame, without pandas."""
        rows = self._tables.rows(name)
        return rows.take(np.isin(rows["frame"], self._both)) if self._may_be_cut(rows) else rows

    @cached_property
    def frames(self) -> pd.DataFrame:
        """The rows of ``frames.csv``."""
        return self._whole(self._tables.frames)

    @cached_property
    def regions(self) -> pd.DataFrame:
        """The rows of ``regions.csv``."""
        return self._whole(self._tables.regions)

    @cached_property
    def pictured(self) -> tuple[int, ...]:
        """The frames whose pictures are there; none of a folder.

        A run may have kept few, and a killed one may have written some layers of its last frames
        and not others: those are left out.
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
        """Return a layer of a variant; None where the run did not keep it."""
        assert self.recording is not None
        try:
            return self.recording.layer(variant, name, frame)
        except DamagedError:
            raise
        except RecordingError:
            return None

    @cached_property
    def windows(self) -> Rows:
        """The rows of ``windows.csv``; none of an incomplete run."""
        return self._tables.rows("windows")

    @cached_property
    def levels(self) -> Rows:
        """The rows of ``probabilities.csv``; none where no variant says how probable road is."""
        return self._tables.rows("probabilities")

    @property
    def properties(self) -> Mapping[str, str | int | float]:
        """The recording's own properties, about its origin; none of a folder."""
        return self.recording.layout.properties if self.recording else {}

    def notes(self, frame: int, variant: str) -> tuple[str, ...]:
        """Return the recording's notes on a frame, without those on other variants."""
        if self.recording is None:
            return ()
        others = {each.name for each in self.recording.variants} - {variant}
        notes = self.recording.notes(frame)
        return tuple(note for note in notes if note.partition(" ")[0] not in others)

    def extra(self, name: str) -> pd.DataFrame:
        """Read a further table that the run counted, as ``oracles``; empty if it did not."""
        return self._tables.table(name)

    def _whole(self, table: pd.DataFrame) -> pd.DataFrame:
        """Keep the rows of frames that stand in both tables; a killed run may have cut one."""
        return table[table["frame"].isin(self._both)] if self._may_be_cut(table) else table

    def _may_be_cut(self, table: Sized) -> bool:
        return not self.complete and len(table) > 0

    @cached_property
    def _both(self) -> list[int]:
        """The frames that stand in the tables of frames and of regions."""
        frames, regions = (self._tables.rows(name)["frame"] for name in ("frames", "regions"))
        both: list[int] = np.intersect1d(frames, regions).tolist()
        return both

    def _summary_of_part(self) -> dict[str, Any]:
        """Make the summary that a killed run did not get to write, of what it had scored."""
        assert self.recording is not None
        layout, settings = self.recording.layout, EvaluationSettings()
        effects = drive_effects(list(scored.mask_counts(self.rows)), settings)
        return {
            "drive": {"name": layout.drive, "width": layout.width, "height": layout.height},
            "frames": {
                "with_pictures": len(self.pictured),
                "trained_on": layout.properties.get("training_frames", 0),
                "evaluated": len(self.rows.distinct("frame")),
            },
            "warnings": [],
            "losses": [],
            "run": {},
            "settings": {},
            "versions": {},
            "seconds": {},
            "training": {"source": layout.properties.get("trained_on")},
            "totals": (totals := scored.totals(self.rows)),
            "verdict": verdict(totals, effects, settings),
            **as_parts(effects),
        }


def _recording(path: Path) -> Recording:
    # Only here: a folder is read without what reads a recording.
    from roadeval.recording import Recording

    return Recording(path)

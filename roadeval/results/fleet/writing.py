"""A fleet's folder as its command writes it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

from roadeval.evaluation.comparison import Condition
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.results.fleet.conditions import DriveJudgement, judge_drives
from roadeval.results.fleet.folder import check_format
from roadeval.results.fleet.kind import FILES, FLEET, JUNIT, METRICS, RUN, is_fleet
from roadeval.results.fleet.metrics import flat_metrics, junit_xml
from roadeval.results.fleet.record import (
    RECORDS,
    Record,
    read_record,
)
from roadeval.results.fleet.summary import summarise
from roadeval.results.fleet.tables import Member, write_tables
from roadeval.results.summary import digest_of, json_text, plain
from roadeval.results.tables import FLEET_FORMAT, ResultsError, read_parquet
from roadeval.runtime.documents import read_bounded, read_json
from roadeval.runtime.files import alone, check_output, leads_outside, put
from roadeval.runtime.text import is_utf8

RESULTS: Final = (
    *("verdict", "counts", "frames", "rates", "effects", "strata", "conditions", "warnings"),
)
"""Parts of ``fleet.json`` that tell what came out, of which ``digest`` holds a checksum."""


class FleetWriter:
    """Writes the folder of a fleet.

    Parameters
    ----------
    folder
        Its name.
    """

    def __init__(self, folder: Path) -> None:
        self.folder: Final = Path(folder).absolute()

    def begin(self) -> None:
        """Make the folder, or see that it is a fleet's of this version.

        Raises
        ------
        ResultsError
            If it is something else, or cannot be written to.
        """
        if not is_utf8(str(self.folder)):
            raise ResultsError(
                f"{self.folder}: its bytes are not UTF-8, and Parquet files cannot be written "
                "there: choose another name"
            )
        with self._explained():
            check_output(self.folder, folder=True)
            if is_fleet(self.folder):
                with suppress(ValueError):  # damage: it is written anew
                    check_format(path := self.folder / FLEET, read_json(read_bounded(path)))
            elif not (self.folder / RECORDS).is_dir() and _has_files(self.folder):
                raise ResultsError(
                    f"{self.folder}: holds other files and is no fleet's folder; name a new one"
                )
            (self.folder / RECORDS).mkdir(parents=True, exist_ok=True)
            self._check_links()

    def _check_links(self) -> None:
        """Refuse a folder that would be written elsewhere: it may come from anybody."""
        for each in self.folder.iterdir():
            if leads_outside(each, self.folder):
                raise ResultsError(f"{each}: a link leads out of the fleet's folder; remove it")

    def finish(
        self,
        members: Sequence[Member],
        settings: EvaluationSettings,
        run: Mapping[str, Any],
        run_toml: str,
        conditions: Sequence[Condition] = (),
    ) -> dict[str, Any]:
        """Write the tables of all drives and what follows from them; return ``fleet.json``.

        Parameters
        ----------
        members
            The drives in the tables' order; each has its record.
        settings
            The confidence of intervals, and what is negligible.
        run, run_toml
            The configuration of the fleet, as plain data and as the text of a TOML file.
        conditions
            Judged on each drive, see `roadeval.results.fleet.conditions`.
        """
        # Two commands may replay drives of one folder together.
        with self._explained(), alone(*(self.folder / name for name in FILES)):
            asked = {member.drive: member.asked for member in members}
            write_tables(self.folder, members, _Records(self.folder, asked))
            judgements = [*judge_drives(self.folder, conditions, settings.least_frames)]
            summary = {
                "format": FLEET_FORMAT,
                **summarise(self.folder, members, settings),
                "conditions": [_condition(each, judgements) for each in conditions],
                "run": run,
            }
            summary["digest"] = digest_of(summary, RESULTS)
            put(self.folder / RUN, run_toml.encode())
            metrics = json_text(plain(flat_metrics(summary)))
            put(self.folder / METRICS, metrics.encode())
            put(self.folder / JUNIT, junit_xml(self.folder.name, self._drives(), judgements))
            put(self.folder / FLEET, json_text(plain(summary)).encode())
        return summary

    def _drives(self) -> Iterator[Mapping[str, Any]]:
        columns = ["drive", "name", "status", "reason", "losses", "seconds", "verdict"]
        yield from read_parquet(self.folder / "drives.parquet", "drives", columns).to_pylist()

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise ResultsError(
                f"{self.folder}: cannot be written: {error.strerror or error}"
            ) from error


def _condition(condition: Condition, judgements: Sequence[DriveJudgement]) -> dict[str, Any]:
    """Return what ``fleet.json`` holds of a condition: on which drives it holds."""
    own = [each for each in judgements if each.condition == condition.text]
    return {
        "condition": condition.text,
        "judged": sum(each.holds is not None for each in own),
        "not_judged": {each.drive: each.sentence for each in own if each.holds is None},
        "holds": {each.drive: each.sentence for each in own if each.holds},
    }


def _has_files(folder: Path) -> bool:
    return folder.is_dir() and any(folder.iterdir())


class _Records(Mapping[str, Record]):
    """The records of a folder, read as they are needed: all together would fill the memory."""

    def __init__(self, folder: Path, asked: Mapping[str, str | None]) -> None:
        self._folder: Final = folder
        self._asked: Final = asked

    def __getitem__(self, drive: str) -> Record:
        record = read_record(self._folder, drive)
        if record is None:
            raise ResultsError(
                f"{self._folder}: the record of {drive} has gone; run the same command again"
            )
        if self._asked[drive] not in (None, record.asked):
            raise ResultsError(
                f"{self._folder}: another command has replayed {drive} with other settings "
                "meanwhile; run the same command again, or give each a folder of its own"
            )
        return record

    def __iter__(self) -> Iterator[str]:
        return iter(sorted(path.stem for path in (self._folder / RECORDS).glob("*.json")))

    def __len__(self) -> int:
        return sum(1 for _ in self)

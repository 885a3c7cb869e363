"""Many recordings as one catalogue: a table of drives in the viewer, each a click away.

The server answers this machine alone, keeps nothing, and ends with the command.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from threading import Thread
from typing import Any, Final

import rerun as rr
from rerun.blueprint import table
from rerun.chunk import RrdReader

from roadeval.recording import layout as at
from roadeval.recording.layout import Layout, RecordingError
from roadeval.recording.screen import blueprint

HOST: Final = "127.0.0.1"
_ENDING_S: Final = 2.0
"""How long the server may take to end."""
INDEX: Final = "fleet"
"""The layer, and the group of properties, that hold what the fleet says of a drive."""


@dataclass(frozen=True, slots=True)
class CataloguedDrive:
    """A drive whose recording was kept.

    Parameters
    ----------
    name
        Its name in the fleet.
    recording
        Its ``.rrd`` file.
    facts
        Columns of the table beside the name; a drive may lack some.
    """

    name: str
    recording: Path
    facts: Mapping[str, str | int | float]


@dataclass(frozen=True, slots=True)
class Catalogue:
    """A server that holds the recordings of a fleet.

    Parameters
    ----------
    address
        What the viewer is given to open the table of drives.
    drives
        Addresses of the drives, by their names.
    left_out
        Drives whose recording is the copy of another one's, and those drives.
    """

    address: str
    drives: Mapping[str, str]
    left_out: Mapping[str, str]


@contextmanager
def served(
    name: str, drives: Sequence[CataloguedDrive], layout: Layout, by: str
) -> Iterator[Catalogue]:
    """Serve recordings on 127.0.0.1 until the block ends.

    Parameters
    ----------
    name
        Of the fleet.
    drives
        In any order; of several copies of one recording the first is taken.
    layout
        Of the recording by whose views all are arranged.
    by
        The fact that the table is sorted by, from the highest on; by the name where it is empty.

    Raises
    ------
    RecordingError
        If Rerun's catalogue is not installed, or a recording cannot be read.
    """
    require_catalogue()
    chosen, left_out = _told_apart(drives)
    with (
        tempfile.TemporaryDirectory(prefix="roadeval-") as folder,
        _server() as server,
    ):
        dataset = server.client().create_dataset(name)
        try:
            dataset.register([_uri(each.recording) for each in chosen.values()]).wait()
            layers = [_layer(Path(folder), key, each) for key, each in chosen.items()]
            dataset.register([_uri(layer) for layer in layers], layer_name=INDEX).wait()
        except (OSError, RuntimeError, ValueError) as error:
            reason = " ".join(str(error).split())
            raise RecordingError(f"{name}: a recording cannot be shown: {reason}") from error
        facts = dict.fromkeys(fact for each in drives for fact in each.facts)
        _arrange(dataset, Path(folder), layout, [*facts], by)
        address = f"{server.url()}/entry/{dataset.id}"
        places = {each.name: dataset.segment_url(key) for key, each in chosen.items()}
        yield Catalogue(address, places, left_out)


@contextmanager
def _server() -> Iterator[rr.server.Server]:
    """Run the catalogue's server until the block ends.

    To end it waits for all that are connected, and a tab of a browser may be so for days: after a
    moment it is left to end with the process.
    """
    server = rr.server.Server(host=HOST)
    try:
        yield server
    finally:
        ending = Thread(target=server.shutdown, daemon=True)
        ending.start()
        ending.join(_ENDING_S)


def require_catalogue() -> None:
    """Make sure that Rerun's catalogue is there.

    Raises
    ------
    RecordingError
        If what it needs is not installed.
    """
    if find_spec("datafusion") is None:
        raise RecordingError(
            "the catalogue of a fleet needs DataFusion, which is not installed: "
            "pip install 'rerun-sdk[catalog]'"
        )


def _told_apart(
    drives: Sequence[CataloguedDrive],
) -> tuple[dict[str, CataloguedDrive], dict[str, str]]:
    """Return the drives by their recordings' identities, and those whose identity is taken.

    The catalogue refuses two recordings of one identity, which follows from the log's content.
    """
    chosen: dict[str, CataloguedDrive] = {}
    left_out: dict[str, str] = {}
    for drive in drives:
        key = _identity(drive.recording)
        first = chosen.setdefault(key, drive)
        if first is not drive:
            left_out[drive.name] = first.name
    return chosen, left_out


def _identity(recording: Path) -> str:
    try:
        (entry, *_) = RrdReader(recording).recordings()
    except (OSError, RuntimeError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise RecordingError(f"{recording}: cannot be read: {reason}") from error
    return str(entry.recording_id)


def _layer(folder: Path, key: str, drive: CataloguedDrive) -> Path:
    """Write what the fleet says of a drive as a second layer of its recording."""
    path = folder / f"{key}.rrd"
    stream = rr.RecordingStream(at.APPLICATION, recording_id=key, send_properties=False)
    stream.save(path)
    values = {"drive": drive.name, **drive.facts}
    stream.send_property(INDEX, rr.AnyValues(**values))
    stream.flush()
    stream.disconnect()
    return path


def _arrange(dataset: Any, folder: Path, layout: Layout, facts: Sequence[str], by: str) -> None:
    """Have every drive open with the full layout, and the table with the fleet's columns.

    A blueprint inside a recording does not count in a catalogue.
    """
    views, columns = folder / "views.rbl", folder / "table.rbl"
    blueprint.arrange(layout).save(at.APPLICATION, str(views))
    dataset.register_blueprint(_uri(views))
    shown = [table.Column(_column(each), name=each) for each in ("drive", *facts)]
    known = {column.source for column in shown}
    hidden = [
        table.Column(name, visible=False)
        for name in dataset.segment_table().schema().names
        if name not in known
    ]
    table.TableBlueprint(
        table_layout=table.TableLayout(columns=[*shown, *hidden]),
        default_layout="table",
        sort_by=table.SortBy(_column(by or "drive"), direction="Descending" if by else "Ascending"),
    ).save(at.APPLICATION, columns)
    dataset.register_blueprint(_uri(columns), segment_table=True)


def _column(fact: str) -> str:
    return f"property:{INDEX}:{fact}"


def _uri(path: Path) -> str:
    return path.resolve().as_uri()

"""A small run: the outputs of `roadeval.replay`, written as it writes them."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path

from roadeval.jobs.outputs import Outputs
from roadeval.logs.writing.writer import LogWriter
from roadeval.results.folder import CONTENT, ResultsWriter
from roadeval.runtime.files import NewFile, claim_folder
from tests.results.making import facts_of

PLACES = ("out.rrd", "out.mcap", "reports")


@contextmanager
def recorder(path: Path):
    """A recording that is a text; what was begun stays if the run fails."""
    file = NewFile(path, hidden=False)
    file.begin()
    yield file.partial
    file.publish()


def recover(place: Path) -> None:
    """Claim the results folder, as the next command does: what was left half done is put right."""
    with claim_folder(place / "reports", CONTENT) as certain:
        assert certain


def run(place: Path, name: str) -> None:
    """Write a recording, a log and a folder that hold this name."""
    to = Outputs(place / "out.rrd", place / "reports", place / "out.mcap")
    with to.holding(()) as left:
        with (
            LogWriter(to.mcap) as log,
            recorder(to.recording) as recording,
            ResultsWriter(to.reports) as results,
        ):
            log.image("/camera", 1, name.encode(), "jpeg")
            recording.write_text(name)
            results.append({"frames": f"{name}\n", "windows": f"{name}\n"})
            log.finish()
            # Of each run a figure that the next one does not have, and one that all have.
            for figure in (name, "same"):
                (results.folder / f"fig_{figure}.png").write_text(name)
            results.finish(facts_of(), f"# {name}")
        if left is not None:
            left.unlink()


def outputs(place: Path) -> dict[str, dict[str, bytes] | bytes | None]:
    """The content of each output, without what is hidden or of others."""
    folder = place / "reports"
    files = sorted(folder.iterdir()) if folder.exists() else []
    return {
        **{name: _bytes(place / name) for name in ("out.rrd", "out.mcap")},
        "reports": {
            path.name: path.read_bytes()
            for path in files
            if path.is_file() and path.name[0] != "." and path.name != "notes.txt"
        },
    }


def _bytes(path: Path) -> bytes | None:
    return path.read_bytes() if path.exists() else None

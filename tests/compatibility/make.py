"""Make the results of this version that later ones must read: the archive ``VERSION.tar.xz``.

An archive holds a recording, a results folder without its figures, and a model, of eight frames of
the tiny drive of `tests.golden`. A version whose results differ in form from those of the one
before adds its archive; none is ever replaced::

    python -m tests.compatibility.make

That of 0.1.0 was made by the same commands of that version, which wrote no ``run.toml``.
"""

from __future__ import annotations

import io
import sys
import tarfile
import tempfile
from contextlib import chdir
from pathlib import Path
from typing import Final

from roadeval.cli.app import main
from roadeval.version import VERSION
from tests.golden import drive

FOLDER: Final = Path(__file__).parent
SUFFIX: Final = ".tar.xz"
RECORDING, RESULTS, MODEL = "out.rrd", "results", "city.model"
COMMANDS: Final = (
    f"replay tiny.mcap --save {RECORDING} --reports {RESULTS} --train-frames 3 --max-frames 8 "
    "--record worst:1 --quiet",
    f"train tiny.mcap -o {MODEL} --train-frames 3 --quiet",
)


def make(folder: Path) -> None:
    """Run the commands in a folder."""
    folder.mkdir(exist_ok=True)
    with chdir(folder):
        drive.write(Path("tiny.mcap"))
        for command in COMMANDS:
            if code := main(command.split()):
                raise SystemExit(f"{command}: exit code {code}")


def pack(folder: Path, path: Path) -> None:
    """Pack a recording, results without figures, and a model."""
    tables = [each for each in folder.joinpath(RESULTS).iterdir() if not each.match("fig*")]
    with tarfile.open(path, "x:xz") as archive:
        for each in (folder / RECORDING, folder / MODEL, *sorted(tables)):
            member = tarfile.TarInfo(each.relative_to(folder).as_posix())
            content = each.read_bytes()
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))


def unpack(version: str, folder: Path) -> Path:
    """Unpack the results of a version into a folder, and return it."""
    with tarfile.open(FOLDER / f"{version}{SUFFIX}") as archive:
        archive.extractall(folder, filter="data")
    return folder


def versions() -> list[str]:
    """Return the versions whose results lie here."""
    return sorted(path.name.removesuffix(SUFFIX) for path in FOLDER.glob(f"*{SUFFIX}"))


if __name__ == "__main__":
    target = FOLDER / f"{VERSION}{SUFFIX}"
    if target.exists():
        sys.exit(f"{target} is there already: a new format comes with a new version")
    with tempfile.TemporaryDirectory() as made:
        make(Path(made))
        pack(Path(made), target)

"""Real runs of `roadeval replay` that are killed, meet each other, or find their disk full."""

from __future__ import annotations

import json
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from rerun.chunk import RrdReader

from roadeval import Recording, RoadevalError

FRAMES: Final = {"old": 12, "new": 13, "next": 14}
"""What tells the runs apart: how many frames each reads."""
OUTPUTS: Final = ("--save", "out.rrd", "--reports", "reports", "--mcap", "out.mcap")
PLACES: Final = ("out.mcap", "out.rrd", "reports")
NOTES: Final = "mine"
MIB: Final = 1 << 20
LEVELS: Final = (0, 0.05, 0.3, 1, 2, 5, 63, 65, 67, 70)
"""MiB that are free when a run begins; a recording is not begun with less than 64."""


@dataclass(slots=True)
class Tally:
    """What was seen, by its name, and every line that tells of a broken promise."""

    seen: Counter[str] = field(default_factory=Counter)
    broken: list[str] = field(default_factory=list)

    def check(self, held: bool, what: str) -> None:
        """Note a promise that was not kept."""
        if not held:
            self.broken.append(what)
            print(f"BROKEN: {what}", flush=True)


class Campaign:
    """Rounds in one folder, each begun with the outputs of an earlier run in place.

    Parameters
    ----------
    folder
        Empty; everything happens there.
    drive
        The log that is replayed.
    seed
        Of the moments.
    """

    def __init__(self, folder: Path, drive: Path, seed: int) -> None:
        self.place = folder / "place"
        self._drive = drive.resolve()
        self._random = random.Random(seed)
        self._whole: dict[str, dict[str, Any]] = {}
        self._old = folder / "old"
        self.seconds = 0.0
        for name in FRAMES:
            self._old.mkdir(exist_ok=True)
            begin = time.monotonic()
            assert self.start(name, self._old).wait() == 0
            self.seconds = time.monotonic() - begin
            self._whole[name] = outputs(self._old)
            shutil.rmtree(self._old)
        self._old.mkdir()
        assert self.start("old", self._old).wait() == 0
        (self._old / "reports" / "notes.txt").write_text(NOTES)
        self._bytes = contents(self._old)

    def start(self, name: str, place: Path, *words: str) -> subprocess.Popen[str]:
        """Start a run in a folder."""
        command = [sys.executable, "-m", "roadeval", "replay", str(self._drive), "-q", *OUTPUTS]
        command += ["--max-frames", str(FRAMES[name]), *words]
        return subprocess.Popen(command, cwd=place, stderr=subprocess.PIPE, text=True)

    def begin(self) -> None:
        """Put the outputs of the earlier run in place."""
        shutil.rmtree(self.place, ignore_errors=True)
        shutil.copytree(self._old, self.place)

    # --- What must hold ---------------------------------------------------------------------------

    def untouched(self) -> bool:
        """Whether the earlier outputs are as they were."""
        return visible(contents(self.place)) == self._bytes

    def whole(self, tally: Tally, allowed: Sequence[str], where: str) -> None:
        """Check that each output is wholly that of one of these runs, and notes are kept."""
        found = outputs(self.place)
        for output in PLACES:
            run = next((n for n in allowed if found[output] == self._whole[n][output]), None)
            tally.check(run is not None, f"{where}: {output} is that of no run")
            tally.seen[f"{output} {run}"] += 1
        notes = self.place / "reports" / "notes.txt"
        tally.check(notes.exists() and notes.read_text() == NOTES, f"{where}: notes are lost")

    def next_run(self, tally: Tally, where: str) -> None:
        """Check that the next run ends, with its own outputs, and leaves nothing else."""
        run = self.start("next", self.place)
        said = run.communicate()[1]
        tally.check(run.returncode == 0, f"{where}: the next run failed: {said}")
        self.whole(tally, ["next"], f"{where}, next run")
        left = sorted(path.name for path in self.place.iterdir())
        hidden = [str(path) for path in self.place.rglob(".*")]
        tally.check((left, hidden) == ([*PLACES], []), f"{where}: left over: {left} {hidden}")

    # --- Rounds -----------------------------------------------------------------------------------

    def killed(self, tally: Tally, number: int) -> None:
        """Kill a run at a random moment, every other time of those in which it ends."""
        self.begin()
        run = self.start("new", self.place)
        late = number % 2 == 1
        sign = ".reports.*.partial/fig3b*.pdf" if late else ".out.rrd.lock"
        while run.poll() is None and not any(self.place.glob(sign)):
            time.sleep(0.001)
        time.sleep(self._random.uniform(0, 0.1 if late else self.seconds))
        run.send_signal(signal.SIGKILL)
        run.communicate()
        where = f"kill {number}"
        tally.seen["killed" if run.returncode else "ended first"] += 1
        for partial in self.place.glob("out.*.partial.rrd"):
            tally.seen[f"partial recording {readable(partial)}"] += 1
        self.whole(tally, ["old", "new"], where)
        self.next_run(tally, where)

    def together(self, tally: Tally, number: int) -> None:
        """Let two runs write the same outputs, the second one a random moment later."""
        self.begin()
        runs = {"new": self.start("new", self.place)}
        time.sleep(self._random.choice([0, self._random.uniform(0, self.seconds)]))
        runs["next"] = self.start("next", self.place)
        said = {name: run.communicate()[1] for name, run in runs.items()}
        codes = {name: run.returncode for name, run in runs.items()}
        where = f"two {number} {codes}"
        tally.seen[f"exit codes {sorted(codes.values())}"] += 1
        for name, code in codes.items():
            refused = re.fullmatch(r"roadeval: error: .* is writing it \(.*\).*\n", said[name])
            tally.check(code == 0 or (code == 1 and bool(refused)), f"{where}: {said[name]}")
        done = [name for name, code in codes.items() if code == 0]
        tally.check(bool(done), f"{where}: both refused")
        self.whole(tally, done, where)
        same = {name for name in done if outputs(self.place) == self._whole[name]}
        tally.check(len(same) == 1, f"{where}: the outputs are of two runs")
        tally.check(
            sorted(p.name for p in self.place.iterdir()) == [*PLACES], f"{where}: leftovers"
        )

    def full(self, tally: Tally, number: int) -> None:
        """Let a run find its disk full at a level, with a recording or without."""
        free = LEVELS[number % len(LEVELS)]
        shutil.rmtree(self.place, ignore_errors=True)
        self.place.mkdir()
        size = sum(map(len, self._bytes.values())) + int(free * MIB) + MIB // 4
        with disk(self.place, size):
            shutil.copytree(self._old, self.place, dirs_exist_ok=True)
            fill(self.place, int(free * MIB))
            run = self.start("new", self.place, *([] if free > 60 else ["--record", "none"]))
            said = run.communicate()[1]
            where = f"full, {free} MiB: exit {run.returncode}"
            tally.seen[where] += 1
            (self.place / "filler").unlink()
            if run.returncode:
                tally.check(run.returncode == 1 and said.count("\n") == 1, f"{where}: {said}")
                for partial in self.place.glob("out.*.partial.rrd"):
                    tally.seen[f"partial recording {readable(partial)}"] += 1
                    partial.unlink()
                tally.check(self.untouched(), f"{where}: an earlier result is lost")
                hidden = [str(path) for path in self.place.rglob(".*")]
                tally.check(not hidden, f"{where}: left over: {hidden}")
            elif free > 60:
                self.whole(tally, ["new"], where)


def rounds(step: Callable[[Tally, int], None], number: int) -> Tally:
    """Do rounds, and tell how they went."""
    tally = Tally()
    for each in range(number):
        step(tally, each)
    for name, count in sorted(tally.seen.items()):
        print(f"  {name}: {count}")
    print(f"{step.__name__}: {number} rounds, {len(tally.broken)} promises broken", flush=True)
    return tally


def outputs(place: Path) -> dict[str, Any]:
    """What each output holds, without what differs from run to run of the same input."""
    folder = {
        path.name: path.read_bytes()
        for path in (place / "reports").iterdir()
        if path.is_file() and path.name != "notes.txt" and path.name[0] != "."
    }
    summary = json.loads(folder.pop("summary.json", b"{}"))
    summary.pop("seconds", None)
    mcap = place / "out.mcap"
    return {
        "reports": (folder, summary),
        "out.rrd": recorded(place / "out.rrd"),
        "out.mcap": mcap.read_bytes() if mcap.exists() else None,
    }


def recorded(path: Path) -> Any:
    """Which input a recording is of, if it is whole."""
    try:
        recording = Recording(path)
        (entry,) = RrdReader(path).recordings()
        return recording.complete, entry.recording_id, len(recording.frames)
    except (RoadevalError, RuntimeError) as error:
        return f"unreadable: {error}"


def readable(path: Path) -> str:
    """What of a partial recording can be read."""
    if not path.stat().st_size:
        return "empty"
    try:
        return "readable" if Recording(path).frame_numbers is not None else ""
    except RoadevalError:
        return "unreadable"


def contents(place: Path) -> dict[str, bytes]:
    """The bytes of every file in a folder."""
    files = [path for path in place.rglob("*") if path.is_file()]
    return {str(path.relative_to(place)): path.read_bytes() for path in files}


def visible(files: dict[str, bytes]) -> dict[str, bytes]:
    """Leave out what is hidden."""
    return {name: text for name, text in files.items() if not re.search(r"(^|/)\.", name)}


@contextmanager
def disk(place: Path, size: int) -> Iterator[None]:
    """Mount a small disk at a folder, which needs root."""
    options = ["-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(place)]
    subprocess.run(["mount", *options], check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", str(place)], check=True)


def fill(place: Path, free: int) -> None:
    """Fill a disk but for some bytes."""
    room = max(shutil.disk_usage(place).free - free, 0)
    (place / "filler").write_bytes(bytes(room))

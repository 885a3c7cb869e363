"""``roadeval fleet``: many drives, every one accounted for, and nothing done twice."""

import errno
import json
import os
import re
import shutil
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path

import pyarrow.parquet as pq
import pytest

import roadeval
from roadeval import RoadevalError, compare
from roadeval.jobs.run.fleet_work import train_fold
from roadeval.results.fleet import made_path, results_path
from tests.e2e.commands import here
from tests.fixtures.logged import frames_in, write_drive
from tests.fixtures.make import make
from tests.training.making import frame

FRAMES = 14
OPTIONS = {"training": {"frames": 4}}


class Here(Executor):
    """Does each task at once, in the caller's process."""

    def __init__(self):
        self.tasks = []

    def submit(self, do, /, *args, **kwargs):
        self.tasks.append(args[0])
        future = Future()
        try:
            future.set_result(do(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


def write(path: Path, first: int) -> Path:
    """Write a short drive; no two of different first numbers share a frame."""
    frames = [frame(first + place) for place in range(FRAMES)]
    messages = [{"/camera/image": each.image, "/truth/road": each.truth * 255} for each in frames]
    return write_drive(path, (((n + 1) * 500_000_000, each) for n, each in enumerate(messages)))


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    """A folder with two drives, and a file between them that is none."""
    folder = tmp_path_factory.mktemp("logs")
    write(folder / "a.mcap", 0)
    shutil.copy(make("broken/notmcap.mcap", folder / "made"), folder / "b.mcap")
    shutil.rmtree(folder / "made")
    write(folder / "c.mcap", 100)
    return folder


def run(drives, folder, *, executor=None, only=(), **fleet):
    """Run a fleet in this process; returns its outcome, and what was submitted."""
    executor = executor or Here()
    config = roadeval.configure({**OPTIONS, "only": only, "fleet": fleet})
    found = roadeval.replay_fleet([drives], folder, config, executor=executor)
    return found, [Path(task.entry.source).stem for task in executor.tasks]


def tables(folder):
    """The tables without what differs from run to run."""
    clock = ("seconds",)
    read = {path.name: pq.read_table(path) for path in sorted(folder.glob("*.parquet"))}
    return {
        name: table.drop_columns([c for c in clock if c in table.column_names]).to_pylist()
        for name, table in read.items()
    }


def finals(folder):
    """The scores of the filtered variant's final masks, a row a drive."""
    rows = pq.read_table(folder / "scores.parquet").to_pylist()
    wanted = {"variant": "filtered", "stage": "post", "region": "all"}
    return [row for row in rows if wanted.items() <= row.items()]


@pytest.fixture(scope="module")
def ran(drives, tmp_path_factory):
    """A fleet whose recordings were kept."""
    folder = tmp_path_factory.mktemp("fleet") / "f"
    found, _ = run(drives, folder, keep="all")
    return found


def copied(ran, tmp_path):
    folder = tmp_path / "f"
    shutil.copytree(ran.folder, folder)
    return folder


def test_dasks_workers_replay_every_drive_and_the_broken_one_is_named(drives, ran, tmp_path):
    (tmp_path / "cwd").mkdir()
    (tmp_path / "cwd" / "multiprocessing.py").write_text("raise SystemExit('not to be run')")
    words = ("fleet", drives, "-o", tmp_path / "f", "--train-frames", 4, "--jobs", 2)
    done = here(*words, cwd=tmp_path / "cwd")
    assert done.returncode == 3, done.stderr
    assert "3 drives: 2 scored, 1 failed; 20 frames evaluated" in done.stdout
    alike, said = [line for line in done.stderr.splitlines() if "warning" in line]
    assert "labels repeat an earlier one" in alike
    assert said.startswith("roadeval: warning: b: not an MCAP file")
    errors = {row["drive"][0]: row["ERR"] for row in finals(tmp_path / "f")}
    _, _, _, _, *rows = done.stdout.partition("highest ERR")[2].splitlines()[:6]
    worst = sorted(errors, key=lambda name: -errors[name])
    assert [row.split()[:3] for row in rows] == [
        [name, "10", f"{100 * errors[name]:.2f}"] for name in worst
    ]
    assert tables(tmp_path / "f") == tables(ran.folder)
    assert not list(tmp_path.rglob("*.lock"))


@pytest.mark.parametrize(("limit", "code"), [(None, 3), ("< 100%", 4)])
def test_a_comparison_of_a_fleet_names_the_drives_that_failed(ran, limit, code):
    condition = ["--fail-if", f"post.filtered.ERR {limit}"] if limit else []
    done = here("compare", ran.folder, *condition)
    assert done.returncode == code, done.stderr
    assert "lost: f: 1 of 3 drives failed and is in no number: b" in done.stderr
    assert "1 of 3 drives failed" in compare(ran.folder).content["warnings"][0]


@pytest.mark.parametrize("gone", [[], ["c"]])
def test_the_same_command_again_tries_what_failed_or_has_gone_alone(gone, drives, ran, tmp_path):
    folder = copied(ran, tmp_path)
    before = tables(folder)
    for name in gone:
        shutil.rmtree(next((folder / "results").glob(f"{name}-*/")))
    again, submitted = run(drives, folder, keep="all")
    assert (again.replayed, submitted) == (1 + len(gone), ["b", *gone])
    assert (again.counts, again.problems) == (ran.counts, ran.problems)
    assert tables(folder) == before


def test_the_drives_have_packed_tables_without_those_that_were_left_out(two, tmp_path):
    logs, config = two
    config = config.override({"output": {"without": ["heat"], "packed": False}})
    roadeval.replay_fleet(logs, tmp_path / "f", config, executor=Here())
    for folder in filter(Path.is_dir, (tmp_path / "f" / "results").iterdir()):
        endings = {path.name.split(".", 1)[1] for path in folder.iterdir()}
        assert endings == {"csv.gz", "json", "toml"}
        assert (folder / "regions.csv.gz").exists()
        assert not (folder / "heat.csv.gz").exists()


def test_no_drive_is_scored_by_a_model_that_saw_it(drives, tmp_path):
    folder = tmp_path / "logs"
    for number, name in enumerate("xyz"):
        write(folder / f"{name}.mcap", 100 * number)
    found, _ = run(folder, tmp_path / "f", executor=ThreadTasks(), folds=3)
    assert found.counts == {"scored": 3}
    rows = pq.read_table(found.folder / "drives.parquet").to_pylist()
    assert sorted(row["fold"] for row in rows) == [0, 1, 2]
    for row in rows:
        model = json.loads((found.folder / "models" / f"fold_{row['fold']}.json").read_text())
        assert model["sha256"] == row["model"]
        assert row["drive"] not in model["drives"]
        assert len(model["drives"]) == 2
        own = digests(Path(row["source"]))
        assert len(own) == row["evaluated"] == FRAMES
        assert not own & {*model["training_frames"]}
        others = [digests(Path(r["source"])) for r in rows if r is not row]
        assert {*model["training_frames"]} <= set.union(*others)


class KilledWorker(Exception):  # noqa: N818 - as Dask calls it
    """What Dask says of a task whose workers have died."""


@pytest.fixture
def two(tmp_path):
    """Two drives, and settings that train a model for each on the other."""
    for number, name in enumerate("xy"):
        write(tmp_path / "logs" / f"{name}.mcap", 100 * number)
    return [tmp_path / "logs"], roadeval.configure({**OPTIONS, "fleet": {"folds": 2}})


def test_a_fold_whose_training_ends_its_workers_fails_its_own_drives_alone(two, tmp_path):
    class Dying(Here):
        def submit(self, do, /, task):
            if do is not train_fold or task.fold == 0:
                return super().submit(do, task)
            future = Future()
            future.set_exception(KilledWorker(task.fold))
            return future

    drives, config = two
    found = roadeval.replay_fleet(drives, tmp_path / "f", config, executor=Dying())
    assert found.counts == {"scored": 1, "failed": 1}
    rows = pq.read_table(found.folder / "drives.parquet").to_pylist()
    (row,) = [row for row in rows if row["status"] == "failed"]
    assert row["reason"].startswith("its worker process ended 2 times while the model of fold 1")
    assert row["model"] is None


class ThreadTasks(ThreadPoolExecutor):
    """Another library's executor: one thread."""

    def __init__(self):
        super().__init__(1)
        self.tasks = []


def digests(path):
    return {frame.digest() for frame in frames_in(path)}


def test_a_folder_with_other_files_is_refused(drives, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(RoadevalError, match="holds other files and is not a fleet's folder"):
        run(drives, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_a_scheduler_that_does_not_answer_is_one_line(drives, tmp_path, monkeypatch):
    monkeypatch.setattr("roadeval.fleet.engine.ANSWER_S", 1)
    words = "--scheduler", "tcp://127.0.0.1:9", "-q"
    run = here("fleet", drives, "-o", tmp_path / "f", *words)
    assert run.returncode == 1
    assert run.stderr.startswith("roadeval: error: --scheduler: tcp://127.0.0.1:9 does not answer")
    assert run.stderr.count("\n") == 1


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EFBIG])
def test_a_full_disk_ends_the_run_and_what_was_done_before_stays(
    number, drives, ran, tmp_path, monkeypatch
):
    folder = copied(ran, tmp_path)
    drive = next(d["drive"] for d in ran.summary["drives"] if d["name"] == "a")
    shutil.rmtree(folder / "results" / drive)

    def fail(*_):
        raise OSError(number, os.strerror(number))

    with monkeypatch.context() as on_a_full_disk:
        on_a_full_disk.setattr("roadeval.results.folder.ResultsWriter.append", fail)
        said = f"f: cannot be written: {os.strerror(number)}; "
        with pytest.raises(RoadevalError, match=said):
            run(drives, folder)
    _, submitted = run(drives, folder, keep="all")
    assert submitted == ["a", "b"]
    assert tables(folder) == tables(ran.folder)


def test_results_that_another_command_has_made_meanwhile_are_not_mixed_with_ours(drives, tmp_path):
    class Meanwhile(Here):
        def submit(self, do, /, task):
            future = super().submit(do, task)
            if task.entry.name == "a":
                own = task.entry.id
                theirs, ours = (results_path(f, own) for f in (tmp_path / "other", task.folder))
                shutil.copytree(theirs, ours, dirs_exist_ok=True)
                shutil.copy(made_path(tmp_path / "other", own), made_path(task.folder, own))
            return future

    run(drives, tmp_path / "other", keep="none")
    config = roadeval.configure({**OPTIONS, "frames": {"end": 3.0}})
    with pytest.raises(
        RoadevalError, match=r"another command has replayed a-.* with other settings"
    ):
        roadeval.replay_fleet([drives], tmp_path / "f", config, executor=Meanwhile())
    assert not (tmp_path / "f" / "fleet.json").exists()


def test_copies_of_a_log_count_as_one_drive_and_are_told(tmp_path):
    log = write(tmp_path / "logs" / "a.mcap", 0)
    for number in range(3):
        shutil.copy(log, tmp_path / "logs" / f"copy{number}.mcap")
    outcome, _ = run(log.parent, tmp_path / "f")
    (effect,) = (
        each["rates"]["ERR"] for each in outcome.summary["effects"] if each["base"] == "unfiltered"
    )
    assert (effect["units"], effect["groups"]) == (4, 1)
    assert "(4 drives in 1 group)" in outcome.summary["verdict"]
    assert re.search("copy0-.* is a copy of a-.*, and 2 more are", outcome.summary["warnings"][0])

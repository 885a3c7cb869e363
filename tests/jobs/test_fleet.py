"""A fleet that goes on in its folder: the result is that of one go, whatever has changed."""

import os
import shutil
from functools import partial
from pathlib import Path

import pytest

import roadeval
from roadeval import RoadevalError
from tests.e2e import test_fleet
from tests.e2e.test_fleet import Here, tables, write

run = partial(test_fleet.run, only=["unfiltered"])


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    for number, name in enumerate("ab"):
        write(folder / f"{name}.mcap", 100 * number)
    return folder


@pytest.fixture(scope="module")
def ran(logs, tmp_path_factory):
    """A fleet in one go that keeps its recordings."""
    folder = tmp_path_factory.mktemp("fleet") / "f"
    run(logs, folder, keep="all")
    return folder


@pytest.fixture
def folder(ran, tmp_path):
    return shutil.copytree(ran, tmp_path / "f")


def files(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def drive(folder, name="a"):
    (found,) = (folder / "results").glob(f"{name}-*.json")
    return found.stem


def rewritten(path, change):
    """Change a file's content, and keep its size and times."""
    before, content = path.stat(), path.read_bytes()
    path.write_bytes(change(content))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert path.stat().st_size == before.st_size


def flipped(content):
    place = len(content) // 2
    return content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :]


# --- What has changed -----------------------------------------------------------------------------


def test_a_log_that_has_changed_and_kept_its_size_and_time_is_replayed(logs, tmp_path):
    mine = shutil.copytree(logs, tmp_path / "logs")
    run(mine, tmp_path / "f")
    rewritten(mine / "a.mcap", flipped)
    again, submitted = run(mine, tmp_path / "f")
    assert (again.replayed, submitted) == (1, ["a"])
    one_go, _ = run(mine, tmp_path / "g")
    assert again.counts == one_go.counts != {"scored": 2}
    assert tables(tmp_path / "f") == tables(tmp_path / "g")


def test_of_a_log_that_is_none_any_more_no_results_are_left(logs, tmp_path):
    mine = shutil.copytree(logs, tmp_path / "logs")
    run(mine, tmp_path / "f", keep="all")
    own = drive(tmp_path / "f")
    (mine / "a.mcap").write_bytes(b"nothing of the kind")
    again, _ = run(mine, tmp_path / "f", keep="all")
    assert again.counts == {"scored": 1, "failed": 1}
    assert [name for name in files(tmp_path / "f") if own in name] == [f"results/{own}.json"]


def test_other_versions_of_what_computes_replay_every_drive(logs, folder, monkeypatch):
    other = {"opencv-python-headless": "4.14"}
    monkeypatch.setattr("roadeval.jobs.run.prepared.computing", lambda: other)
    assert run(logs, folder, keep="all")[0].replayed == 2


def test_another_label_replays_no_drive_and_is_that_of_the_last_run(logs, folder):
    config = roadeval.configure({**test_fleet.OPTIONS, "only": ["unfiltered"]})
    config = config.override({"fleet": {"keep": "all"}, "output": {"labels": {"branch": "main"}}})
    before = roadeval.Result(folder).facts.origin
    again = roadeval.replay_fleet([logs], folder, config, executor=Here())
    after = roadeval.Result(folder).facts.origin
    assert (again.replayed, again.facts.origin) == (0, after)
    assert (before.labels, after.labels) == ({}, {"branch": "main"})
    assert before.made_ns < after.made_ns


def test_a_worker_with_another_version_is_refused(logs, tmp_path, monkeypatch):
    class Elsewhere(Here):
        def submit(self, do, /, task):
            with monkeypatch.context() as there:
                there.setattr("roadeval.jobs.run.prepared.computing", dict)
                return super().submit(do, task)

    with pytest.raises(RoadevalError, match=r"a worker has av none, and the command \d"):
        run(logs, tmp_path / "f", executor=Elsewhere())


def test_a_model_that_changes_while_the_fleet_runs_ends_it(logs, tmp_path):
    model, other = tmp_path / "m.model", tmp_path / "o.model"
    for path, frames in ((model, 4), (other, 5)):
        roadeval.train(
            [logs / "b.mcap"], path, roadeval.configure({"training": {"frames": frames}})
        )

    class Meanwhile(Here):
        def submit(self, do, /, task):
            shutil.copy(other, model)
            return super().submit(do, task)

    config = roadeval.configure({"training": {"model": str(model)}})
    with pytest.raises(RoadevalError, match="has changed since the command began"):
        roadeval.replay_fleet(logs, tmp_path / "f", config, executor=Meanwhile())


def test_what_a_killed_worker_has_left_is_in_no_table_and_goes(logs, ran, folder):
    own = drive(folder)
    (folder / "results" / f"{own}.json").unlink()
    left = {
        Path("recordings", f"{own}.0123abcd.partial.rrd"): b"half a recording",
        Path("results", f".{own}.0123abcd.partial.json"): b"{",
        Path("frames", own, ".frames.0123abcd.partial.parquet"): b"PAR1",
        Path("results", f".{own}.json.lock"): b"process 1",
        Path(".drives.0123abcd.partial.parquet"): b"PAR1",
    }
    for path, content in left.items():
        (folder / path).write_bytes(content)
    run(logs, folder, keep="all")
    assert files(folder) == files(ran)
    assert tables(folder) == tables(ran)


# --- What a command that was killed has left ------------------------------------------------------


def test_a_drive_whose_recording_has_gone_is_replayed(logs, ran, folder):
    next((folder / "recordings").iterdir()).unlink()
    again, _ = run(logs, folder, keep="all")
    assert again.replayed == 1
    assert files(folder) == files(ran)


# --- A full disk ----------------------------------------------------------------------------------

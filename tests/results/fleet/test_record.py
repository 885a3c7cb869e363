"""The record of a drive: written and read back as it was."""

import json

import pytest

from roadeval.results.fleet import Record, frames_path, read_record, record_path
from roadeval.results.rows import Key, cells
from roadeval.results.schema import OF_DRIVES


def write(folder):
    """Write a record whose drive has frames, and a file with a name that is no text."""
    row = {"drive": "a", "evaluated": 100}
    rows = {name: [] for name in OF_DRIVES} | {"drives": cells("drives", Key("a", ""), [row])}
    made = Record("a", "asked", {"caf\udce9.mcap": [1, 2]}, rows)
    (folder / "records").mkdir()
    made.write(folder)
    return made


def test_a_file_s_name_that_is_no_text_comes_back(tmp_path):
    made = write(tmp_path)
    read = read_record(tmp_path, "a")
    assert read is not None
    assert read.stamp == made.stamp


@pytest.mark.parametrize(("was", "now"), [(" 100,", " 900,"), (" 100,", ' "1",'), ("[1, 2]", "[]")])
def test_a_record_that_was_changed_is_none(tmp_path, was, now):
    write(tmp_path)
    path = record_path(tmp_path, "a")
    text = path.read_text()
    assert text.count(was) == 1
    path.write_text(text.replace(was, now))
    assert read_record(tmp_path, "a") is None


def test_a_record_without_a_check_sum_is_none(tmp_path):
    write(tmp_path)
    path = record_path(tmp_path, "a")
    content = json.loads(path.read_text())
    del content["digest"]
    path.write_text(json.dumps(content))
    assert read_record(tmp_path, "a") is None


def test_a_drive_is_whole_where_its_summary_and_the_frames_that_it_has_are_there(tmp_path):
    made = write(tmp_path)
    summary, frames = tmp_path / "results" / "a" / "summary.json", frames_path(tmp_path, "a")
    summary.parent.mkdir(parents=True)
    summary.touch()
    assert not made.is_whole(tmp_path)
    frames.parent.mkdir(parents=True)
    frames.touch()
    assert made.is_whole(tmp_path)

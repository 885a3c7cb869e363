"""A file and the folder beside it, replaced as one."""

import pytest

from roadeval.runtime import companions
from roadeval.runtime.companions import folder_name, put_with


def write(path, text):
    files = {"a.jpg": text.encode()}
    put_with(path, folder_name(path, files).encode(), files)


def companion(path):
    return path.with_name(path.read_text())


def test_the_file_names_the_folder_that_is_there(tmp_path):
    path = tmp_path / "page.html"
    write(path, "one")
    assert (companion(path) / "a.jpg").read_text() == "one"


def test_a_new_one_leaves_nothing_of_the_old_and_everything_of_others(tmp_path):
    path = tmp_path / "page.html"
    write(path, "one")
    others = [tmp_path / "page.files-mine", tmp_path / "other.files-00000000"]
    for each in others:
        each.mkdir()
    write(path, "two")
    assert set(tmp_path.iterdir()) == {path, companion(path), *others}
    assert (companion(path) / "a.jpg").read_text() == "two"


def test_the_same_again_changes_nothing(tmp_path):
    path = tmp_path / "page.html"
    write(path, "one")
    write(path, "one")
    assert len(list(tmp_path.iterdir())) == 2


def test_where_the_file_cannot_be_written_the_earlier_ones_stay(tmp_path, monkeypatch):
    path = tmp_path / "page.html"
    write(path, "one")
    before = set(tmp_path.iterdir())

    def full(*_):
        raise OSError("full")

    monkeypatch.setattr(companions, "put", full)
    with pytest.raises(OSError, match="full"):
        write(path, "two")
    assert set(tmp_path.iterdir()) == before
    assert (companion(path) / "a.jpg").read_text() == "one"

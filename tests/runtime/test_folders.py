"""Folders that are replaced as one."""

import json
import os

import pytest

from roadeval.runtime.files import Content, NewFolder


def names(seal):
    """Return the names that the seal lists, or else those that always belong to a content."""
    try:
        return frozenset(json.loads(seal.read_text()))
    except OSError:
        return frozenset({"seal", "table"})


CONTENT = Content("seal", names)


def begun(path, content):
    """A new folder with these files, sealed."""
    new = NewFolder(path, CONTENT)
    new.begin()
    for name, text in content.items():
        (new.partial / name).write_text(text)
    (new.partial / "seal").write_text(json.dumps([*content, "seal"]))
    return new


def write(path, **content):
    begun(path, content).publish()


def read(path):
    return {file.name: file.read_text() for file in path.iterdir() if file.name != "seal"}


@pytest.fixture
def folder(tmp_path):
    """An earlier content."""
    write(tmp_path / "folder", table="old", only_old="old")
    return tmp_path / "folder"


def test_the_earlier_content_is_replaced_and_what_is_of_others_stays(folder):
    (folder / "notes").write_text("mine")
    (folder / "link").symlink_to("notes")
    write(folder, table="new", only_new="new")
    mine = {"notes": "mine", "link": "mine"}
    assert read(folder) == {"table": "new", "only_new": "new", **mine}
    assert (folder / "link").is_symlink()
    assert [file.name for file in folder.parent.iterdir()] == ["folder"]


def test_a_folder_of_others_is_never_moved_nor_replaced(folder):
    (folder / "sub").mkdir()
    (folder / "sub" / "notes").write_text("mine")
    before = (folder / "sub").stat()
    write(folder, table="new")
    assert os.path.samestat((folder / "sub").stat(), before)
    new = begun(folder, {"sub": "new"})
    with pytest.raises(IsADirectoryError, match="is a folder"):
        new.publish()
    new.discard()
    assert (folder / "table").read_text() == "new"
    assert (folder / "sub" / "notes").read_text() == "mine"
    assert {file.name for file in folder.parent.iterdir()} == {"folder"}


def test_a_folder_stays_where_it_is(folder):
    before = folder.stat()
    write(folder, table="new")
    assert read(folder) == {"table": "new"}
    assert os.path.samestat(folder.stat(), before)
    assert [file.name for file in folder.parent.iterdir()] == ["folder"]


def test_a_folder_that_was_made_for_nothing_goes_and_an_empty_one_stays(tmp_path):
    (tmp_path / "mine").mkdir()
    for name in ("mine", "new"):
        begun(tmp_path / name, {"table": "new"}).discard()
    assert [file.name for file in tmp_path.iterdir()] == ["mine"]


def test_a_link_stays_and_the_folder_behind_it_is_replaced(folder):
    link = folder.parent / "link"
    link.symlink_to("folder")
    write(link, table="new")
    assert link.is_symlink()
    assert read(folder) == {"table": "new"}

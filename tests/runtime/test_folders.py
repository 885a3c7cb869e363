"""Folders that are replaced as one."""

import errno
import json
import os
import stat
import sys
from pathlib import Path

import pytest

from roadeval.runtime import files
from roadeval.runtime.files import Content, NewFolder

linux = pytest.mark.skipif(sys.platform != "linux", reason="only Linux exchanges folders")


def names(seal):
    """What the seal lists, or else the names that are always of a content."""
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
    return {each.name: each.read_text() for each in path.iterdir() if each.name != "seal"}


@pytest.fixture(params=["exchange", "in place"])
def folder(request, tmp_path, monkeypatch):
    """An earlier content, replaced either way."""
    if request.param == "in place":
        monkeypatch.setattr(files, "_exchange", no_exchange)
    elif sys.platform != "linux":
        pytest.skip("only Linux exchanges folders")
    write(tmp_path / "folder", table="old", only_old="old")
    return tmp_path / "folder"


def no_exchange(_one, _other):
    raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))


def test_the_earlier_content_is_replaced_and_what_is_of_others_stays(folder):
    (folder / "notes").write_text("mine")
    (folder / "link").symlink_to("notes")
    write(folder, table="new", only_new="new")
    mine = {"notes": "mine", "link": "mine"}
    assert read(folder) == {"table": "new", "only_new": "new", **mine}
    assert (folder / "link").is_symlink()
    assert [each.name for each in folder.parent.iterdir()] == ["folder"]


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
    assert {each.name for each in folder.parent.iterdir()} == {"folder"}


def test_the_rights_of_a_folder_stay(folder):
    folder.chmod(0o2771)
    write(folder, table="new")
    assert stat.S_IMODE(folder.stat().st_mode) == 0o2771


@linux
def test_an_exchange_is_one_step(tmp_path, monkeypatch):
    folder = tmp_path / "folder"
    write(folder, table="old", only_old="old")
    seen = []
    usual = files._exchange

    def watched(one, other):
        seen.append(read(other))
        usual(one, other)
        seen.append(read(other))

    monkeypatch.setattr(files, "_exchange", watched)
    write(folder, table="new")
    assert seen == [{"table": "old", "only_old": "old"}, {"table": "new"}]


def _cwd(folder, monkeypatch):
    monkeypatch.chdir(folder)


def _mounted(folder, monkeypatch):
    monkeypatch.setattr(os.path, "ismount", lambda path: Path(path) == folder)


def _parent_not_ours(folder, monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, _mode: Path(path) != folder.parent)


@linux
@pytest.mark.parametrize("situation", [_cwd, _mounted, _parent_not_ours])
def test_a_folder_that_must_stay_where_it_is_stays(situation, tmp_path, monkeypatch):
    folder = tmp_path / "folder"
    write(folder, table="old", only_old="old")
    situation(folder, monkeypatch)
    before = folder.stat()
    write(folder, table="new")
    assert read(folder) == {"table": "new"}
    assert os.path.samestat(folder.stat(), before)
    assert [each.name for each in tmp_path.iterdir()] == ["folder"]


def test_a_link_stays_and_the_folder_behind_it_is_replaced(folder):
    link = folder.parent / "link"
    link.symlink_to("folder")
    write(link, table="new")
    assert link.is_symlink()
    assert read(folder) == {"table": "new"}

"""Folders for outputs: those that were made go again, and no others."""

from pathlib import Path

import pytest

from roadeval.runtime import files as folders


def test_what_was_made_is_given_the_innermost_first(tmp_path):
    made = folders.make(tmp_path / "a" / "b")
    assert made == [tmp_path / "a" / "b", tmp_path / "a"]
    assert folders.make(tmp_path / "a" / "b") == []
    folders.remove(made)
    assert list(tmp_path.iterdir()) == []


def test_where_one_cannot_be_made_those_made_on_the_way_go(tmp_path):
    with pytest.raises(OSError, match="File name too long"):
        folders.make(tmp_path / "a" / (300 * "b") / "c")
    (tmp_path / "file").touch()
    with pytest.raises(NotADirectoryError):
        folders.make(tmp_path / "file" / "a")
    with pytest.raises(FileExistsError):
        folders.make(tmp_path / "file")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize("fails", [True, False])
def test_an_empty_folder_that_another_process_made_meanwhile_stays(tmp_path, monkeypatch, fails):
    usual = Path.mkdir

    def crowded(self, *given, **words):
        if self.name == "c" and fails:
            raise PermissionError(13, "Permission denied")
        if self.name == "a" and not self.exists():
            usual(self)
        usual(self, *given, **words)

    monkeypatch.setattr(Path, "mkdir", crowded)
    innermost = tmp_path / "a" / "b" / "c"
    if fails:
        with pytest.raises(PermissionError):
            folders.make(innermost)
    else:
        assert folders.make(innermost) == [innermost, tmp_path / "a" / "b"]
        folders.remove([innermost, tmp_path / "a" / "b"])
    assert [path.name for path in tmp_path.rglob("*")] == ["a"]


def test_a_folder_whose_purpose_failed_is_gone(tmp_path):
    with pytest.raises(KeyboardInterrupt), folders.made(tmp_path / "a" / "b"):
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []
    with folders.made(tmp_path / "a" / "b") as made:
        assert [path.name for path in made] == ["b", "a"]
    assert (tmp_path / "a" / "b").is_dir()


def test_a_file_is_put_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "new" / "file"
    folders.put(path, b"first")
    folders.put(path, b"second")
    assert [each.name for each in path.parent.iterdir()] == ["file"]
    assert path.read_bytes() == b"second"

    def fails(self, _content):
        self.touch()
        raise why

    monkeypatch.setattr(Path, "write_bytes", fails)
    for why in (OSError(28, "No space left on device"), KeyboardInterrupt()):
        for one in (path, tmp_path / "other" / "file"):
            with pytest.raises(type(why)):
                folders.put(one, b"third")
        assert [each.name for each in path.parent.iterdir()] == ["file"]
    assert path.read_bytes() == b"second"
    assert [each.name for each in tmp_path.iterdir()] == ["new"]

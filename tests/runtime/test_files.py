"""Files that appear under their name only when they are complete."""

from pathlib import Path

import pytest

from roadeval.runtime import files


def names(folder):
    return [path.name for path in folder.iterdir()]


def test_a_file_is_put_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "new" / "file"
    files.put(path, b"first")
    files.put(path, b"second")
    assert names(path.parent) == ["file"]
    assert path.read_bytes() == b"second"

    def fails(self, _content):
        self.touch()
        raise why

    monkeypatch.setattr(Path, "write_bytes", fails)
    for why in (OSError(28, "No space left on device"), KeyboardInterrupt()):
        for one in (path, tmp_path / "new" / "other"):
            with pytest.raises(type(why)):
                files.put(one, b"third")
        assert names(path.parent) == ["file"]
    assert path.read_bytes() == b"second"


def test_a_file_has_its_name_when_its_block_has_ended(tmp_path):
    path = tmp_path / "a" / "b" / "file"
    with files.replacing(path) as temporary:
        temporary.write_text("all of it")
        assert temporary.parent == path.parent
        assert not path.exists()
    assert names(path.parent) == ["file"]


@pytest.mark.parametrize("stop", [ValueError, KeyboardInterrupt])
def test_what_bore_the_name_stays_if_the_block_fails(stop, tmp_path):
    path = tmp_path / "file"
    path.write_text("before")

    def fail():
        with files.replacing(path) as temporary:
            temporary.write_text("half of")
            raise stop

    with pytest.raises(stop):
        fail()
    assert names(tmp_path) == ["file"]
    assert path.read_text() == "before"


def test_a_folder_that_cannot_be_made_is_an_os_error(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(NotADirectoryError):
        files.put(tmp_path / "file" / "a" / "b", b"")
    with pytest.raises(OSError, match="File name too long"):
        files.put(tmp_path / (300 * "b") / "c", b"")

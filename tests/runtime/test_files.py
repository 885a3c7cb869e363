"""Files that appear under their name only when they are complete."""

import os
import socket
from pathlib import Path

import pytest

from roadeval.runtime import files


def names(folder):
    return sorted(path.name for path in folder.iterdir())


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


def test_a_link_stays_and_what_it_leads_to_is_replaced(tmp_path):
    (tmp_path / "far").mkdir()
    (tmp_path / "near").symlink_to(tmp_path / "far" / "file")
    for content in (b"first", b"second"):
        files.put(tmp_path / "near", content)
        assert (tmp_path / "far" / "file").read_bytes() == content
    assert (tmp_path / "near").is_symlink()
    assert names(tmp_path / "far") == ["file"]


def _pipe(path):
    os.mkfifo(path)


def _socket(path):
    # The path of a socket is short.
    with socket.socket(socket.AF_UNIX) as made:
        os.chdir(path.parent)
        made.bind(path.name)


@pytest.mark.parametrize(
    ("make", "kind"),
    [(_pipe, "a pipe"), (_socket, "a socket"), (Path.mkdir, "a folder, not a file; name another")],
)
@pytest.mark.parametrize("link", [False, True])
def test_what_is_no_file_is_not_replaced(make, kind, link, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "taken"
    make(path)
    before = path.stat()
    if link:
        (tmp_path / "link").symlink_to(path)
        path = tmp_path / "link"
    with pytest.raises(OSError, match=kind):
        files.put(path, b"")
    assert os.path.samestat((tmp_path / "taken").stat(), before)


@pytest.mark.parametrize(("name", "error"), [("a\0b", "null"), (245 * "a", "too long")])
def test_a_name_that_no_file_can_have_or_none_of_a_run_s_own_is_an_os_error(name, error, tmp_path):
    with pytest.raises(OSError, match=error):
        files.check_output(tmp_path / name)
    files.check_output(tmp_path / (230 * "a"))


def test_a_folder_is_none_where_a_file_or_a_device_bears_the_name(tmp_path):
    (tmp_path / "file").touch()
    for path, kind in ((tmp_path / "file", "a file"), (Path("/dev/null"), "a device")):
        with pytest.raises(OSError, match=f"is {kind}, not a folder"):
            files.check_output(path, folder=True)
    files.check_output(tmp_path, folder=True)
    files.check_output(tmp_path / "new", folder=True)


def test_a_partial_name_is_found_again_and_no_two_are_the_same(tmp_path):
    for name in ("out.rrd", "drive", "a[1].b", ".hidden"):
        for hidden in (False, True):
            names = {files.partial_name(tmp_path / name, hidden=hidden) for _ in range(4)}
            for partial in names:
                partial.touch()
            assert set(files.find_partial(tmp_path / name, hidden=hidden)) == names
            assert len(names) == 4


def test_folders_made_for_a_claim_go_where_nothing_was_written(tmp_path):
    with files.claimed_file(tmp_path / "new" / "deep" / "file"):
        assert (tmp_path / "new" / "deep").is_dir()
    assert names(tmp_path) == []
    with files.claimed_file(tmp_path / "new" / "deep" / "file"):
        (tmp_path / "new" / "other").touch()
    assert names(tmp_path / "new") == ["other"]


def test_a_pointer_of_git_lfs_is_no_input(tmp_path):
    pointer = tmp_path / "net.onnx"
    pointer.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n")
    with pytest.raises(OSError, match="is a pointer to a file in Git LFS: git lfs pull"):
        files.check_input(pointer)

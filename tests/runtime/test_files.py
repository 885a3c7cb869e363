"""Files and folders that appear when they are complete, and claims on where they go."""

import errno
import fcntl
import json
import os
import re
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from roadeval.runtime import files
from roadeval.runtime.files import Content, NewFolder, claim


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
    with files.claim_file(tmp_path / "new" / "deep" / "file"):
        assert (tmp_path / "new" / "deep").is_dir()
    assert names(tmp_path) == []
    with files.claim_file(tmp_path / "new" / "deep" / "file"):
        (tmp_path / "new" / "other").touch()
    assert names(tmp_path / "new") == ["other"]


def test_a_pointer_of_git_lfs_is_no_input(tmp_path):
    pointer = tmp_path / "net.onnx"
    pointer.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n")
    with pytest.raises(OSError, match="is a pointer to a file in Git LFS: git lfs pull"):
        files.check_input(pointer)


HELD = """
import pathlib, sys
from roadeval.runtime.files import claim
with claim(pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[1]).parent):
    print("held", flush=True)
    sys.stdin.read()
"""


def listed(folder):
    return [path.name for path in folder.iterdir()]


@pytest.fixture
def other(tmp_path):
    """Another process that holds the claim on ``out``."""
    command = [sys.executable, "-c", HELD, tmp_path / "out"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"held\n"
        yield process
        process.kill()


def claim_briefly(folder, name="out"):
    with claim(folder / name, folder) as certain:
        return certain


def test_what_another_process_writes_is_refused_with_its_name_until_it_is_killed(other, tmp_path):
    with pytest.raises(BlockingIOError) as caught:
        claim_briefly(tmp_path)
    match = re.fullmatch(
        r"another run is writing it \(process (\d+) on \S+, since \d{4}-\d\d-\d\d \d\d:.*\)",
        caught.value.strerror,
    )
    assert int(match[1]) == other.pid
    assert claim_briefly(tmp_path, "another")
    other.send_signal(signal.SIGKILL)
    other.wait()
    assert listed(tmp_path) == [".out.lock"]
    assert claim_briefly(tmp_path)
    assert listed(tmp_path) == []


def test_two_in_one_process_are_two_and_the_first_one_s_lock_stays(tmp_path):
    with claim(tmp_path / "out", tmp_path):
        for _ in range(2):
            with pytest.raises(BlockingIOError, match=f"process {os.getpid()} on"):
                claim_briefly(tmp_path)
        assert listed(tmp_path) == [".out.lock"]
    assert claim_briefly(tmp_path)


def test_a_lock_that_was_removed_while_it_was_waited_for_counts_for_nothing(tmp_path, monkeypatch):
    """The run that had it ends between the moments in which the next opens and locks its file."""
    usual, removed = fcntl.flock, []

    def late(lock, how):
        if not removed:
            removed.append((tmp_path / ".out.lock").unlink())
        usual(lock, how)

    monkeypatch.setattr(fcntl, "flock", late)
    with claim(tmp_path / "out", tmp_path) as certain:
        assert certain
        assert listed(tmp_path) == [".out.lock"]
        with pytest.raises(BlockingIOError):
            claim_briefly(tmp_path)


def test_a_dead_run_s_lock_that_is_another_user_s_is_taken_over(tmp_path, monkeypatch):
    (tmp_path / ".out.lock").write_text("process 1 on elsewhere, since long ago")
    usual = os.open

    def forbidden(path, flags, *rest):
        if flags & os.O_RDWR:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return usual(path, flags, *rest)

    monkeypatch.setattr(os, "open", forbidden)
    with claim(tmp_path / "out", tmp_path) as certain:
        assert certain
        with pytest.raises(BlockingIOError, match="process 1 on elsewhere"):
            claim_briefly(tmp_path)
    assert listed(tmp_path) == []
    with pytest.raises(PermissionError):
        claim_briefly(tmp_path)


def no_locks_of_the_system(monkeypatch):
    monkeypatch.setitem(sys.modules, "fcntl", None)


def no_locks_of_the_disk(monkeypatch):
    def fails(_file, _how):
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", fails)


@pytest.mark.parametrize("without", [no_locks_of_the_system, no_locks_of_the_disk])
def test_without_locks_nothing_is_certain(without, tmp_path, monkeypatch):
    without(monkeypatch)
    with claim(tmp_path / "out", tmp_path) as one, claim(tmp_path / "out", tmp_path) as other:
        assert (one, other) == (False, False)
    assert listed(tmp_path) == []


def test_who_may_wait_has_the_claim_when_the_other_run_ends(other, tmp_path, monkeypatch):
    monkeypatch.setattr("time.sleep", lambda _seconds: (other.kill(), other.wait()))
    with claim(tmp_path / "out", tmp_path, wait=True) as certain:
        assert certain


def names_in(seal):
    """Return the names that the seal lists, or else those that always belong to a content."""
    try:
        return frozenset(json.loads(seal.read_text()))
    except OSError:
        return frozenset({"seal", "table"})


CONTENT = Content("seal", names_in)


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

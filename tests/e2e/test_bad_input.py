"""Bad input is one line on stderr that says what, where and what to do, and exit code 1."""

import os
from pathlib import Path

import pytest

from tests.e2e.commands import here
from tests.jobs.making import write_log

POINTER = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a2146\nsize 12345\n"
NESTED = "a = " + "[" * 1_000 + "]" * 1_000


@pytest.fixture
def refused(tmp_path, monkeypatch):
    """Run a command beside a sound log; returns the one line. Nothing may be left behind."""
    monkeypatch.chdir(tmp_path)
    write_log(tmp_path / "drive.mcap")

    def refused(words):
        before = {*tmp_path.rglob("*")}
        done = here(*words.split(), cwd=tmp_path)
        assert (done.returncode, done.stdout) == (1, "")
        assert done.stderr.startswith("roadeval: error: ")
        assert done.stderr.count("\n") == 1
        assert {*tmp_path.rglob("*")} == before
        return done.stderr

    return refused


@pytest.mark.timeout(20)
@pytest.mark.parametrize(
    "words",
    [
        *("replay pipe", "info pipe", "train pipe -o m.model", "replay drive.mcap --model pipe"),
        *("replay drive.mcap --config pipe", "replay drive.mcap --variant other=pipe"),
        *("config --config pipe", "report pipe -o out.pdf", "report folder -o out.pdf"),
        *("inspect pipe --list", "compare pipe pipe", "pack images -o new.mcap"),
    ],
)
def test_a_pipe_is_refused_and_never_waited_for(words, refused):
    for folder in ("folder", "images"):
        Path(folder).mkdir()
    for pipe in ("pipe", "folder/summary.json", "images/0.png"):
        os.mkfifo(pipe)
    assert "is a pipe, not a file" in refused(words)


def test_a_device_is_refused_before_it_is_read(refused):
    line = refused("replay drive.mcap --config /dev/null")
    assert "/dev/null: cannot be read: is a device" in line


@pytest.mark.parametrize(
    "words",
    [
        *("config --config it.toml", "config --variant v=it.toml", "config --net n=it.toml"),
        *("config --masks m=it.toml", "fleet it.toml -o f"),
    ],
)
def test_toml_that_nests_too_deep_is_one_line(words, refused):
    Path("it.toml").write_text(NESTED)
    assert "it.toml: cannot be read as TOML: " in refused(words)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("a.mcap", "replay a.mcap"),
        ("labels/0000.png", "replay drive.mcap --truth labels"),
        ("labels/0000.txt", "replay drive.mcap --truth labels --road-label road"),
        ("coco.json", "replay drive.mcap --truth coco.json --road-label road"),
        ("cvat.xml", "replay drive.mcap --truth cvat.xml --road-label road"),
        ("masks/0000.png", "replay drive.mcap --masks mine=masks"),
        ("masks/0000.npy", "replay drive.mcap --masks mine=masks"),
        ("net.onnx", "replay drive.mcap --net mine=net.onnx"),
        ("net.toml", "replay drive.mcap --net mine=net.toml"),
        ("run.toml", "replay drive.mcap --config run.toml"),
        ("camera.toml", "replay drive.mcap --camera camera.toml"),
        ("city.model", "replay drive.mcap --model city.model"),
        ("fleet.toml", "fleet fleet.toml -o out"),
        ("out.rrd", "report out.rrd"),
        ("results/summary.json", "report results"),
        ("images/0000.jpg", "pack images -o new.mcap"),
    ],
)
def test_a_pointer_of_git_lfs_is_told_with_the_command_that_fetches_its_file(name, words, refused):
    Path(name).parent.mkdir(exist_ok=True)
    Path(name).write_text(POINTER)
    line = refused(words)
    assert f"{Path(name).name}: " in line
    assert "a pointer to a file in Git LFS: git lfs pull" in line

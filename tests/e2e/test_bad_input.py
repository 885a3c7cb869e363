"""Bad input is one line on stderr that says what, where and what to do, and exit code 1."""

import os
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from roadeval.cli.app import main
from roadeval.logs.writing.writer import LogWriter
from tests.e2e.commands import here

SECOND = 1_000_000_000


@pytest.fixture
def write(tmp_path):
    """Write a log of 8x6 images under these topics and, with a size, masks under /road_mask."""

    def write(*cameras, mask_size=None):
        image = np.tile(np.uint8([60, 120]), (6, 4))
        jpeg = cv2.imencode(".jpg", image)[1].tobytes()
        with LogWriter(tmp_path / "drive.mcap") as log:
            for stamp in range(SECOND, 5 * SECOND, SECOND):
                for topic in cameras:
                    log.image(topic, stamp, jpeg, "jpeg")
                if mask_size:
                    log.mask("/road_mask", stamp, np.tile(np.uint8([0, 255]), mask_size))
        return tmp_path / "drive.mcap"

    return write


@pytest.fixture
def refused(tmp_path, capsys):
    """Replay what cannot be replayed; returns the one line. Nothing may be left behind."""

    def refused(*words):
        outputs = ("--save", tmp_path / "out.rrd", "--reports", tmp_path / "reports")
        assert main(["replay", "--quiet", *map(str, (*outputs, *words))]) == 1
        said = capsys.readouterr()
        assert said.out == ""
        assert said.err.startswith("roadeval: error: ")
        assert said.err.count("\n") == 1
        assert not (tmp_path / "out.rrd").exists()
        assert not list(tmp_path.glob("reports/*"))
        assert not list(tmp_path.rglob("*partial*"))
        return said.err

    return refused


def test_two_cameras_to_choose_from(refused, write):
    line = refused(write("/left", "/right"))
    assert "/left, /right" in line
    assert "--image-topic" in line


def test_truth_of_another_size(refused, write):
    line = refused(write("/camera", mask_size=(12, 8)))
    assert "/road_mask is 16x12, but /camera is 8x6" in line
    assert "--resize-truth" in line


def test_nothing_left_to_evaluate(refused, write):
    line = refused(write("/camera", mask_size=(6, 4)))
    assert "--train-frames" in line


@pytest.mark.parametrize(
    "words",
    [
        ("compare", "cut"),
        ("compare", "cut", "cut"),
        ("inspect", "cut", "--list"),
        ("report", "cut", "-o", "x.pdf"),
    ],
)
def test_a_table_cut_at_the_end_of_a_line_gives_one_line_and_no_numbers(words, street, tmp_path):
    shutil.copytree(street.reports, tmp_path / "cut")
    lines = (tmp_path / "cut" / "frames.csv").read_text().splitlines(keepends=True)
    (tmp_path / "cut" / "frames.csv").write_text("".join(lines[:-7]))
    run = here(*words, cwd=tmp_path)
    assert (run.returncode, run.stdout) == (1, "")
    assert run.stderr == (
        "roadeval: error: cut/frames.csv: does not agree with its summary (133 of 140 rows); "
        "make the results again with roadeval replay\n"
    )


@pytest.mark.timeout(20)
@pytest.mark.parametrize(
    "words",
    [
        "replay pipe",
        "info pipe",
        "train pipe -o m.model",
        "replay drive.mcap --model pipe",
        "replay drive.mcap --config pipe",
        "replay drive.mcap --variant other=pipe",
        "config --config pipe",
        "report pipe -o out.pdf",
        "report folder -o out.pdf",
        "inspect pipe --list",
        "compare pipe pipe",
        "pack images -o new.mcap",
    ],
)
def test_a_pipe_is_refused_and_never_waited_for(words, write, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write("/camera")
    for folder in ("folder", "images"):
        Path(folder).mkdir()
    for pipe in ("pipe", "folder/summary.json", "images/0.png"):
        os.mkfifo(pipe)
    assert main(words.split()) == 1
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "is a pipe, not a file" in said


def test_a_device_is_refused_before_it_is_read(refused, write):
    line = refused(write("/camera"), "--config", "/dev/null")
    assert "/dev/null: cannot be read: is a device" in line

"""``roadeval report``: one PDF that says what the tables say, from the recording alone."""

import io
import re
import shutil
import signal
import socket
import subprocess
import sys

import cv2
import numpy as np
import pytest
from pypdf import PdfReader

from roadeval.jobs.results.result import DriveResult
from roadeval.logs.writing.writer import LogWriter
from tests.e2e.commands import here, roadeval


@pytest.fixture(scope="module")
def made(demo, tmp_path_factory):
    """The demo's report, made where neither the log nor the results folder is at hand."""
    folder = tmp_path_factory.mktemp("elsewhere")
    shutil.copy(demo.recording, folder / "drive.rrd")
    run = roadeval("report", "drive.rrd", "-o", "report.pdf", cwd=folder)
    assert run.returncode == 0, run.stderr
    assert run.stdout == "report.pdf\n"
    return (folder / "report.pdf").read_bytes()


def test_a_drive_has_eight_pages_at_most_and_no_frame_twice(made):
    pages = [page.extract_text() for page in PdfReader(io.BytesIO(made)).pages]
    assert len(pages) <= 8
    frames = re.findall(r"^Frame (\d+)$", "\n".join(pages), re.MULTILINE)
    assert len(set(frames)) == len(frames) > 2
    (figure,) = (page for page in pages if "The paper's figure 2: input" in page)
    assert figure.count("truth") >= 4


KILLED = """
import os, signal, sys
from roadeval import configure, replay

def kill(progress):
    if progress.stage == "replaying" and progress.done == int(sys.argv[2]):
        os.kill(os.getpid(), signal.SIGKILL)

replay(sys.argv[1], configure({"run": {"jobs": 1}}), save="out.rrd", on_progress=kill)
"""


@pytest.fixture(scope="module")
def killed(tmp_path_factory):
    """The partial recording of a run on sparse truth that is killed at its 42nd of 60 frames."""
    folder, noise = tmp_path_factory.mktemp("killed"), np.random.default_rng(0)
    road = np.repeat(np.uint8([0, 255]), 60)[:, None].repeat(160, axis=1)
    with LogWriter(folder / "drive.mcap") as log:
        for stamp in range(1, 61):
            image = noise.integers(0, 256, (*road.shape, 3), np.uint8)
            log.image("/camera", stamp * 10**8, cv2.imencode(".jpg", image)[1].tobytes(), "jpeg")
            if stamp % 3 == 1:
                log.mask("/road_mask", stamp * 10**8, road)
    command = [sys.executable, "-c", KILLED, "drive.mcap", "42"]
    assert subprocess.run(command, cwd=folder, check=False).returncode == -signal.SIGKILL
    (partial,) = folder.glob("out.*.partial.rrd")
    return partial


def test_a_killed_run_gives_a_report_of_its_readable_part_marked_on_page_1(killed, tmp_path):
    run = here("report", killed, "-o", tmp_path / "report.pdf")
    assert run.returncode == 0, run.stderr
    assert "a partial recording" in run.stderr
    for command in (("inspect", killed, "--list"), ("compare", killed)):
        assert "a partial recording" in here(*command).stderr
    pages = [page.extract_text() for page in PdfReader(tmp_path / "report.pdf").pages]
    first = pages[0]
    assert not any("Where the final masks go wrong" in page for page in pages)
    assert any("If a stage were perfect" in page for page in pages)
    assert "This run did not reach its end" in first
    (evaluated,) = re.findall(r"(\d+) frames? w\w+ evaluated", first)
    # Of the 20 frames with truth ten are trained on, and six more come before the end.
    assert 0 < int(evaluated) < 10


def test_a_killed_run_of_sparse_truth_shows_no_scored_frame_whose_truth_is_missing(killed):
    opened = DriveResult(killed)
    seen = set(opened.pictured)
    scored = set(opened.rows["frame"])
    assert len(seen & scored) > 1
    for frame in seen & scored:
        opened.recording.truth(frame)
        opened.recording.layer("unfiltered", "errors", frame)


def test_the_same_result_gives_the_same_file_and_nothing_is_left_beside_nor_fetched(
    demo, made, tmp_path, monkeypatch
):
    monkeypatch.setattr(socket.socket, "connect", lambda *_: pytest.fail("a connection"))
    monkeypatch.chdir(tmp_path)
    shutil.copy(demo.recording, "drive.rrd")
    assert here("report", "drive.rrd", "-o", "again.pdf").returncode == 0
    assert (tmp_path / "again.pdf").read_bytes() == made
    assert {file.name for file in tmp_path.iterdir()} == {"again.pdf", "drive.rrd"}


def test_a_report_of_another_kind_is_wrong_usage(demo, tmp_path):
    run = here("report", demo.recording, "-o", "page.txt", cwd=tmp_path)
    assert run.returncode == 2
    assert len(run.stderr.splitlines()) == 1
    assert not list(tmp_path.iterdir())

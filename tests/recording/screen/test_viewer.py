"""What the viewer needs from the machine, and what is said where that is missing."""

import pytest

from roadeval.recording.layout import RecordingError
from roadeval.recording.screen import viewer


def test_without_a_driver_the_package_that_brings_one_is_named(tmp_path, monkeypatch):
    monkeypatch.delenv("VK_ICD_FILENAMES", raising=False)
    monkeypatch.setattr(viewer, "DRIVERS", tmp_path)
    with pytest.raises(RecordingError, match="apt-get install mesa-vulkan-drivers"):
        viewer.screenshot(tmp_path / "x.rrd", tmp_path / "x.png")


def test_a_driver_that_somebody_chose_is_not_questioned(tmp_path, monkeypatch):
    monkeypatch.setenv("VK_ICD_FILENAMES", "/my/driver.json")
    monkeypatch.setattr(viewer, "DRIVERS", tmp_path)
    assert viewer._driver() == {}


def test_a_viewer_that_does_not_start_is_quoted(tmp_path, monkeypatch):
    script = tmp_path / "rerun"
    script.write_text("#!/bin/sh\necho 'no graphics at all'\nexit 3\n")
    script.chmod(0o700)
    monkeypatch.setenv("VK_ICD_FILENAMES", "/my/driver.json")
    monkeypatch.setattr(viewer, "_program", lambda: str(script))
    with pytest.raises(RecordingError, match="the viewer did not start: no graphics at all"):
        viewer.screenshot(tmp_path / "x.rrd", tmp_path / "x.png")


def test_the_viewer_listens_on_this_machine_alone_and_counts_nobody(tmp_path, monkeypatch):
    script = tmp_path / "rerun"
    script.write_text('#!/bin/sh\necho "$@ CI=$CI"\nexit 3\n')
    script.chmod(0o700)
    monkeypatch.setenv("VK_ICD_FILENAMES", "/my/driver.json")
    monkeypatch.setattr(viewer, "_program", lambda: str(script))
    with pytest.raises(RecordingError, match=r"--bind 127\.0\.0\.1 --port \d+ .* CI=1"):
        viewer.screenshot(tmp_path / "x.rrd", tmp_path / "x.png")

"""What the viewer needs from the machine, and what is said where it lacks that or is late."""

import pytest

from roadeval.recording import viewer
from roadeval.recording.layout import RecordingError


@pytest.fixture
def fake(tmp_path, monkeypatch):
    """A viewer that says how it was called and ends at once."""
    script = tmp_path / "rerun"
    script.write_text('#!/bin/sh\necho "$@ CI=$CI"\nexit 3\n')
    script.chmod(0o700)
    monkeypatch.setenv("VK_ICD_FILENAMES", "/my/driver.json")
    monkeypatch.setattr("rerun_cli.__file__", str(tmp_path / "__init__.py"))


def test_a_viewer_that_does_not_start_is_quoted_and_would_listen_on_this_machine_alone(
    fake, tmp_path
):
    said = r"the viewer did not start: .*--bind 127\.0\.0\.1 --port \d+ .* CI=1"
    with pytest.raises(RecordingError, match=said):
        viewer.screenshot(tmp_path / "x.rrd", tmp_path / "x.png")


def test_a_viewer_that_is_late_is_asked_again():
    answers = iter([TimeoutError("Deadline expired"), TimeoutError("Deadline expired"), "drawn"])

    def request():
        answer = next(answers)
        if isinstance(answer, Exception):
            raise answer
        return answer

    assert viewer.ask(request) == "drawn"


@pytest.mark.parametrize(
    ("failure", "said"),
    [
        (TimeoutError("Deadline expired"), "the viewer did not answer within 0 s"),
        (ConnectionError("tcp connect error"), "the viewer has ended: tcp connect error"),
        (RuntimeError("no window"), "the viewer has ended: no window"),
    ],
)
def test_a_viewer_that_never_answers_or_has_ended_is_told_in_one_line(failure, said, monkeypatch):
    monkeypatch.setattr(viewer, "LOADING_S", 0.0)

    def request():
        raise failure

    with pytest.raises(RecordingError, match=f"^{said}$"):
        viewer.ask(request)

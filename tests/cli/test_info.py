"""The command ``info``: what is in a log, and what replay would pick of it and why."""

import cv2
import numpy as np
import pytest

from roadeval.cli.app import main
from roadeval.logs.writing.writer import LogWriter
from tests.fixtures.make import make

SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND


@pytest.fixture
def write(tmp_path):
    """Write a log of 1 Hz with these topics; masks where a topic's values are given."""

    def write(topics, seconds=range(4)):
        with LogWriter(tmp_path / "drive.mcap") as log:
            for second in seconds:
                for topic, values in topics.items():
                    image = np.resize(np.array(values or [120], np.uint8), (6, 8))
                    stamp = START + second * SECOND
                    if values:
                        log.mask(topic, stamp, image)
                    else:
                        jpeg = cv2.imencode(".jpg", image)[1].tobytes()
                        log.image(topic, stamp, jpeg, "jpeg")
        return str(tmp_path / "drive.mcap")

    return write


def test_it_tells_what_replay_would_ask_for(write, capsys):
    drive = write({"/camera": None, "/labels": [0, 1, 2, 3]})
    assert main(["info", drive]) == 0
    assert "replay would stop: drive.mcap: /labels holds the values 0 1 2 3" in (
        capsys.readouterr().out
    )
    main(["info", drive, "--road-label", "3"])
    assert "truth: /labels (" in capsys.readouterr().out


def test_it_tells_where_messages_are_missing(write, capsys):
    main(["info", write({"/camera": None}, seconds=[0, 1, 2, 3, 9])])
    assert "/camera: gap of 6.00 s, 3.00 s after the start" in capsys.readouterr().out


def test_damage_is_told_and_has_its_exit_code(tmp_path, capsys):
    assert main(["info", str(make("broken/trunc_midchunk.mcap", tmp_path))]) == 3
    assert capsys.readouterr().err.startswith("roadeval: lost: trunc_midchunk.mcap: ")

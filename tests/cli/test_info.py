"""The command ``info``: what is in a log, and what replay would pick of it and why."""

import io

import cv2
import numpy as np
import pytest
from rich.console import Console

from roadeval.cli.app import main
from roadeval.cli.screens import info as screen
from roadeval.logs import LogWriter
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


def test_numbers_have_room_beside_long_names_and_types():
    topic = dict.fromkeys(("problem", "gaps", "format"), "") | {"encoding": "cdr", "count": 3000}
    topic |= {"name": "/camera/front_left/image_raw", "schema": "vendor_msgs/msg/RectifiedImage"}
    topic |= {"size": (1920, 1200), "rate_hz": 19.98}
    found = dict.fromkeys(("path", "problem", "picks"), "") | {"topics": [topic]}
    out = Console(file=io.StringIO(), width=80)
    screen.show(found | {"start_ns": 0, "end_ns": 1, "bytes": 1, "verified": True}, out)
    (row,) = [line for line in out.file.getvalue().splitlines() if line.startswith("/camera/")]
    assert row.split()[-4:] == ["1920x1200", "3000", "19.98", "Hz"]


def test_damage_is_told_and_has_its_exit_code(tmp_path, capsys):
    assert main(["info", str(make("broken/trunc_midchunk.mcap", tmp_path))]) == 3
    assert capsys.readouterr().err.startswith("roadeval: lost: trunc_midchunk.mcap: ")

"""All that there is to say about a log, as plain data."""

import json
from pathlib import Path

import pytest

from roadeval.logs import describe
from tests.fixtures.shared import both
from tests.logs.making import SECOND, drive

START = 1_700_000_000 * SECOND


def test_a_log_is_described_for_machines(tmp_path: Path) -> None:
    stamps = [START + i * SECOND for i in (0, 1, 2, 3, 9)]
    path = drive(tmp_path / "drive.mcap", stamps, stamps[:2])
    found = json.loads(json.dumps(describe(path).as_dict()))
    camera, labels = found["topics"]
    assert (camera["name"], camera["kind"], camera["format"]) == ("/camera", "compressed", "jpeg")
    assert (camera["count"], camera["rate_hz"], camera["size"]) == (5, 1.0, [8, 6])
    assert camera["gaps"] == [[stamps[3], stamps[4]]]
    assert (labels["channels"], labels["count"]) == (1, 2)
    assert found["bytes"] == path.stat().st_size
    assert found["picks"][0] == "image: /camera (the only camera image)"
    assert (found["problem"], found["damage"], found["losses"]) == ("", [], [])


@pytest.mark.parametrize("log", both("broken", "chunk_crc_field_bad.mcap"), indirect=True)
def test_all_damage_is_found(log: Path) -> None:
    assert "checksum is wrong" in describe(log).losses[0]


@pytest.mark.parametrize("log", both("broken", "magic_only.mcap"), indirect=True)
def test_the_problem_is_told(log: Path) -> None:
    assert "no image topic" in describe(log).problem

"""All that there is to say about a log, as plain data."""

import json
from pathlib import Path

from roadeval.logs import describe
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


def test_all_damage_is_found_and_the_problem_told(data: Path) -> None:
    broken = data / "mcap" / "broken"
    assert "checksum is wrong" in describe(broken / "chunk_crc_field_bad.mcap").losses[0]
    assert "no image topic" in describe(broken / "magic_only.mcap").problem

"""Logs behind URLs, of which only parts are read."""

import pytest

import roadeval
from roadeval.fleet.drives import FleetError
from roadeval.fleet.remote import readable
from roadeval.logs.log import open_log
from tests.fleet.serving import Server
from tests.jobs.making import settings, write_log
from tests.logs.test_digest import write


@pytest.fixture
def server(tmp_path):
    with Server(tmp_path) as server:
        yield server


def test_a_log_has_one_identity_on_disk_and_at_two_urls(server, tmp_path):
    path = write(tmp_path / "noise.mcap")
    with open_log(path) as log:
        digest = log.digest
    for url in (server.url("a/noise.mcap"), server.url("b/noise.mcap?signature=5d1c")):
        with open_log(readable(url)) as log:
            assert log.digest == digest
            assert (log.name, log.source) == ("noise", url.partition("?")[0])


def test_a_replay_of_a_url_is_that_of_the_file(server, tmp_path):
    path = write_log(tmp_path / "drive.mcap")
    for name, drive in (("disk", path), ("url", server.url("drive.mcap"))):
        found = roadeval.replay(drive, settings(record="none"), reports=tmp_path / name)
        assert found.facts.log.path == str(drive)
    tables = [(tmp_path / name / "frames.csv").read_text() for name in ("disk", "url")]
    assert tables[0] == tables[1]


def test_only_what_is_needed_is_fetched(server, tmp_path):
    path = write(tmp_path / "noise.mcap", size=2_000_000, frames=8)
    with open_log(readable(server.url("noise.mcap"))) as log:
        (topic,) = log.topics
        assert (topic.count, log.digest != "") == (8, True)
    assert server.sent < path.stat().st_size // 5


def test_a_log_that_changes_while_it_is_read_is_named(server, tmp_path):
    path = write(tmp_path / "noise.mcap")
    with open_log(readable(server.url("noise.mcap"))) as log:
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 0xFF
        path.write_bytes(content)
        with pytest.raises(FleetError, match=r"noise\.mcap: it changed while it was read"):
            log.verify()

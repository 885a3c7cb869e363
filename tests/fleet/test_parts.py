"""Logs behind URLs, of which only parts are read."""

import hashlib
import re
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from urllib.parse import urlsplit

import pytest

import roadeval
from roadeval.fleet import FleetError, readable, remote
from roadeval.logs import LogError, describe, open_log
from tests.jobs.making import settings, write_log
from tests.logs.test_digest import FRAMES, flipped, write


class _Handler(BaseHTTPRequestHandler):
    """Serves the parts of files that are asked for."""

    protocol_version = "HTTP/1.1"

    def do_HEAD(self) -> None:
        self.do_GET()

    def do_GET(self) -> None:
        status = 0
        content = (self.server.folder / Path(urlsplit(self.path).path).name).read_bytes()
        tag = f'"{hashlib.md5(content).hexdigest()}"'
        if self.headers.get("If-Match", tag) != tag:
            content, status = b"", 412
        asked = not status and re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
        begin, end = (int(asked[1]), int(asked[2]) + 1) if asked else (0, len(content))
        if self.command == "GET":
            self.server.sent += end - begin
        self.send_response(status or (206 if asked else 200))
        self.send_header("ETag", tag)
        self.send_header("Content-Length", str(end - begin))
        if asked:
            self.send_header("Content-Range", f"bytes {begin}-{end - 1}/{len(content)}")
        self.end_headers()
        if self.command == "GET":
            self.wfile.write(content[begin:end])

    def log_message(self, *_) -> None:
        """Say nothing."""


@pytest.fixture
def server(tmp_path):
    server = ThreadingHTTPServer(("127.0.0.1", 0), _Handler)
    server.folder, server.sent = tmp_path, 0
    server.url = f"http://127.0.0.1:{server.server_port}"
    Thread(target=server.serve_forever, daemon=True).start()
    yield server
    server.shutdown()
    server.server_close()


def test_a_log_has_one_identity_on_disk_and_at_two_urls(server, tmp_path):
    path = write(tmp_path / "noise.mcap")
    with open_log(path) as log:
        digest = log.digest
    for url in (f"{server.url}/a/noise.mcap", f"{server.url}/b/noise.mcap?signature=5d1c"):
        with open_log(readable(url)) as log:
            assert log.digest == digest
            assert (log.name, log.source) == ("noise", url.partition("?")[0])


def test_a_replay_of_a_url_is_that_of_the_file(server, tmp_path):
    path = write_log(tmp_path / "drive.mcap")
    for name, drive in (("disk", path), ("url", f"{server.url}/drive.mcap")):
        found = roadeval.replay(drive, settings(record="none"), reports=tmp_path / name)
        assert found.facts.log.path == str(drive)
    tables = [(tmp_path / name / "frames.csv").read_text() for name in ("disk", "url")]
    assert tables[0] == tables[1]


def test_only_what_is_needed_is_fetched(server, tmp_path, monkeypatch):
    monkeypatch.setattr(remote, "_PART", 1 << 10)
    path = write(tmp_path / "noise.mcap")
    with open_log(readable(f"{server.url}/noise.mcap")) as log:
        (topic,) = log.topics
        assert (topic.count, log.digest != "") == (FRAMES, True)
    assert server.sent < path.stat().st_size // 20


def test_a_changed_byte_in_a_chunk_is_told_where_all_is_read(server, tmp_path):
    path = write(tmp_path / "noise.mcap")
    flipped(path, path.stat().st_size // 2, tmp_path / "other.mcap")
    one, other = (
        describe(readable(f"{server.url}/{name}.mcap"), verify=True) for name in ("noise", "other")
    )
    assert not one.losses
    assert "checksum is wrong" in other.losses[0]
    assert one.sha256 != other.sha256


def test_a_log_that_changes_while_it_is_read_is_named(server, tmp_path, monkeypatch):
    monkeypatch.setattr(remote, "_PART", 1 << 10)
    path = write(tmp_path / "noise.mcap")
    with open_log(readable(f"{server.url}/noise.mcap")) as log:
        flipped(path, path.stat().st_size // 2, path)
        with pytest.raises(FleetError, match=r"noise\.mcap: it changed while it was read"):
            log.verify()


def test_what_is_no_log_behind_a_url_is_named(server, tmp_path):
    Path(tmp_path / "page.mcap").write_bytes(b"\x1f\x8b" + bytes(99))
    with pytest.raises(LogError, match="not an MCAP file but compressed as a whole by gzip"):
        open_log(readable(f"{server.url}/page.mcap"))


def test_a_wrong_scheme_is_named(tmp_path):
    with pytest.raises(FleetError, match=r"^ftp://host/a\.mcap: no scheme that is known; choose"):
        readable("ftp://host/a.mcap")
    assert readable(tmp_path / "a.mcap") == tmp_path / "a.mcap"

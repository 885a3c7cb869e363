"""Drives on web servers: read by parts, or refused in one line."""

import os
import signal
import time
from base64 import b64encode
from datetime import timedelta
from pathlib import Path
from threading import Timer

import pytest

import roadeval
from roadeval.errors import RoadevalError
from roadeval.fleet import remote
from roadeval.fleet.drives import FleetError
from roadeval.fleet.remote import open_source, stamp
from roadeval.logs.log import open_log
from tests.fleet.serving import CONTENT, SLOW, Server, s3_is_at
from tests.jobs.making import settings, write_log
from tests.logs.test_log import write


@pytest.fixture(scope="module")
def running():
    with Server() as server:
        yield server


@pytest.fixture
def server(running, monkeypatch):
    """A server, and a client with little patience."""
    pause = {"init_backoff": timedelta(milliseconds=1), "max_backoff": timedelta(milliseconds=9)}
    monkeypatch.setattr(remote, "RETRIES", {"max_retries": 2, "backoff": pause})
    running.requests.clear()
    return running


@pytest.fixture
def s3(server, monkeypatch):
    """The server as an S3 endpoint without TLS."""
    s3_is_at(server.url(""), monkeypatch)
    return server


def fetched(url: str, patience_s: float = 20) -> bytes:
    """The bytes of a drive."""
    return open_source(url, patience_s).file.read(len(CONTENT))


def refused(url: str) -> str:
    """The message with which a URL is refused."""
    with pytest.raises(RoadevalError) as error:
        fetched(url)
    assert error.value.__cause__ is None
    message = str(error.value)
    assert "\n" not in message
    assert "geheim" not in message
    return message


def test_what_is_behind_a_url_is_read(server):
    url = server.url("whole/Monday%20rain.mcap")
    assert fetched(url) == CONTENT
    assert open_source(url).path == Path("Monday rain.mcap")


@pytest.mark.parametrize(
    ("path", "name"),
    [
        ("whole/..%2F..%2Fetc%2Fpasswd.mcap", "passwd.mcap"),
        ("whole/..%5Cup.mcap", ".._up.mcap"),
        ("whole/%2E%2E", "drive"),
        ("whole/a%00b%3A.mcap", "a_b_.mcap"),
        ("whole/", "whole"),
    ],
)
def test_the_name_of_a_file_is_none_of_a_folder_whatever_the_url_says(path, name):
    from roadeval.fleet.remote import file_name

    assert file_name(f"https://host/{path}") == name


def test_a_signed_url_is_asked_with_its_query_and_not_shown_with_it(server):
    log = open_source(server.url("whole/a.mcap?sig=geheim%2F&x=1"))
    assert (log.path, log.source) == (Path("a.mcap"), server.url("whole/a.mcap"))
    assert server.requests[0][1] == "/whole/a.mcap?sig=geheim%2F&x=1"
    message = refused(server.url("403/a.mcap?sig=geheim", user="me:geheim@"))
    assert message == f"{server.url('403/a.mcap')}: the server denies access"


def test_user_and_password_of_a_url_are_sent(server):
    fetched(server.url("whole/a.mcap", user="me:ge%40heim@"))
    header = server.requests[-1][2]["authorization"]
    assert header == f"Basic {b64encode(b'me:ge@heim').decode()}"


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("401/a.mcap", "the server asks who you are"),
        ("404/a.mcap", "there is no such file"),
        ("410/a.mcap", "the server cannot give it"),
        ("503/a.mcap", "the server cannot give it"),
        ("unknown/a.mcap", "the server does not state its length"),
        ("early/a.mcap", "the server gives no parts of files; copy the file here"),
        ("retagged/a.mcap", "it changed while it was read"),
        ("touched/a.mcap", "it changed while it was read"),
        ("grown/a.mcap", "it changed while it was read"),
        ("endless/a.mcap", "the server sends too much"),
        ("zipped/a.mcap", "the server compresses it with gzip, unasked; copy the file here"),
    ],
)
def test_what_a_server_cannot_give_is_refused_in_one_line(server, path, message):
    url = server.url(path)
    assert refused(f"{url}?sig=geheim") == f"{url}: {message}"


@pytest.mark.parametrize("kind", ["weakened", "untagged"])
def test_a_tag_that_is_weakened_or_missing_is_no_change(server, kind):
    assert fetched(server.url(f"{kind}/a.mcap")) == CONTENT


def test_a_server_that_may_compress_is_asked_not_to(server):
    assert fetched(server.url("zipping/a.mcap")) == CONTENT


def test_of_an_answer_without_end_little_more_than_was_asked_for_is_taken(server):
    server.sent = 0
    refused(server.url("endless/a.mcap"))
    assert server.sent < 10 * len(CONTENT)


@pytest.mark.parametrize("path", ["hung/a.mcap", "stalled/a.mcap"])
def test_a_silent_server_is_waited_for_as_long_as_was_asked(server, path):
    begun = time.monotonic()
    with pytest.raises(RoadevalError, match="the server stopped answering"):
        fetched(server.url(path), patience_s=2)
    assert 1 < time.monotonic() - begun < 4.5


def test_a_part_that_breaks_off_goes_on_where_it_broke(server):
    assert fetched(server.url("resumed/a.mcap")) == CONTENT
    ranges = [headers["range"] for method, _, headers in server.requests if method == "GET"]
    assert ranges[0] == f"bytes=0-{len(CONTENT) - 1}"
    assert len(ranges) > 1
    assert not ranges[1].startswith("bytes=0-")


@pytest.mark.parametrize(
    ("host", "message"),
    [
        ("127.0.0.1:9", "the host cannot be reached"),
        ("nowhere.invalid", "no host of this name is known"),
    ],
)
def test_a_host_that_cannot_be_reached_is_told(server, host, message):
    assert refused(f"http://me:geheim@{host}/a") == f"http://{host}/a: {message}"


def test_a_stamp_is_found_where_only_reading_is_allowed(server):
    assert stamp(server.url("signed/a.mcap"))[0] == len(CONTENT)
    with pytest.raises(RoadevalError, match=r"404/a\.mcap: there is no such file"):
        stamp(server.url("404/a.mcap?sig=geheim"))


def test_an_endpoint_without_tls_must_be_allowed(s3, monkeypatch):
    monkeypatch.delenv("AWS_ALLOW_HTTP")
    assert "AWS_ALLOW_HTTP=true" in refused("s3://whole/key.mcap")


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("s3://key:geheim@bucket/a", "s3://bucket/a: credentials are read from the environment"),
        ("s3:///a", "s3:///a: no bucket in it"),
        ("ftp://me:geheim@host/a", "ftp://host/a: an unknown scheme"),
    ],
)
def test_a_url_that_cannot_be_read_is_refused(url, message):
    assert refused(url).startswith(message)


def test_without_obstore_a_url_names_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "obstore", None)
    with pytest.raises(RoadevalError, match=r"pip install 'roadeval\[remote\]'"):
        stamp("s3://bucket/a.mcap")


@pytest.fixture
def interruptible():
    """Let SIGINT interrupt, which a shell's background processes ignore from their start on."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for a process alone")
@pytest.mark.usefixtures("interruptible")
def test_an_interrupt_ends_the_wait_for_a_server_at_once(server, monkeypatch):
    begun = time.monotonic()
    Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        fetched(server.url("stalled/a.mcap"))
    assert time.monotonic() - begun < SLOW - 1


@pytest.fixture
def files(tmp_path):
    with Server(tmp_path) as server:
        yield server


def test_a_log_has_one_identity_on_disk_and_at_two_urls(files, tmp_path):
    path = write(tmp_path / "noise.mcap")
    with open_log(path) as log:
        digest = log.digest
    for url in (files.url("a/noise.mcap"), files.url("b/noise.mcap?signature=5d1c")):
        with open_log(open_source(url)) as log:
            assert log.digest == digest
            assert (log.name, log.source) == ("noise", url.partition("?")[0])


def test_a_replay_of_a_url_is_that_of_the_file(files, tmp_path):
    path = write_log(tmp_path / "drive.mcap")
    for name, drive in (("disk", path), ("url", files.url("drive.mcap"))):
        outcome = roadeval.replay(drive, settings(record="none"), reports=tmp_path / name)
        assert outcome.facts.log.path == str(drive)
    tables = [(tmp_path / name / "frames.csv").read_text() for name in ("disk", "url")]
    assert tables[0] == tables[1]


def test_only_what_is_needed_is_fetched(files, tmp_path):
    path = write(tmp_path / "noise.mcap", size=2_000_000, frames=8)
    with open_log(open_source(files.url("noise.mcap"))) as log:
        (topic,) = log.topics
        assert (topic.count, log.digest != "") == (8, True)
    assert files.sent < path.stat().st_size // 5


def test_a_log_that_changes_while_it_is_read_is_named(files, tmp_path):
    path = write(tmp_path / "noise.mcap")
    with open_log(open_source(files.url("noise.mcap"))) as log:
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 0xFF
        path.write_bytes(content)
        with pytest.raises(FleetError, match=r"noise\.mcap: it changed while it was read"):
            log.verify()

"""Drives on web servers: copied whole or refused in one line, and removed again."""

import os
import shutil
import signal
import time
import tracemalloc
from base64 import b64encode
from datetime import timedelta
from pathlib import Path
from threading import Timer
from types import SimpleNamespace

import pytest

from roadeval.errors import RoadevalError
from roadeval.fleet import remote, staged, stamp
from tests.fleet.serving import CONTENT, SLOW, Server

MIB = 1 << 20


@pytest.fixture(scope="module")
def running():
    with Server() as server:
        yield server


@pytest.fixture
def server(running, monkeypatch):
    """A server, and a client with little patience."""
    times = {"connect_timeout": "2s", "read_timeout": "1s", "timeout": "60s"}
    pause = {"init_backoff": timedelta(milliseconds=1), "max_backoff": timedelta(milliseconds=9)}
    retries = {"max_retries": 2, "retry_timeout": timedelta(seconds=20), "backoff": pause}
    monkeypatch.setattr(remote, "TIMES", times)
    monkeypatch.setattr(remote, "RETRIES", retries)
    running.asked.clear()
    return running


@pytest.fixture
def s3(server, monkeypatch):
    """The server as an S3 endpoint without TLS."""
    for key in [key for key in os.environ if key.startswith("AWS_")]:
        monkeypatch.delenv(key)
    for key, value in {
        "AWS_ACCESS_KEY_ID": "user",
        "AWS_SECRET_ACCESS_KEY": "geheim",
        "AWS_ENDPOINT_URL": server.url(""),
        "AWS_ALLOW_HTTP": "true",
    }.items():
        monkeypatch.setenv(key, value)
    return server


def refused(url: str, stage: Path) -> str:
    """The message with which a URL is refused; nothing is left of its copy."""
    with pytest.raises(RoadevalError) as error, staged(url, stage):
        pytest.fail("the drive is there")
    assert not list(stage.iterdir())
    assert error.value.__cause__ is None
    message = str(error.value)
    assert "\n" not in message
    assert "geheim" not in message
    return message


def test_a_path_and_a_file_url_are_themselves(tmp_path):
    path = tmp_path / "a b.mcap"
    path.write_bytes(b"log")
    for source in (str(path), path.as_uri()):
        with staged(source) as here:
            assert here == path
        assert path.exists()


def test_a_url_is_a_copy_until_the_block_ends(server, tmp_path):
    with staged(server.url("whole/Monday%20rain.mcap"), tmp_path / "stage") as copy:
        assert copy.read_bytes() == CONTENT
        assert copy.name == "Monday rain.mcap"
        assert copy.is_relative_to(tmp_path / "stage")
    assert not list((tmp_path / "stage").iterdir())
    assert [(method, path) for method, path, _ in server.asked] == [
        ("GET", "/whole/Monday%20rain.mcap")
    ]


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError("of the block"), RoadevalError("x")])
def test_a_copy_is_removed_whatever_ends_the_block(server, tmp_path, error):
    wanted = error if isinstance(error, type) else type(error)
    with pytest.raises(wanted) as raised, staged(server.url("whole/a.mcap"), tmp_path):
        raise error
    assert raised.value is error or isinstance(error, type)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("path", "name"),
    [
        ("whole/..%2F..%2Fetc%2Fpasswd.mcap", "passwd.mcap"),
        ("whole/..%5Cup.mcap", ".._up.mcap"),
        ("whole/%2E%2E", "drive"),
        ("whole/a%00b%3A.mcap", "a_b_.mcap"),
        ("whole/" + "x" * 300 + ".mcap", "x" * 100 + ".mcap"),
        ("whole/", "whole"),
    ],
)
def test_a_copy_stays_in_its_folder_whatever_the_url_says(path, name):
    from roadeval.fleet.remote import _file_name

    assert _file_name(f"https://host/{path}") == name


def test_a_signed_url_is_asked_with_its_query_and_not_shown_with_it(server, tmp_path):
    with staged(server.url("whole/a.mcap?sig=geheim%2F&x=1"), tmp_path) as copy:
        assert copy.name == "a.mcap"
    assert server.asked[0][1] == "/whole/a.mcap?sig=geheim%2F&x=1"
    message = refused(server.url("403/a.mcap?sig=geheim", user="me:geheim@"), tmp_path)
    assert message == f"{server.url('403/a.mcap')}: the server denies access (403 Forbidden)"


def test_user_and_password_of_a_url_are_sent(server, tmp_path):
    with staged(server.url("whole/a.mcap", user="me:ge%40heim@"), tmp_path):
        pass
    header = server.asked[0][2]["authorization"]
    assert header == f"Basic {b64encode(b'me:ge@heim').decode()}"


@pytest.mark.parametrize(
    ("path", "message", "times"),
    [
        ("401/a.mcap", "the server asks who you are (401 Unauthorized)", 1),
        ("404/a.mcap", "there is no such file (404 Not Found)", 1),
        ("410/a.mcap", "the server cannot give it (410 Gone)", 1),
        ("503/a.mcap", "the server cannot give it (503 Service Unavailable)", 3),
        ("unknown/a.mcap", "the server does not state its length", 1),
        ("early/a.mcap", "ended early, and the server cannot continue it", 2),
        ("stalled/a.mcap", "ended early, and the server cannot continue it", 2),
    ],
)
def test_what_a_server_cannot_give_is_refused_in_one_line(server, tmp_path, path, message, times):
    url = server.url(path)
    assert refused(f"{url}?sig=geheim", tmp_path) == f"{url}: {message}"
    assert len(server.asked) == times


def test_a_stream_that_breaks_goes_on_where_it_broke(server, tmp_path):
    with staged(server.url("resumed/a.mcap"), tmp_path) as copy:
        assert copy.read_bytes() == CONTENT
    assert [headers.get("range", "")[:6] for _, _, headers in server.asked] == ["", "bytes="]


@pytest.mark.parametrize(
    ("host", "message"),
    [
        ("127.0.0.1:9", "the host cannot be reached"),
        ("nowhere.invalid", "no host of this name is known"),
    ],
)
def test_a_host_that_cannot_be_reached_is_told(server, tmp_path, host, message):
    assert refused(f"http://me:geheim@{host}/a", tmp_path) == f"http://{host}/a: {message}"


def test_a_stream_of_another_length_is_refused(server, tmp_path, monkeypatch):
    result = SimpleNamespace(meta={"size": 7, "e_tag": None}, stream=lambda _: iter([b"abc"]))
    monkeypatch.setattr("obstore.get", lambda *_: result)
    assert refused("https://host/a", tmp_path).endswith("ended early, after 3 of 7 bytes")


def test_a_copy_that_does_not_fit_is_refused_before_it_begins(server, tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=5 * MIB))
    message = refused(server.url("whole/a.mcap"), tmp_path)
    assert "no copy of its 9 MiB fits in" in message
    assert "where 5 MiB are free; TMPDIR names another folder" in message


def test_a_disk_that_becomes_full_is_told(server, tmp_path, monkeypatch):
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("this system has no /dev/full")
    monkeypatch.setattr("roadeval.fleet.remote._file_name", lambda _: full)
    with (
        pytest.raises(RoadevalError, match=r"cannot be copied .* No space left on device"),
        staged(server.url("whole/a.mcap"), tmp_path),
    ):
        pytest.fail("the drive is there")
    assert not list(tmp_path.iterdir())


def test_a_drive_is_never_in_memory_as_a_whole(server, tmp_path, monkeypatch):
    blocks = (bytes(4 * MIB) for _ in range(16))
    result = SimpleNamespace(meta={"size": 64 * MIB, "e_tag": None}, stream=lambda _: blocks)
    monkeypatch.setattr("obstore.get", lambda *_: result)
    tracemalloc.start()
    with staged("https://host/a.mcap", tmp_path) as copy:
        assert copy.stat().st_size == 64 * MIB
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 20 * MIB


def test_a_stamp_of_a_url_asks_for_its_head_alone(server):
    size, tag = stamp(server.url("whole/a.mcap"))["a.mcap"]
    assert (size, len(tag)) == (len(CONTENT), 34)
    assert [method for method, _, _ in server.asked] == ["HEAD"]


def test_a_stamp_is_found_where_only_reading_is_allowed(server):
    assert stamp(server.url("signed/a.mcap"))["a.mcap"][0] == len(CONTENT)
    with pytest.raises(RoadevalError, match=r"404/a\.mcap: there is no such file"):
        stamp(server.url("404/a.mcap?sig=geheim"))


def test_an_endpoint_without_tls_must_be_allowed(s3, tmp_path, monkeypatch):
    monkeypatch.delenv("AWS_ALLOW_HTTP")
    assert "AWS_ALLOW_HTTP=true" in refused("s3://whole/key.mcap", tmp_path)


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("s3://key:geheim@bucket/a", "s3://bucket/a: credentials are read from the environment"),
        ("s3:///a", "s3:///a: no bucket in it"),
        ("ftp://me:geheim@host/a", "ftp://host/a: no scheme that is known"),
        ("https://host/folder/", "https://host/folder/: a web server does not list its folders"),
    ],
)
def test_a_url_that_cannot_be_read_is_refused(tmp_path, url, message):
    assert refused(url, tmp_path).startswith(message)


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
def test_an_interrupt_ends_a_copy_at_once_and_removes_it(server, tmp_path, monkeypatch):
    monkeypatch.setitem(remote.TIMES, "read_timeout", "60s")
    begun = time.monotonic()
    Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt), staged(server.url("stalled/a.mcap"), tmp_path):
        pytest.fail("the drive is there")
    assert time.monotonic() - begun < SLOW - 1
    assert not list(tmp_path.iterdir())

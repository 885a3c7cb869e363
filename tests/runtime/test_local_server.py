"""A server for this machine alone: who is answered, and who is not."""

import http.client
import socket
import struct
import threading
import time
from urllib.parse import urlsplit

import pytest

from roadeval.runtime.local_server import NOT_FOUND, LocalServer, Response


def echo(request):
    """Answer with what was asked for."""
    if request.parts == ("nothing",):
        return NOT_FOUND
    if request.parts == ("large",):
        return Response(bytes(1 << 26))
    if request.parts == ("defect",):
        raise ZeroDivisionError("by")
    return Response(repr((request.parts, request.acts, request.folder)).encode())


@pytest.fixture(scope="module")
def server():
    made = LocalServer(echo)
    thread = threading.Thread(target=made.serve_forever, args=(0.1,))
    thread.start()
    yield made
    made.shutdown()
    thread.join()
    made.server_close()


def ask(server, path="", method="GET", *, whole=False, **headers):
    """Send a request below the token, or as the path says; return status, headers and text."""
    address = urlsplit(server.address)
    connection = http.client.HTTPConnection(address.hostname, address.port, timeout=60)
    wanted = path if whole else address.path + path
    given = {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request(method, wanted, headers=given)
    answer = connection.getresponse()
    found = answer.status, answer.headers, answer.read().decode()
    connection.close()
    return found


def origin(server):
    return server.address[: -len(urlsplit(server.address).path)]


def test_who_knows_the_address_is_answered(server):
    status, headers, text = ask(server, "0/frame/84")
    assert (status, text) == (200, "(('0', 'frame', '84'), False, False)")
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Cache-Control"] == "no-store"
    assert "Python" not in headers["Server"]


@pytest.mark.parametrize("path", ["/", "/0/", "/wrong/0/", "//0/", "/%2e%2e/0/", "*", "/TOKEN"])
def test_without_the_token_nothing_is_told(server, path):
    status, _, text = ask(server, path, whole=True)
    assert status == 403
    assert "token" in text


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example"},
        {"Host": "127.0.0.1"},
        {"Host": "127.0.0.1:1"},
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Sec_Fetch_Site": "cross-site"},
        {"Sec_Fetch_Site": "same-site"},
    ],
)
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_what_another_page_asks_for_is_refused(server, headers, method):
    own = {"Origin": origin(server)} if method == "POST" else {}
    status, _, text = ask(server, "0/", method, **{**own, **headers})
    assert status == 403
    assert "0" not in text


def test_to_act_takes_the_pages_own_origin(server):
    assert ask(server, "0/view", "POST")[0] == 403
    status, _, text = ask(server, "0/view", "POST", Origin=origin(server))
    assert (status, text) == (200, "(('0', 'view'), True, False)")


@pytest.mark.parametrize(
    "path",
    [
        "../",
        "0/../../etc/passwd",
        "0/%2e%2e/x",
        "0//x",
        "0/.hidden",
        "0/a%2fb",
        "0/a\\..\\b",
        "~",
        "9" * 300,
    ],
)
def test_no_path_leads_anywhere_else(server, path):
    assert ask(server, path)[0] == 403


@pytest.mark.parametrize("debug", ["0", "1"])
def test_a_defect_is_one_line_and_its_traceback_is_shown_where_it_is_asked_for(
    server, debug, monkeypatch, capsys
):
    monkeypatch.setenv("ROADEVAL_DEBUG", debug)
    status, _, text = ask(server, "defect")
    assert (status, text.count("\n")) == (500, 1)
    assert text.startswith("ZeroDivisionError: by (a defect of roadeval")
    err = capsys.readouterr().err
    assert ("in echo" in err) if debug == "1" else not err


def test_of_a_browser_that_leaves_nothing_is_said(server, capsys):
    before = threading.active_count()
    address = urlsplit(server.address)
    asked = f"GET {address.path}large HTTP/1.1\r\nHost: {address.netloc}\r\n\r\n"
    with socket.create_connection((address.hostname, address.port)) as connection:
        connection.sendall(asked.encode())
        connection.recv(1)
        # Closed at once, with what was not read thrown away.
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    while threading.active_count() > before:
        time.sleep(0.01)
    assert not capsys.readouterr().err
    assert ask(server, "0/")[0] == 200

"""A web server on 127.0.0.1 whose files behave as their folders are called.

``/whole/...`` is served as it should be, ``/early/...`` breaks off, and so on. It answers as S3
does, too: ``/bucket/key`` is an object of its bucket.
"""

from __future__ import annotations

import gzip
import os
import re
import time
import zlib
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Lock, Thread
from typing import Any, Self
from urllib.parse import urlsplit

import pytest

CONTENT = bytes(range(256)) * 40_000
"""Ten megabytes."""
ENDLESS = 1 << 30
"""Bytes after which a server that never ends gives up."""
SLOW = 5.0
"""Seconds for which a server stalls."""


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: Server

    def do_HEAD(self) -> None:
        self._answer(body=False)

    def do_GET(self) -> None:
        self._answer(body=True)

    def _answer(self, *, body: bool) -> None:
        with self.server.waiting:
            time.sleep(self.server.latency)
            self._answer_now(body=body)

    def _answer_now(self, *, body: bool) -> None:
        kind = "whole" if self.server.folder else self.path.strip("/").partition("/")[0]
        self.server.requests.append((self.command, self.path, dict(self.headers)))
        if len(self.server.requests) > self.server.fails_after:
            self._head(503, 0)
        elif kind == "hung":
            time.sleep(SLOW)
        elif kind.isdigit():
            self._head(int(kind), 0)
        elif kind == "signed" and not body:
            self._head(403, 0)
        elif kind == "unknown":
            self._head(200, None)
        else:
            self._content(kind, body=body)

    def _head(self, status: int, length: int | None, **headers: str) -> None:
        self.send_response(status)
        if length is not None:
            self.send_header("Content-Length", str(length))
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        self.close_connection = length is None

    def _content(self, kind: str, *, body: bool) -> None:
        name, folder = Path(urlsplit(self.path).path).name, self.server.folder
        content = (folder / name).read_bytes() if folder else CONTENT
        tag = f'"{zlib.crc32(content):x}"'
        if self.headers.get("If-Match", tag) != tag:
            self._head(412, 0)
            return
        later = self.command == "GET"
        hour = 8 if kind == "touched" and later else 7
        tags = {"retagged": '"another"', "weakened": f"W/{tag}"} if later else {}
        headers = {
            "ETag": tags.get(kind, tag),
            "Last-Modified": f"Wed, 21 Oct 2015 {hour:02}:28:00 GMT",
        }
        if kind in ("touched", "untagged", "grown"):
            del headers["ETag"]
        begin, end, size = 0, len(content), len(content)
        byte_range = re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
        if byte_range is not None and kind != "early":
            begin, end = int(byte_range[1]), int(byte_range[2]) + 1
            size += kind == "grown"
            headers["Content-Range"] = f"bytes {begin}-{end - 1}/{size}"
        if later and self._compresses(kind):
            # The range is one of the compressed file.
            content, headers["Content-Encoding"] = gzip.compress(content), "gzip"
            end = min(end, len(content))
            headers["Content-Range"] = f"bytes {begin}-{end - 1}/{len(content)}"
        length = 1 << 40 if kind == "endless" and body else end - begin
        self._head(206 if "Content-Range" in headers else 200, length, **headers)
        if body and kind == "endless":
            with suppress(OSError):  # until the client goes away
                while self.server.sent < ENDLESS:
                    self.server.sent += self.wfile.write(CONTENT)
        elif body and kind in ("early", "stalled", "resumed") and not begin:
            self.close_connection = True
            self.wfile.write(content[: end // 2])
            self.wfile.flush()
            time.sleep(SLOW if kind == "stalled" else 0)
        elif body:
            self.server.sent += end - begin
            self.wfile.write(content[begin:end])

    def _compresses(self, kind: str) -> bool:
        asked_as_is = self.headers.get("Accept-Encoding") == "identity"
        return kind == "zipped" or (kind == "zipping" and not asked_as_is)

    def log_message(self, *_: Any) -> None:
        """Stay silent."""


class _Count:
    """The threads within its ``with`` statement, and the most that ever were."""

    def __init__(self) -> None:
        self.now, self.most, self._lock = 0, 0, Lock()

    def __enter__(self) -> None:
        with self._lock:
            self.now += 1
            self.most = max(self.most, self.now)

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self.now -= 1


class Server(ThreadingHTTPServer):
    """The server; ``requests`` has the method, path and headers of each request.

    With a ``folder`` all its files are served as they should be, whatever stands before their name.
    It waits ``latency`` seconds before each answer, and gives none after ``fails_after`` of them.
    """

    daemon_threads = True

    def __init__(self, folder: Path | None = None) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.folder, self.sent = folder, 0
        self.latency, self.fails_after, self.waiting = 0.0, 1 << 30, _Count()
        self.requests: list[tuple[str, str, dict[str, str]]] = []
        self._thread = Thread(target=self.serve_forever, args=(0.05,), daemon=True)

    def url(self, path: str, scheme: str = "http", user: str = "") -> str:
        """Return the URL of one of its files."""
        return f"{scheme}://{user}127.0.0.1:{self.server_port}/{path}"

    def handle_error(self, *_: Any) -> None:
        """Stay silent where a client goes away, which some cases are about."""

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: Any) -> None:
        self.shutdown()
        self.server_close()


def s3_is_at(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the environment name this S3 endpoint, without TLS."""
    for key in [key for key in os.environ if key.startswith("AWS_")]:
        monkeypatch.delenv(key)
    for key, value in {
        "AWS_ACCESS_KEY_ID": "user",
        "AWS_SECRET_ACCESS_KEY": "geheim",
        "AWS_ENDPOINT_URL": url,
        "AWS_ALLOW_HTTP": "true",
    }.items():
        monkeypatch.setenv(key, value)

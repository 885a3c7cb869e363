#!/usr/bin/env bash
# One call of obstore's `get_ranges` returns bytes of two versions of a file, and cannot notice it.
#
# Software: obstore 0.12.1.
#
# `get_ranges` reads several parts of an object with one call, which is what one wants for a log
# whose index names the chunks. Parts that lie apart are requests of their own. None of them names
# the version that it belongs to (no `If-Match`), the function has no parameter for one, and it
# returns bytes alone, without the ETag or the time of change of any answer. A recorder that uploads
# a longer log under the same name between two of these requests leads to an answer of which one
# part is old and another is new. Parts that lie near each other are one request, so that a test
# with a small file does not show it. `get` with the options `range` and `if_match` raises
# `PreconditionError`, and its answer has the ETag to ask with.
#
# Source: the requests that a server of its own receives, and what both functions return.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check obstore==0.12.1
"$folder/venv/bin/python" - <<'PYTHON'
import inspect
import re
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Lock, Thread

import obstore
from obstore.exceptions import PreconditionError
from obstore.store import HTTPStore

SIZE = 64 << 20
FAR = 60 << 20
requests = []
lock = Lock()


class Handler(BaseHTTPRequestHandler):
    """Serves a file of `a`; after the first part it is a file of `b`, with another ETag."""

    protocol_version = "HTTP/1.1"

    def do_HEAD(self):
        self.answer(0, b"")

    def do_GET(self):
        first, last = map(int, re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers["Range"]).groups())
        with lock:
            version = min(len(requests), 1)
            requests.append((first, last, self.headers.get("If-Match")))
        self.answer(version, b"ab"[version : version + 1] * (last - first + 1), first, last)

    def answer(self, version, body, first=0, last=SIZE - 1):
        tag = f'"version {version}"'
        fits = self.headers.get("If-Match", tag) == tag
        self.send_response(412 if not fits else 206 if body else 200)
        self.send_header("ETag", tag)
        self.send_header("Content-Length", str(last - first + 1 if fits else 0))
        if body and fits:
            self.send_header("Content-Range", f"bytes {first}-{last}/{SIZE}")
        self.end_headers()
        if fits:
            self.wfile.write(body)

    def log_message(self, *_):
        pass


server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
server.daemon_threads = True
Thread(target=server.serve_forever, daemon=True).start()
place = f"http://127.0.0.1:{server.server_port}"
store = HTTPStore(place, client_options={"allow_http": True})

parts = obstore.get_ranges(store, "log.mcap", starts=[0, FAR], ends=[4, FAR + 4])
print("get_ranges, far apart:", sorted(map(bytes, parts)), "requests:", sorted(requests))
assert sorted(map(bytes, parts)) == [b"aaaa", b"bbbb"]
assert [tag for _, _, tag in requests] == [None, None]
assert "if_match" not in inspect.signature(obstore.get_ranges).parameters
assert not {"options", "e_tag"} & set(inspect.signature(obstore.get_ranges).parameters)

requests.clear()
parts = obstore.get_ranges(store, "log.mcap", starts=[0, 100], ends=[4, 104])
print("get_ranges, near each other:", [*map(bytes, parts)], "requests:", requests)
assert requests == [(0, 103, None)]

requests.clear()
tag = obstore.head(store, "log.mcap")["e_tag"]
first = obstore.get(store, "log.mcap", options={"range": (0, 4), "if_match": tag})
assert bytes(first.bytes()) == b"aaaa"
try:
    obstore.get(store, "log.mcap", options={"range": (FAR, FAR + 4), "if_match": tag})
except PreconditionError:
    print("get with if_match: PreconditionError for the second part")
else:
    raise AssertionError("get took the other version")
PYTHON

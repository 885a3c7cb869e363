#!/usr/bin/env bash
# fsspec's `cat_file`, asked for ten bytes of a file on an HTTP server, may return the whole file.
#
# Software: fsspec 2026.9.0 with aiohttp 3.14.5, against obstore 0.12.1; the server is Python's own
# http.server.
#
# `cat_file(url, start=1000, end=1010)` reads a part of an object, and `cat_ranges` many parts, such
# as the chunks that the index of a log names. By the documentation, `start` and `end` limit the bytes
# as a slice does. They become a `Range` header, which a server is free to ignore: its answer is then
# 200 with the whole file instead of 206 with the part. fsspec returns that answer as if it were the
# part. It begins with the first byte of the file, so that what was asked for as a chunk in the middle
# is read as whatever stands at the beginning, and each part costs the transfer of the whole file.
# `open`, `seek` and `read` of the same file on the same server raise a ValueError that names the
# cause, and so does obstore's `get_range` with an error of its own; so a test of the server by
# `open` is no test of `cat_ranges`. A part that is longer than it should be is the only sign.
#
# Source: the bytes of both. The docstring of `AbstractFileSystem.cat_file`; `_cat_file` in
# fsspec/implementations/http.py reads the answer without a look at its status being 200 or 206. Issue
# 1140 of fsspec/filesystem_spec was the same of `open`, and its remedy (pull request 1141) stayed
# there. RFC 9110, section 14.2: "A server MAY ignore the Range header field."
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  fsspec==2026.9.0 aiohttp==3.14.5 obstore==0.12.1
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import sys
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from importlib.metadata import version
from pathlib import Path
from threading import Thread

import fsspec
import obstore
from obstore.store import HTTPStore

START, END = 1000, 1010
FILE = b"".join(number.to_bytes(4, "big") for number in range(25_000))


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


served = Path(sys.argv[1], "served")
served.mkdir()
(served / "log.mcap").write_bytes(FILE)
server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=served))
server.daemon_threads = True
Thread(target=server.serve_forever, daemon=True).start()
place = f"http://127.0.0.1:{server.server_port}"
url = f"{place}/log.mcap"

print("fsspec", version("fsspec"), "aiohttp", version("aiohttp"), "obstore", version("obstore"))
files = fsspec.filesystem("http")
part = files.cat_file(url, start=START, end=END)
print(f"cat_file of {END - START} bytes at {START}: {len(part)} bytes, which begin with {part[:4]}")
assert part == FILE
parts = files.cat_ranges([url, url], [START, 50_000], [END, 50_010])
print(f"cat_ranges of two such parts: {[len(part) for part in parts]} bytes")
assert parts == [FILE, FILE]


def opened():
    with files.open(url, block_size=1000) as file:
        file.seek(START)
        return file.read(END - START)


def by_obstore():
    store = HTTPStore(place, client_options={"allow_http": True})
    return obstore.get_range(store, "log.mcap", start=START, end=END)


for read, expected in ((opened, "ValueError"), (by_obstore, "NotSupportedError")):
    try:
        read()
    except Exception as error:
        told = str(error).splitlines()[0]
        print(f"{read.__name__}: {type(error).__name__}: {told}")
        assert type(error).__name__ == expected and "range request" in told.lower()
    else:
        raise AssertionError(f"{read.__name__} takes the answer")
PYTHON

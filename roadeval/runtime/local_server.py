"""A web server for the browsers of this machine's user alone.

It listens on 127.0.0.1, and answers only requests that know the token in its address. Requests from
pages of other origins are refused, also where such a page has a name of its own for 127.0.0.1 (DNS
rebinding). It serves no folder: all content comes from one function, so that no path of a request
is ever a path on the disk.

The standard library's server is enough for that: few requests, no bodies, one function.
"""

from __future__ import annotations

import hmac
import re
import secrets
import sys
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Final
from urllib.parse import urlsplit

from roadeval.runtime.text import debug, defect

HOST: Final = "127.0.0.1"
_SEGMENT: Final = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{,199}")
"""A part of a path: it begins with no dot, and has at most 200 letters."""
_HEADERS: Final = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    # With "no-referrer" a form's own origin would be hidden, too.
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin-allow-popups",
}
TEXT: Final = "text/plain; charset=utf-8"
PAGE: Final = "text/html; charset=utf-8"


@dataclass(frozen=True)
class Request:
    """What a browser asks for."""

    parts: tuple[str, ...]
    """Parts of the path below the token, without empty ones."""
    acts: bool
    """Whether something is to be done (POST), not only read."""
    folder: bool
    """Whether the path ends with a slash."""


@dataclass(frozen=True)
class Response:
    """An answer."""

    content: bytes
    media: str = TEXT
    status: HTTPStatus = HTTPStatus.OK
    headers: Mapping[str, str] = field(default_factory=dict)
    """Headers beside those of every answer."""


def told(status: HTTPStatus, sentence: str) -> Response:
    """Return a sentence as an answer."""
    return Response(f"{sentence}\n".encode(), status=status)


NOT_FOUND: Final = told(HTTPStatus.NOT_FOUND, "There is nothing at this address.")
_REFUSED: Final = told(
    HTTPStatus.FORBIDDEN, "Refused: open the address that the terminal shows, token included."
)


class LocalServer(ThreadingHTTPServer):
    """The server; several threads may call ``answer`` at once. An OSError if the port is taken.

    ``answer`` returns the response to a request; port 0 is any that is free.
    """

    daemon_threads = True

    def __init__(self, answer: Callable[[Request], Response], port: int = 0) -> None:
        self.answer: Final = answer
        self.token: Final = secrets.token_urlsafe(24)
        super().__init__((HOST, port), _Handler)

    @property
    def address(self) -> str:
        """The address to open, with the token."""
        return f"http://{HOST}:{self.server_port}/{self.token}/"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print the traceback of a failed connection, unless the browser has just left."""
        if not isinstance(sys.exception(), ConnectionError | TimeoutError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    """A request: each has a connection of its own, so no body is taken for the next one."""

    server_version = "roadeval"
    sys_version = ""
    timeout = 30
    server: LocalServer

    def do_GET(self) -> None:
        """Answer a request, or with the sentence on a defect of the program."""
        try:
            request = self._request()
            response = _REFUSED if request is None else self.server.answer(request)
        except Exception as error:
            if debug():
                traceback.print_exc()
            response = told(HTTPStatus.INTERNAL_SERVER_ERROR, defect(error))
        self._send(response)

    do_POST = do_GET  # noqa: N815 - so the base class calls it

    def log_message(self, *_: object) -> None:
        """Log nothing: the terminal is for people."""

    def _request(self) -> Request | None:
        """Return what the user, or a page of this server, asks for.

        None of what comes from anywhere else, or without the token.
        """
        acts = self.command == "POST"
        hosts = {f"{name}:{self.server.server_port}" for name in (HOST, "localhost")}
        host, origin = self.headers.get("Host"), self.headers.get("Origin")
        site = self.headers.get("Sec-Fetch-Site", "same-origin")
        if host not in hosts or site not in ("same-origin", "none"):
            return None
        if (acts or origin is not None) and origin != f"http://{host}":
            return None
        path = urlsplit(self.path).path
        _, token, *parts = path.split("/") if path.startswith("/") else ("", "")
        if not hmac.compare_digest(token.encode(), self.server.token.encode()):
            return None
        folder = parts[-1:] == [""]
        named = tuple(parts[:-1] if folder else parts)
        return Request(named, acts, folder) if all(map(_SEGMENT.fullmatch, named)) else None

    def _send(self, response: Response) -> None:
        self.send_response(response.status)
        sent = {
            **_HEADERS,
            "Content-Type": response.media,
            "Content-Length": str(len(response.content)),
            "Cache-Control": "no-store",
            **response.headers,
        }
        for name, value in sent.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(response.content)

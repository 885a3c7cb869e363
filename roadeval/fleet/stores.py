"""The store that a URL leads to, and in plain words why it cannot be read."""

from __future__ import annotations

import os
import re
from base64 import b64encode
from collections.abc import Callable, Mapping
from concurrent.futures import Future, wait
from dataclasses import dataclass
from datetime import timedelta
from http import HTTPStatus
from threading import Thread
from typing import Any, Final, TypeVar
from urllib.parse import unquote, urlsplit, urlunsplit

from roadeval.fleet.errors import FleetError
from roadeval.fleet.urls import bucket_and_key, scheme_of, shown

TIMES: Final[dict[str, str]] = {"connect_timeout": "10s", "read_timeout": "30s", "timeout": "1d"}
"""Until a connection stands, until the next bytes come, and until the last one has come."""
PATIENCE_S: Final = 0.2
"""Between two looks whether an answer has come."""
RETRIES: Final[dict[str, Any]] = {"max_retries": 4, "retry_timeout": timedelta(minutes=2)}

_OPTIONS: Final = (
    *("allow_http", "allow_invalid_certificates", "connect_timeout", "proxy_url", "read_timeout"),
    *("proxy_ca_certificate", "proxy_excludes", "timeout", "user_agent"),
)
"""What the environment may say of connections, as AWS_PROXY_URL: obstore reads that only where
nothing else is said of them."""
Answer = TypeVar("Answer")

_PREFIXES: Final[Mapping[str, str]] = {"s3": "AWS_", "gs": "GOOGLE_"}

_STATUS: Final = re.compile(r"non-2xx status code: (\d{3})")
_METADATA: Final = re.compile(r"169\.254\.169\.254|metadata\.google\.internal")
"""Where obstore asks for credentials if it has none."""
_WORDS: Final = (
    (r"dns error", "no host of this name is known"),
    (r"ConnectionRefused|kind: Connect\b", "the host cannot be reached"),
    (r"BadScheme", "the endpoint is without TLS, which only AWS_ALLOW_HTTP=true allows"),
    (r"TimedOut|kind: Timeout|timed out", "the server stopped answering"),
    (r"RangeNotSupported", "ended early, and the server cannot go on from there"),
    (r"Content-Length", "the server does not tell its length"),
    (r"Precondition", "it changed while it was read"),
    (r"kind: (Body|Decode|Interrupted)|IncompleteMessage|UnexpectedEof", "ended early"),
)
_STATUSES: Final[Mapping[int, str]] = {
    401: "the server asks who you are",
    403: "the server denies access",
    404: "there is no such file",
}


@dataclass(frozen=True, slots=True)
class Place:
    """Where an object lies: its store, its key there, and the URL of the store's own root."""

    url: str
    store: Any
    key: str
    root: str


def place_of(url: str) -> Place:
    """Open the store that a URL leads to; nothing is asked of it yet.

    Raises
    ------
    FleetError
        If the URL cannot be one, or obstore is not installed.
    """
    scheme = scheme_of(url)
    try:
        from obstore import store as stores
    except ImportError as error:
        raise FleetError(
            f"{shown(url)}: URLs are read by obstore: pip install 'roadeval[remote]'"
        ) from error
    if scheme in _PREFIXES:
        bucket, key = bucket_and_key(url)
        of_buckets = stores.S3Store if scheme == "s3" else stores.GCSStore
        options = _options(scheme)
        store = ask(url, of_buckets, bucket, client_options=options, retry_config=RETRIES)
        return Place(url, store, key, f"{scheme}://{bucket}/")
    plain, headers = _without_user(url)
    options = {**TIMES, "allow_http": scheme == "http", **headers}
    store = ask(url, stores.HTTPStore, plain, client_options=options, retry_config=RETRIES)
    return Place(url, store, "", "")


def is_open(place: Place) -> bool:
    """Return whether an object comes from S3 without TLS, which would tell of changed bytes."""
    scheme = scheme_of(place.url)
    return scheme == "s3" and _options(scheme).get("allow_http", "").lower() in ("1", "true")


def _options(scheme: str) -> dict[str, Any]:
    prefix = _PREFIXES[scheme]
    said = {option: os.environ.get(f"{prefix}{option.upper()}") for option in _OPTIONS}
    return {**TIMES, **{option: value for option, value in said.items() if value}}


def _without_user(url: str) -> tuple[str, dict[str, Any]]:
    """Return a URL without user and password, and the header that tells them."""
    parts = urlsplit(url)
    user, at, host = parts.netloc.rpartition("@")
    plain = urlunsplit((parts.scheme, host, parts.path, parts.query, ""))
    if not at:
        return plain, {}
    basic = b64encode(unquote(user).encode()).decode()
    return plain, {"default_headers": {"authorization": f"Basic {basic}"}}


def ask(url: str, function: Callable[..., Answer], *arguments: Any, **options: Any) -> Answer:
    """Call a function of obstore; whatever it raises becomes one line without a URL's secrets.

    It runs in a thread of its own, for obstore does not notice Ctrl-C while it waits for a server.
    """
    answer: Future[Answer] = Future()

    def call() -> None:
        try:
            answer.set_result(function(*arguments, **options))
        except BaseException as error:
            answer.set_exception(error)

    Thread(target=call, name="roadeval-url", daemon=True).start()
    # In pieces: a signal that another thread receives does not end one long wait.
    while not wait([answer], PATIENCE_S).done:
        pass
    try:
        return answer.result()
    except Exception as error:
        raise FleetError(f"{shown(url)}: {_reason(error)}") from None


def _reason(error: Exception) -> str:
    text = str(error)
    if _METADATA.search(text):
        return (
            "no credentials: the environment has them, as AWS_ACCESS_KEY_ID and "
            "AWS_SECRET_ACCESS_KEY; AWS_SKIP_SIGNATURE=true reads a public bucket"
        )
    if match := _STATUS.search(text):
        status = int(match[1])
        known = {each.value: each.phrase for each in HTTPStatus}
        words = _STATUSES.get(status, "the server cannot give it")
        return f"{words} ({status} {known.get(status, '')})"
    for pattern, words in _WORDS:
        if re.search(pattern, text):
            return words
    return f"cannot be read ({type(error).__name__})"

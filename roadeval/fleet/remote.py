"""Drives and results in object stores and on web servers, which are checked for changes.

obstore reads them. For ``s3://`` and ``gs://`` it takes credentials, endpoint and region from the
environment, as ``AWS_ACCESS_KEY_ID``, ``AWS_ENDPOINT_URL``, ``AWS_ALLOW_HTTP`` for an endpoint
without TLS, ``AWS_SKIP_SIGNATURE`` for a public bucket, ``GOOGLE_SERVICE_ACCOUNT``. Signed URLs
and ``user:password@`` work for ``https://``. A stream that breaks is continued.

fsspec, which Dask installs, reads none of these by itself. Each of its stores needs a package and
an SDK, and does not continue a stream.
"""

from __future__ import annotations

import os
import re
import shutil
import zlib
from base64 import b64encode
from collections.abc import Callable, Iterable
from concurrent.futures import Future, wait
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import cache, partial
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp
from typing import IO, TYPE_CHECKING, Any, Final, NamedTuple, Self, TypeVar, cast
from urllib.parse import unquote, urlsplit, urlunsplit
from zipfile import BadZipFile, ZipFile, is_zipfile

from roadeval.fleet.drives import (
    BUCKETS,
    FleetError,
    bucket_and_key,
    is_url,
    last_part,
    public_source,
    scheme_of,
)
from roadeval.logs.container.records import FarFile
from roadeval.logs.log import RemoteLog, Traffic
from roadeval.results.facts import FETCHED, FLEET, SUMMARY
from roadeval.runtime.threads import in_thread

if TYPE_CHECKING:
    from obstore import ObjectMeta

Answer = TypeVar("Answer")

PATIENCE_S: Final = 20.0
"""Seconds that a server may be silent, see `roadeval.config.settings.ExecutionSettings`."""
RETRIES: Final[dict[str, Any]] = {"max_retries": 4}
PART: Final = 64 << 10
"""Least number of bytes of an unexpected part; parts that are closer than this are read as one."""
TAIL: Final = 128 << 10
"""Bytes at the end that are read in one request: the summary of a log of one gigabyte."""
AT_ONCE: Final = 16
"""Number of parts that are read ahead; as many parts are kept after they were read."""
PIECE: Final = 1 << 20
"""Most bytes of a part that is read ahead or kept."""
ROOM: Final = 2 << 30
"""Greatest number of bytes of a result that are fetched, and that are unpacked."""
TOO_LARGE: Final = f"larger than {ROOM >> 30} GiB"
_home: Final = cache(partial(TemporaryDirectory, prefix="roadeval-"))  # kept until the end
_POLL_S: Final = 0.2
"""Seconds between two checks for an answer."""
NO_PARTS: Final = "ended early, and the server cannot continue it"
CHANGED: Final = "it changed while it was read"
SILENT: Final = "the server stopped answering"
_REASONS: Final = (
    (r"169\.254\.169\.254|metadata\.google\.internal", "no credentials in the environment"),
    (r"NotFound\b|status code: 404", "there is no such file"),
    (r"PermissionDenied|status code: 403", "the server denies access"),
    (r"Unauthenticated|status code: 401", "the server asks who you are"),
    (r"Precondition", CHANGED),
    (r"non-2xx status code: (\d+)", "the server cannot give it"),
    (r"dns error", "no host of this name is known"),
    (r"ConnectionRefused|kind: Connect\b", "the host cannot be reached"),
    (r"BadScheme", "the endpoint is without TLS, which only AWS_ALLOW_HTTP=true allows"),
    (r"TimedOut|kind: Timeout|timed out", SILENT),
    (r"RangeNotSupported", NO_PARTS),
    (r"Content-Length", "the server does not state its length"),
)
"""Patterns of obstore's errors and messages, and their meaning; the first that matches counts."""


def open_source(drive: str | PathLike[str], patience_s: float = PATIENCE_S) -> Path | RemoteLog:
    """Return the path of a drive, or the file behind its URL, for `roadeval.logs.log.open_log`.

    Only the needed parts of the file are read. A `FleetError` if the URL cannot be used, nothing
    can be read there, or the server is silent for ``patience_s`` seconds.
    """
    source = os.fspath(drive)
    if not is_url(source):
        return Path(source)
    name, place = Path(file_name(source)), _open_store(source, patience_s)
    file = cast("IO[bytes]", _RemoteFile(place, _state_of(place)))
    return RemoteLog(public_source(source), name, file, place.traffic)


@cache
def fetch_result(url: str) -> Path:
    """Fetch the whole recording, or zip of a result, behind a URL, and return its path.

    A `FleetError` if it cannot be fetched or unpacked, or has more than `ROOM` bytes.
    """
    if is_url(url) and url.endswith("/"):
        remedy = "name a recording, or a zip"
        raise FleetError("a folder is not fetched", where=public_source(url), remedy=remedy)
    remote = open_source(url)
    if isinstance(remote, Path):
        return remote
    path = Path(mkdtemp(dir=_home().name), remote.path)
    try:
        if remote.file.seek(0, os.SEEK_END) > ROOM:
            raise ValueError(TOO_LARGE)
        remote.file.seek(0)
        with path.open("wb") as file:
            shutil.copyfileobj(remote.file, file, 8 << 20)
        if is_zipfile(path):
            with ZipFile(path) as archive:  # a file takes at least a block
                if sum(entry.file_size + 4096 for entry in archive.infolist()) > ROOM:
                    raise ValueError(TOO_LARGE)
                archive.extractall(unpacked := path.parent / "unpacked" / path.stem)
            kinds = ([*unpacked.rglob(name)] for name in (FLEET, SUMMARY, "*.rrd"))
            files = next(filter(None, kinds), [])
            if len(files) != 1:
                raise ValueError(f"it holds {len(files) or 'no'} results")
            path = files[0] if files[0].suffix == ".rrd" else files[0].parent
    except (OSError, ValueError, RuntimeError, EOFError, BadZipFile, zlib.error) as error:
        raise FleetError(f"cannot be used: {error}", where=remote.source) from error
    FETCHED[path] = remote.source
    return path


def file_name(url: str) -> str:
    """Return the name in a URL, with ``_`` for letters that some system does not allow."""
    name = re.sub(r'[\x00-\x1f\x7f/\\:*?"<>|]', "_", last_part(url))
    return name if name.strip(".") else "drive"


class _FileState(NamedTuple):
    """The state of a file, which changes with its content."""

    size: int
    tag: str | None
    modified: datetime

    @classmethod
    def of(cls, meta: ObjectMeta) -> Self:
        return cls(meta["size"], meta["e_tag"], meta["last_modified"])

    def differs(self, other: Self) -> bool:
        """Return whether size, tag or time differ; only values that both state are compared."""
        # A server that compresses weakens a tag. If a server states no time, obstore returns 1970.
        one, two = ((tag or "").removeprefix("W/") for tag in (self.tag, other.tag))
        times = self.modified, other.modified
        is_later = times[0] != times[1] and all(time.timestamp() > 0 for time in times)
        return self.size != other.size or (one != two and "" not in (one, two)) or is_later


_Answer = tuple[_FileState, bytearray, str]
"""The state of the file, the bytes that a server sent, and how it compressed them, if it did."""


@dataclass(slots=True)
class _Part:
    """Bytes of a file, and the server's answer if it was asked for them."""

    begin: int
    end: int
    answer: Future[_Answer] | None = None


class _RemoteFile(FarFile):
    """A file elsewhere that is read in parts; a `FleetError` if it changes meanwhile."""

    def __init__(self, place: _Place, state: _FileState) -> None:
        self._place, self._state, self._size, self._at = place, state, state.size, 0
        tag = state.tag
        self._options = {"if_match": tag} if tag and not tag.startswith("W/") else {}
        place.traffic.total = self._size
        self._parts: list[_Part] = []
        """Parts that were read or skipped, and after them the expected parts."""
        self._next = 0
        """The position of the first expected part."""

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        self._at = offset + (self._size if whence == os.SEEK_END else 0)
        return self._at

    def read(self, size: int) -> bytes:
        """Read at most ``size`` bytes; a `FleetError` if the server sends too few or too many."""
        begin, end, content = self._at, min(self._at + size, self._size), bytearray()
        self._at = max(begin, end)
        while begin < end:
            part = self._part(begin, end)
            content += self._content(part)[begin - part.begin : end - part.begin]
            begin = part.end
        return bytes(content)

    def expect(self, parts: Iterable[tuple[int, int]]) -> None:
        """Ask for the first missing parts; join near ones to one, and divide large ones."""
        asked, expected = [part for part in self._parts if part.answer], list[_Part]()
        held = sorted((part.begin, part.end) for part in asked)
        for begin, stop in dict.fromkeys(parts):
            end, held_until = min(stop, self._size), begin
            for first, last in held:
                held_until = last if first <= held_until < last else held_until
            if held_until >= end:
                continue
            before = expected[-1] if expected else _Part(end, end)
            if before.begin <= begin <= before.end + PART and end <= before.begin + PIECE:
                before.end = max(before.end, end)
            else:
                expected += [_Part(at, min(at + PIECE, end)) for at in range(begin, end, PIECE)]
        self._parts, self._next = asked + expected, len(asked)
        self._read_ahead()

    def _read_ahead(self) -> None:
        """Forget parts that were passed long ago, and ask for parts that are expected soon."""
        del self._parts[: max(self._next - AT_ONCE, 0)]
        self._next = min(self._next, AT_ONCE)
        for part in self._parts[: self._next + AT_ONCE]:
            self._ask_for(part)

    def _part(self, begin: int, end: int) -> _Part:
        """Return a part that holds the byte at ``begin``, and perhaps all bytes up to ``end``."""
        place = next((n for n, p in enumerate(self._parts) if p.begin <= begin < p.end), -1)
        if 0 <= place < self._next + AT_ONCE:
            part = self._parts[place]
            self._next = max(self._next, place + 1)
        else:
            # The end of the file, and one byte more, is read at once: a chunk's last byte is read
            # alone.
            first, last = min(begin, max(self._size - TAIL, 0)), max(end + 1, begin + PART)
            part = self._parts.pop(place) if place >= 0 else _Part(first, min(last, self._size))
            if part.end - part.begin <= PIECE:
                self._parts.insert(self._next, part)
                self._next += 1
        self._read_ahead()
        return part

    def _ask_for(self, part: _Part) -> Future[_Answer]:
        if part.answer is None:
            self._place.traffic.requests += 1
            self._place.traffic.bytes += part.end - part.begin
            part.answer = in_thread(partial(self._fetch, part.begin, part.end))
        return part.answer

    def _fetch(self, begin: int, end: int) -> _Answer:
        import obstore

        options = {"range": (begin, end), **self._options}
        answer = obstore.get(self._place.store, self._place.key, options=options)
        content = bytearray()
        for piece in answer.stream(min_chunk_size=1 << 20):
            content += piece
            if len(content) > end - begin:  # the stream may never end
                break
        return _FileState.of(answer.meta), content, answer.attributes.get("Content-Encoding", "")

    def _content(self, part: _Part) -> bytearray:
        """Wait for a part, and return its bytes."""
        where = public_source(self._place.url)
        try:
            state, content, packed = _wait_for(self._place.url, self._ask_for(part))
        except FleetError as error:
            if error.problem != NO_PARTS:
                raise
            problem = "the server gives no parts of files"
            raise FleetError(problem, where=where, remedy="copy the file here") from None
        if packed and (state.size, len(content)) != (self._size, part.end - part.begin):
            problem = f"the server compresses it with {packed}, unasked"
            raise FleetError(problem, where=where, remedy="copy the file here")
        if state.differs(self._state):
            raise FleetError(CHANGED, where=where)
        if len(content) != part.end - part.begin:
            is_short = len(content) < part.end - part.begin
            problem = "ended early" if is_short else "the server sends too much"
            raise FleetError(problem, where=where)
        return content

    def close(self) -> None:
        # A thread in the midst of an answer may outlive the interpreter.
        wait([part.answer for part in self._parts if part.answer], _POLL_S)
        self._parts, self._next = [], 0


def stamp(url: str, patience_s: float = PATIENCE_S) -> tuple[int, str | None]:
    """Return size and tag of the file behind a URL, to notice that it has changed.

    The tag is None if the server states none. A `FleetError` if the file is not there, or the
    server does not answer.
    """
    return _state_of(_open_store(url, patience_s))[:2]


class _Place(NamedTuple):
    """The place of an object: its store, and its key there."""

    url: str
    store: Any
    traffic: Traffic
    key: str = ""


def _state_of(place: _Place) -> _FileState:
    import obstore

    place.traffic.requests += 1
    try:
        return _FileState.of(_ask(place.url, obstore.head, place.store, place.key))
    except FleetError as error:  # a signed URL may allow nothing but reading
        if error.problem == SILENT:
            raise
        place.traffic.requests += 1
        return _FileState.of(_ask(place.url, obstore.get, place.store, place.key).meta)


def _open_store(url: str, patience_s: float) -> _Place:
    """Open the store that a URL leads to, without a request.

    A `FleetError` if the URL is none, or obstore is not installed.
    """
    scheme = scheme_of(url)
    try:
        from obstore import store as stores
    except ImportError as error:
        remedy = "pip install 'roadeval[remote]'"
        raise FleetError(
            "URLs are read by obstore", where=public_source(url), remedy=remedy
        ) from error
    # The limits for connecting, for the next bytes, for the whole answer, and for trying again.
    pause = timedelta(seconds=patience_s / 2)
    # Without this header a server may compress what it sends.
    headers = {"accept-encoding": "identity"}
    times = {"connect_timeout": pause, "read_timeout": pause, "timeout": timedelta(days=1)}
    retries = {**RETRIES, "retry_timeout": pause}
    if scheme in BUCKETS:
        bucket, key = bucket_and_key(url)
        kind = stores.S3Store if scheme == "s3" else stores.GCSStore
        # obstore ignores this variable if any option is given.
        allow_http = os.environ.get("AWS_ALLOW_HTTP", "false")
        allowed = {**times, "default_headers": headers, "allow_http": allow_http}
        store = _ask(url, kind, bucket, client_options=allowed, retry_config=retries)
        return _Place(url, store, Traffic(), key)
    parts = urlsplit(url)
    user, at, host = parts.netloc.rpartition("@")
    plain = urlunsplit((parts.scheme, host, parts.path, parts.query, ""))
    options = {**times, "default_headers": headers, "allow_http": scheme == "http"}
    if at:
        basic = b64encode(unquote(user).encode()).decode()
        headers["authorization"] = f"Basic {basic}"
    store = _ask(url, stores.HTTPStore, plain, client_options=options, retry_config=retries)
    return _Place(url, store, Traffic())


def _ask(url: str, function: Callable[..., Answer], *arguments: Any, **options: Any) -> Answer:
    """Call a function of obstore; an error becomes one line without the secrets of the URL.

    It runs in its own thread, as obstore does not notice Ctrl-C while it waits for a server.
    """
    return _wait_for(url, in_thread(lambda: function(*arguments, **options)))


def _wait_for(url: str, answer: Future[Answer]) -> Answer:
    """Wait for the answer of a thread; its errors are the errors of `_ask`."""
    # The wait is divided, as a signal that another thread receives does not end one long wait.
    while not wait([answer], _POLL_S).done:
        pass
    try:
        return answer.result()
    except Exception as error:
        kind = type(error).__name__
        reasons = (reason for pattern, reason in _REASONS if re.search(pattern, f"{kind} {error}"))
        reason = next(reasons, f"cannot be read ({kind})")
        raise FleetError(reason, where=public_source(url)) from None

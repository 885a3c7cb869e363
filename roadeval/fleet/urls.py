"""URLs: their parts, and how one is shown without its secrets."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final
from urllib.parse import unquote, urlsplit
from urllib.request import url2pathname

from roadeval.errors import RoadevalError
from roadeval.runtime.text import public_url, visible, without_secrets

BUCKETS: Final = ("s3", "gs")
"""Schemes of stores that keep objects in buckets, and can list them."""
SCHEMES: Final = (*BUCKETS, "https", "http", "file")

_URL: Final = re.compile(r"([A-Za-z][A-Za-z0-9+.-]*)://")


class FleetError(RoadevalError):
    """Drives that cannot be found or fetched, or a manifest that cannot be used."""


def is_url(source: str) -> bool:
    """Return whether a drive's source is a URL, and no path."""
    return _URL.match(source) is not None


def scheme_of(url: str) -> str:
    """Return the scheme of a URL; a `FleetError` if it is none of `SCHEMES`, or has no host."""
    match = _URL.match(url)
    scheme = match[1].lower() if match else ""
    if scheme not in SCHEMES:
        known = ", ".join(f"{each}://" for each in SCHEMES)
        raise FleetError(f"{shown(url)}: no scheme that is known; choose {known}")
    if scheme in ("https", "http"):
        try:
            parts = urlsplit(url)
            whole = bool(parts.hostname) and parts.port != 0
        except ValueError:
            whole = False
        if not whole:
            raise FleetError(
                f"{shown(url)}: no host in it; in a user's name or password write / ? # @ as "
                "%2F %3F %23 %40"
            )
    return scheme


def shown(source: str) -> str:
    """Return a drive's source as it may be shown: a URL without user, password and query.

    >>> shown("https://me:secret@host/a.mcap?X-Amz-Signature=5d1c")
    'https://host/a.mcap'
    """
    return visible(public_url(source) if is_url(source) else without_secrets(source))


def file_of(url: str) -> Path:
    """Return the path of a ``file://`` URL; a `FleetError` if it names another machine."""
    parts = urlsplit(url)
    if parts.netloc not in ("", "localhost"):
        raise FleetError(f"{shown(url)}: a file of another machine; write file:///PATH")
    return Path(url2pathname(parts.path))


def bucket_and_key(url: str) -> tuple[str, str]:
    """Split the URL of an object, or of a folder in a bucket.

    Nothing in the key is encoded: ``%``, ``?`` and ``#`` are letters.
    """
    bucket, _, key = url.partition("://")[2].partition("/")
    if "@" in bucket:
        raise FleetError(f"{shown(url)}: credentials are read from the environment, not from a URL")
    if not bucket:
        raise FleetError(f"{shown(url)}: no bucket in it")
    return bucket, key


def last_part(url: str) -> str:
    """Return the name of the file, folder or bucket that a URL leads to; empty if it has none."""
    if scheme_of(url) in BUCKETS:
        bucket, key = bucket_and_key(url)
        return key.rstrip("/").rpartition("/")[2] or bucket
    name = unquote(urlsplit(url).path.rstrip("/").rpartition("/")[2])
    return name.rpartition("/")[2]

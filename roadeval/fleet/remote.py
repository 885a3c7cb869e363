"""Drives in object stores and on web servers: listed, copied to this machine, told apart.

obstore reads them. For ``s3://`` and ``gs://`` it takes credentials, endpoint and region from the
environment, as ``AWS_ACCESS_KEY_ID``, ``AWS_ENDPOINT_URL``, ``AWS_ALLOW_HTTP`` for an endpoint
without TLS, ``AWS_SKIP_SIGNATURE`` for a public bucket, ``GOOGLE_SERVICE_ACCOUNT``. Signed URLs
and ``user:password@`` work for ``https://``. A stream that breaks goes on where it broke.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from hashlib import md5
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any, Final

from roadeval.fleet.entry import HEAD, in_order, is_heading, is_log
from roadeval.fleet.errors import FleetError
from roadeval.fleet.stores import Place, ask, is_open, place_of
from roadeval.fleet.urls import BUCKETS, file_of, is_url, last_part, scheme_of, shown
from roadeval.logs import METADATA

_BLOCK: Final = 4 << 20
"""Bytes that are in memory at once."""
_MIB: Final = 1 << 20
_NAME: Final = 100
"""Letters of a name that a copy keeps."""


@contextmanager
def staged(source: str, folder: Path | None = None) -> Iterator[Path]:
    """Yield a drive as a file or folder of this machine.

    That is a path itself; what a URL leads to is copied into a folder of its own, which is removed
    when the block ends, whatever ends it.

    Parameters
    ----------
    source
        A path or a URL. One that ends in ``/`` is a rosbag2 folder.
    folder
        Where copies are made; in the system's folder of temporary files by default.

    Raises
    ------
    FleetError
        If it cannot be read, its copy is not whole, or the disk is full.
    """
    here = _local(source)
    if here is not None:
        yield here
        return
    try:
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
        stage = TemporaryDirectory(prefix="roadeval-", dir=folder, ignore_cleanup_errors=True)
    except OSError as error:
        raise FleetError(_no_copy(source, error)) from error
    with stage as name:
        try:
            copy = _copy(source, Path(name))
        except OSError as error:
            raise FleetError(_no_copy(source, error)) from error
        yield copy


def stamp(url: str) -> Mapping[str, Mapping[str, Any]]:
    """Return what tells at little cost whether a drive behind a URL has changed, by file.

    Plain data: ``size``, ``etag`` and ``last_modified``, the last two None where the server does
    not tell them.

    Raises
    ------
    FleetError
        If it is not there, or cannot be asked.
    """
    return {_file_name(each): _facts(place_of(each)) for each in _files(url)}


def drives_below(url: str) -> list[str]:
    """Return the URLs of the logs and rosbag2 folders below a folder's, in natural order.

    Raises
    ------
    FleetError
        If it holds none, or cannot be listed; no web server's can.
    """
    place = _listable(url)
    keys = [PurePosixPath(key) for key in _keys(place)]
    below = len(PurePosixPath(place.key).parts)
    bags = {key.parent for key in keys if key.name == METADATA and _heads_a_bag(place, key)}
    logs = {
        key
        for key in keys
        if key.parent not in bags and all(map(_seen, key.parts[below:-1])) and is_log(key.name)
    }
    if not bags | logs:
        raise FleetError(f"{shown(url)}: no log there or below")
    ends = {folder: "/" if folder.parts else "" for folder in bags}
    found = sorted(bags | logs, key=in_order)
    return [f"{place.root}{'/'.join(key.parts)}{ends.get(key, '')}" for key in found]


def _seen(folder: str) -> bool:
    return not folder.startswith(".")


def _local(source: str) -> Path | None:
    if not is_url(source):
        return Path(source)
    return file_of(source) if scheme_of(source) == "file" else None


def _listable(url: str) -> Place:
    if scheme_of(url) not in BUCKETS:
        raise FleetError(
            f"{shown(url)}: a web server does not list its folders; name the files, or a manifest "
            "of them"
        )
    return place_of(url)


def _keys(place: Place) -> list[str]:
    import obstore

    prefix = place.key.rstrip("/")
    listing = obstore.list(place.store, prefix or None)
    return [each["path"] for each in ask(place.url, listing.collect)]


def _heads_a_bag(place: Place, key: PurePosixPath) -> bool:
    import obstore

    result = ask(place.url, obstore.get, place.store, str(key))
    return is_heading(bytes(ask(place.url, next, iter(result.stream(HEAD)), b""))[:HEAD])


def _files(url: str) -> list[str]:
    """Return the URLs of a drive's files: its own, or of a rosbag2 folder those in it."""
    if not url.endswith("/"):
        return [url]
    place = _listable(url)
    folder = PurePosixPath(place.key)
    keys = [PurePosixPath(key) for key in _keys(place)]
    files = [key for key in keys if key.parent == folder and is_log(key.name)]
    if not files:
        raise FleetError(f"{shown(url)}: a folder without *.mcap files")
    return [f"{place.root}{key}" for key in sorted(files, key=in_order)]


def _copy(url: str, stage: Path) -> Path:
    target = stage / _file_name(url)
    if not url.endswith("/"):
        _copy_file(url, target)
        return target
    target.mkdir()
    for file in _files(url):
        _copy_file(file, target / _file_name(file))
    return target


def _copy_file(url: str, target: Path) -> None:
    place = place_of(url)
    etag, digest = _read(place, target)
    told = etag.strip('"')
    checked = is_open(place) and re.fullmatch("[0-9a-f]{32}", told) and told != digest
    # The tag of an S3 object is its MD5, unless the store encrypts: then the same bytes come again.
    if checked and digest != (again := _read(place, target)[1]) and told != again:
        raise FleetError(f"{shown(url)}: its bytes arrive changed; the network or the store fails")


def _read(place: Place, target: Path) -> tuple[str, str]:
    """Read an object into a file as one stream; return its tag, and the MD5 of what arrived."""
    import obstore

    digest, arrived = md5(usedforsecurity=False), 0
    result = ask(place.url, obstore.get, place.store, place.key)
    size = result.meta["size"]
    free = shutil.disk_usage(target.parent).free
    if size > free:
        raise FleetError(
            f"{shown(place.url)}: no copy of its {size // _MIB} MiB fits in {target.parent}, where "
            f"{free // _MIB} MiB are free; TMPDIR names another folder"
        )
    blocks = iter(result.stream(_BLOCK))
    with target.open("wb") as file:
        while block := ask(place.url, next, blocks, b""):
            file.write(block)
            digest.update(block)
            arrived += len(block)
    if arrived != size:
        raise FleetError(f"{shown(place.url)}: ended early, after {arrived} of {size} bytes")
    return result.meta["e_tag"] or "", digest.hexdigest()


def _facts(place: Place) -> dict[str, Any]:
    import obstore

    try:
        meta = ask(place.url, obstore.head, place.store, place.key)
    except FleetError:  # a signed URL may be good for reading alone
        meta = ask(place.url, obstore.get, place.store, place.key).meta
    known = meta["last_modified"].timestamp() > 0
    modified = meta["last_modified"].isoformat() if known else None
    return {"size": meta["size"], "etag": meta["e_tag"], "last_modified": modified}


def _file_name(url: str) -> str:
    """Return the name of a copy: as in the URL, as far as every system allows it."""
    name = re.sub(r'[\x00-\x1f\x7f/\\:*?"<>|]', "_", last_part(url))
    stem, dot, suffix = name.rpartition(".")
    short = f"{stem[:_NAME]}{dot}{suffix[:_NAME]}" if stem else name[:_NAME]
    return short if short.strip(".") else "drive"


def _no_copy(url: str, error: OSError) -> str:
    at = f" {error.filename}" if error.filename else ""
    return f"{shown(url)}: cannot be copied to this machine:{at}: {error.strerror or error}"

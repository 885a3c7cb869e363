"""The files of a log, the kinds of files that are not a log, and folders of image files."""

from __future__ import annotations

import re
import shlex
import unicodedata
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from itertools import takewhile
from pathlib import Path
from typing import IO, Final

from roadeval.logs.container.file import Damage
from roadeval.logs.container.records import MAGIC
from roadeval.logs.errors import LogError
from roadeval.logs.settings import NS
from roadeval.runtime.files import check_input, reading
from roadeval.runtime.text import visible

_HEAD: Final = 64
"""Bytes by which a file is recognised."""
_RECORD: Final = re.compile(rb"[\x01\x06].{4}\0{4}", re.DOTALL)
"""The head of a log's first record or of a chunk, in an MCAP file that lacks its first bytes."""

METADATA: Final = "metadata.yaml"
"""The file in which rosbag2 describes the files beside it."""
# rosbag2 writes the list in one form. A parser of YAML would crash the process on some files.
_LIST: Final = re.compile(r"^ *relative_file_paths:[ \r]*\n((?: *- .*\n?)+)", re.MULTILINE)
_ITEM: Final = re.compile(r"^ *-(.*)$", re.MULTILINE)

_NUMBERED: Final = (
    (re.compile(r"(?P<name>.*)_(?P<number>\d{1,9})\.mcap"), "{name}_{number}.mcap"),
    (
        re.compile(r"(?P<number>\d{1,9})_(?P<name>.+)_\d{4}_\d\d_\d\d-\d\d_\d\d_\d\d\.mcap"),
        "{number}_{name}_*.mcap",
    ),
)
"""Names that rosbag2 gives the files of a log; newer versions add the time of their beginning."""

_OTHERS: Final = (
    (0, b"#ROSBAG V", "a ROS 1 bag: mcap convert {path} {stem}.mcap"),
    (0, b"SQLite format 3\0", "a rosbag2 SQLite file: mcap convert {path} {stem}.mcap"),
    (0, b"version https://git-lfs", "a pointer to a file in Git LFS: git lfs pull"),
    (0, b"\x28\xb5\x2f\xfd", "compressed as a whole by zstd: zstd -d {path} -o {stem}.mcap"),
    (0, b"\x1f\x8b", "compressed as a whole by gzip: gunzip -c {path} > {stem}.mcap"),
    (0, b"PK\x03\x04", "a ZIP archive: unzip {path}"),
    (0, b"RRF2", "a Rerun recording: roadeval report {path}"),
    (0, b"\xff\xd8\xff", "a JPEG image: roadeval pack makes a log of a folder of images"),
    (0, b"\x89PNG\r\n", "a PNG image: roadeval pack makes a log of a folder of images"),
    (4, b"ftyp", "a video: roadeval pack {path} -o {stem}.mcap"),
)
"""How many bytes to skip, the bytes that follow, the kind of file and how it becomes a log."""

IMAGES: Final = frozenset(
    {".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp", ".ppm", ".pgm"}
)
"""Endings of image files, in lower case."""
_SUFFIX: Final = re.compile(
    r"_(leftImg8bit|gt(Fine|Coarse)_\w+|(drivable|train)_id)$"
    r"|[_.-]?(labelids|labels?|masks?|gt|truth|road|seg|segmentation|annotations?|L)$"
)
"""Endings that data sets add to the name that an image and its label share."""
_KITTI: Final = re.compile(r"^(uu|umm?)_(road|lane)_(?=\d)")
_HASH: Final = r"(?P<hash>[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}|[0-9a-f]{8,64})"
_HASHED: Final = (
    re.compile(rf"{_HASH}[-_.](?P<name>.+)"),
    re.compile(rf"(?P<name>.+?)(?:_[a-z]+[-_.]rf)?[-_.]{_HASH}"),
)
"""Names with a hash: Label Studio puts it before the name, Roboflow behind it."""
NUMBER: Final = "{number}"
"""Stands for the frame's number in a pattern of names."""
_TIME: Final = re.compile(r"(\d{10})(?:[._](\d{1,9}))?|(\d{13})|(\d{16})|(\d{19})")
_TIME_WITHIN: Final = re.compile(
    rf"(?P<before>.*?)(?<!\d)(?P<time>{_TIME.pattern})(?!\d)(?P<after>.*)", re.DOTALL
)


def files_of(path: Path) -> tuple[list[Path], list[Damage]]:
    """List the MCAP files of a log: the file itself, or a rosbag2 folder's files in natural order.

    Files of a folder that are not MCAP files, or are missing, are returned as damage. A file is
    missing if the folder's `METADATA` lists it, or if the others' numbers, from 0, have a gap. A
    `LogError` if there is no MCAP file; it names the files there, and how to convert them.
    """
    if not path.is_dir():
        if problem := _problem(path):
            raise LogError(problem, where=path)
        return [path], []
    with reading(path, LogError):
        inside = sorted(filter(is_shown, path.iterdir()), key=natural)
    there = [file for file in inside if file.suffix == ".mcap"]
    problems = {file: problem for file in there if (problem := _problem(file))}
    damage = [Damage(file, 0, problem) for file, problem in problems.items()]
    files = [file for file in there if file not in problems]
    if not files:
        raise LogError(str(damage[0]) if damage else _describe_folder(path), where=path)
    lacking = sorted(_expected_files(path, there) - {*there}, key=natural)
    unnamed = "the file is not called *.mcap"
    return files, [*damage, *(Damage(file, 0, _problem(file) or unnamed) for file in lacking)]


def _expected_files(folder: Path, there: Sequence[Path]) -> set[Path]:
    """Return the files of a log by the numbers in their names, and by the recorder's `METADATA`.

    A list without any file that is ``there`` describes another log, and is left out.
    """
    expected = set[Path]()
    for pattern, name_of in _NUMBERED:  # NAME_0.mcap, NAME_1.mcap and so on
        matches = [match for file in there if (match := pattern.fullmatch(file.name))]
        numbers = {int(match["number"]) for match in matches}
        log_names = {match["name"] for match in matches}
        is_numbered = len(log_names) == 1 and len(matches) == len(there) and 0 in numbers
        if is_numbered and max(numbers) < 2 * len(there):
            for number in {*range(max(numbers))} - numbers:
                expected.add(folder / name_of.format(name=matches[0]["name"], number=number))
    block = None
    with suppress(OSError), (folder / METADATA).open("rb") as file:
        block = _LIST.search(file.read(16 << 20).decode(errors="replace"))  # 100,000 files
    names = [] if block is None else _ITEM.findall(block[1])
    # Earlier recorders wrote the folder before the name.
    files = {folder / Path(name.strip(" \r'\"")).name for name in names}
    return expected | files if files & {*there} else expected


def _problem(path: Path) -> str:
    """Return why a file cannot be a part of a log; empty if it can."""
    try:
        check_input(path)
        with path.open("rb") as file:
            return content_problem(path, file)
    except FileNotFoundError:
        return "the file is missing"
    except OSError as error:
        return error.strerror or str(error)


def natural(path: Path) -> list[tuple[int, str]]:
    """Return a sort key by which ``drive_2`` comes before ``drive_10``."""
    parts = re.findall(r"(\d+)|(\D+)", path.name)
    return [(int(number or 0), text) for number, text in parts]


def content_problem(path: Path, file: IO[bytes]) -> str:
    """Return what an open file is if it is not an MCAP file; else empty."""
    size = file.seek(0, 2)
    file.seek(0)
    head = file.read(_HEAD)
    file.seek(max(size - len(MAGIC), 0))
    tail = file.read(len(MAGIC))
    if not head:
        return "the file is empty"
    wrong = sum(ours != theirs for ours, theirs in zip(MAGIC, head, strict=False))
    if head.startswith(MAGIC) or (wrong <= 2 and len(head) >= len(MAGIC)) or tail == MAGIC:
        return ""
    other = _other_kind(path, head)
    if not other and _RECORD.search(head):
        return ""
    other = other or f"something else (it begins with {head[:8].hex(' ')})"
    return f"not an MCAP file but {other}"


def _other_kind(path: Path, head: bytes) -> str:
    """Return the kind of a file by its first bytes; empty if it is unknown."""
    for skipped, magic, name in _OTHERS:
        if head[skipped:].startswith(magic):
            stem = path.name.split(".")[0]
            stem += "_converted" * (path.name == f"{stem}.mcap")
            return name.format(path=shlex.quote(path.name), stem=shlex.quote(stem))
    return "" if any(head) else "zeros: the disk or the copy failed"


def _describe_folder(path: Path) -> str:
    """Return a message on a folder without MCAP files, with the first file of a known kind."""
    for file in sorted(filter(Path.is_file, path.iterdir()), key=natural):
        with suppress(OSError), file.open("rb") as opened:
            if (head := opened.read(_HEAD)) and (other := _other_kind(file, head)):
                return f"no *.mcap file in it; {visible(file.name)} is {other}"
    return "a folder without *.mcap files"


def is_shown(file: Path) -> bool:
    """Return whether a file is not hidden, unlike the ``._0000.png`` that macOS adds."""
    return not file.name.startswith(".")


def list_files(folder: Path, endings: Collection[str], *, below: bool = False) -> list[Path]:
    """Return the files of a folder that have one of these endings, in natural order.

    ``below`` includes the folders in it. A `LogError` if there is no such folder, or no such file.
    """
    try:
        inside = folder.rglob("*") if below and folder.is_dir() else folder.iterdir()
        files = [file for file in inside if file.suffix.lower() in endings and is_shown(file)]
    except OSError as error:
        names = {NotADirectoryError: "a file, not a folder", FileNotFoundError: "no such folder"}
        raise LogError(str(names.get(type(error), error.strerror)), where=folder) from error
    if not files:
        raise LogError(f"no image in it ({', '.join(sorted(endings))})", where=folder)
    return sorted(files, key=natural)


def order_by_time(files: Sequence[Path]) -> tuple[list[Path], list[int] | None]:
    """Return files in the order of the times in their names, with these times in nanoseconds.

    If not every name is a time, or two are the same, return them unchanged, with None.
    """
    times = [time for time in times_in([file.stem for file in files]) if time is not None]
    if len({*times}) < len(files):
        return list(files), None
    in_order = sorted(zip(times, files, strict=True))
    return [file for _, file in in_order], [time for time, _ in in_order]


def first_names(files: Sequence[str | Path]) -> str:
    """Return the names of the first three files, for messages."""
    names = ", ".join(visible(Path(file).name) for file in files[:3])
    return names + (", ..." if len(files) > 3 else "")


def prefer_ids(labels: Sequence[Path]) -> Sequence[Path]:
    """Return Cityscapes' label images with ids of classes if there are any, else all labels."""
    return [label for label in labels if label.stem.endswith("_labelIds")] or labels


def images_of(labels: Sequence[Path], images: Sequence[Path]) -> Mapping[Path, Path]:
    """Return each label's image by its name: unchanged, `bare_name`, or without shared ends."""
    exact = {_composed(file.stem): file for file in images}
    loose = {bare_name(file): file for file in images}
    names = without_hashes([*map(bare_name, labels)])
    ends = [len(part) for part in _shared([name[::-1] for name in names])]
    matches = (
        [loose.get(name.removeprefix(begin)[: -end or None]) for name in names]
        for begin in _shared(names)
        for end in ends
    )
    best = max(matches, key=lambda belong: len(belong) - belong.count(None), default=[])
    pairs = {
        label: exact.get(_composed(label.stem)) or exact.get(bare_name(label)) or image
        for label, image in zip(labels, best, strict=True)
    }
    return {label: image for label, image in pairs.items() if image is not None}


def _shared(names: Sequence[str]) -> list[str]:
    """Return the prefix that all names share, up to each of its separators, shortest first."""
    pairs = zip(min(names, default=""), max(names, default=""), strict=False)
    common = "".join(one for one, _ in takewhile(lambda pair: pair[0] == pair[1], pairs))
    return ["", *(common[: mark.end()] for mark in re.finditer(r"[^0-9A-Za-z]+", common))]


def without_hashes(names: Sequence[str]) -> Sequence[str]:
    """Return names without the hash that a tool put before or behind all of them.

    >>> without_hashes(["0a1b2c3d-frame_7", "11223344-frame_8"])
    ['frame_7', 'frame_8']
    """
    for pattern in _HASHED:
        matches = [match for match in map(pattern.fullmatch, names) if match]
        hashes = [match["hash"] for match in matches]
        has_one_length = len(set(map(len, hashes))) == 1
        if has_one_length and len(hashes) == len(names) and re.search("[a-f]", "".join(hashes)):
            names = [match["name"] for match in matches]
    return names


def match_name(pattern: str, name: str) -> re.Match[str] | None:
    """Match a name with a pattern: ``*`` is any text, ``?`` any letter, `NUMBER` digits."""
    kinds = {"*": ".*", "?": ".", NUMBER: r"(?<!\d)(\d+)"}
    parts = re.split(rf"([*?]|{re.escape(NUMBER)})", pattern)
    regex = "".join(kinds.get(part, re.escape(part)) for part in parts)
    return re.fullmatch(_composed(regex), _composed(name), re.DOTALL)


def bare_name(file: Path) -> str:
    """Return a file's name without its ending, and without marks of an image or a label.

    >>> bare_name(Path("um_road_000012.png")), bare_name(Path("a_000019_gtFine_labelIds.png"))
    ('um_000012', 'a_000019')
    """
    return _SUFFIX.sub("", _KITTI.sub(r"\1_", _composed(file.stem)))


def _composed(name: str) -> str:
    """Return a name with each letter and its marks as one; macOS has them apart."""
    return unicodedata.normalize("NFC", name)


def times_alone(names: Sequence[str]) -> Sequence[str]:
    """Return names without the text that all of them have before, and after, a time.

    They are unchanged if all times are of one second, which may be the time of recording.

    >>> times_alone(["cam_1700000000.5_road", "cam_1700000001.5_road"])
    ['1700000000.5', '1700000001.5']
    """
    matches = [match for match in map(_TIME_WITHIN.fullmatch, names) if match]
    ends = {(match["before"], match["after"]) for match in matches}
    seconds = {match["time"][:10] for match in matches}
    is_shared = len(matches) == len(names) and len(ends) == 1 and len(seconds) > 1
    return [match["time"] for match in matches] if is_shared else names


def times_in(names: Sequence[str]) -> list[int | None]:
    """Return nanoseconds since 1970 of each name that is a time, else None.

    Digits behind the seconds are decimals. If zeros before them were left out, they count
    nanoseconds, or micro- or milliseconds; a `LogError` if that is doubtful.

    >>> times_in(["1700000000.5", "1700000001"]), times_in(["1_50000000", "1700000000_50000000"])
    ([1700000000500000000, 1700000001000000000], [None, 1700000000050000000])
    """
    matches = [*map(_TIME.fullmatch, names)]
    fractions = {match[2] for match in matches if match and (match[2] or "").strip("0")}
    widths = {*map(len, fractions)}
    unit = next(width for width in (3, 6, 9) if max(widths, default=9) <= width)
    may_count = (len(widths) > 1 or widths == {8}) and not any(f[0] == "0" for f in fractions)
    # Nobody writes zeros behind decimals of different lengths.
    is_count = may_count and any(len(f) < unit and f[-1] == "0" for f in fractions)
    if may_count and not is_count and widths & {8, 9} and all(matches):
        raise LogError(
            "the digits behind the seconds may be decimals, or nanoseconds without the zeros "
            "before them",
            where=first_names(names),
            remedy="write nine digits",
        )

    def nanoseconds(seconds: str | None, fraction: str | None, *others: str | None) -> int:
        if seconds is None:
            return next(int(t) * 1000 ** (2 - place) for place, t in enumerate(others) if t)
        return int(seconds) * NS + int((fraction or "").rjust(unit * is_count, "0").ljust(9, "0"))

    return [match and nanoseconds(*match.groups()) for match in matches]

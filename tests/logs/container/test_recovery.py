"""The frames that are saved from damaged and odd logs, and the sentences about the rest."""

import os
import re
import subprocess
import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from time import process_time

import pytest

from roadeval.logs.errors import FrameError, LogError
from roadeval.logs.log import Log, open_log
from tests.fixtures.broken import BROKEN as BROKEN_HERE
from tests.fixtures.elsewhere import SPLIT, WITH_IMAGES, WITHOUT_IMAGES, split_bag
from tests.fixtures.make import LOGS, make
from tests.fixtures.shared import SHARED, both, shared
from tests.measuring import PEAK

WHOLE = ""

BROKEN = {
    # file: (frames decoded, frames in the log, what is said)
    "ok": (40, 40, WHOLE),
    "ok_lz4": (40, 40, WHOLE),
    "unchunked": (40, 40, WHOLE),
    "noindex": (40, 40, WHOLE),
    "nostats": (40, 40, WHOLE),
    "schemaless": (5, 5, WHOLE),
    "dup": (40, 40, WHOLE),
    "shuffled": (40, 40, WHOLE),
    "zerotime": (40, 40, WHOLE),
    "dataend_crc_real": (40, 40, WHOLE),
    "dataend_crc_bad": (40, 40, "checksum of all data is wrong .*no message is lost"),
    "huge_len_chunk": (40, 40, r"head of a chunk is damaged.*byte {at}.*no message is lost"),
    "trunc_in_summary": (40, 40, "does not end as it should .*no message is lost"),
    "trunc_last1": (40, 40, "does not end as it should .*no message is lost"),
}
LOSSY = {
    "chunk_crc_field_bad": (38, 40, r"checksum is wrong \(byte {at}, 0.600 to 0.700 s\); lost: 2"),
    "chunk_data_flip_lz4": (38, 40, r"checksum is wrong \(byte {at}, 0.600 to 0.700 s\); lost: 2"),
    "huge_len_msg_unchunked": (39, 39, r"beyond the end .*byte {at}, 0.400 to 0.500 s.*39 of 40"),
    "live": (36, 36, r"never finished.*byte {at}, after 3.500 s.*36 images kept"),
    "trunc_midchunk": (36, 36, r"ends inside a chunk \(byte {at}, after 3.500 s\)"),
    "trunc_nofooter": (40, 40, r"never finished.*byte {at}, after 3.900 s"),
    "trunc_unchunked": (28, 28, r"beyond the end of the file \(byte {at}, after 2.700 s\)"),
    "zero_hole": (38, 38, r"summary lists is not there \(byte {at}, 0.600 to 0.700 s\).*38 of 40"),
}
NO_FRAMES = {
    "magic_only": "never finished",
    "fox_killed_lz4_onechunk": r"ends inside a chunk \(byte {at}, after 5.700 s\).*58 images kept",
}
NO_LOG = {
    "bagV2.mcap": "a ROS 1 bag: mcap convert bagV2.mcap bagV2_converted.mcap",
    "notmcap.mcap": r"something else \(it begins with 00 01 00 01",
    "zero.mcap": "the file is empty",
}
PRESSED = "compressed as a whole by zstd: zstd -d"
SHARED_AT = {
    "chunk_crc_field_bad": 66147,
    "chunk_data_flip_lz4": 77235,
    "dataend_crc_bad": 439479,
    "fox_killed_lz4_onechunk": 68,
    "huge_len_chunk": 66147,
    "huge_len_msg_unchunked": 440492,
    "live": 375816,
    "trunc_in_summary": 439479,
    "trunc_last1": 439479,
    "trunc_midchunk": 395258,
    "trunc_nofooter": 439479,
    "trunc_unchunked": 2462562,
    "zero_hole": 66147,
}
"""The bytes at which the shared logs are damaged."""
SHARED_WITH_IMAGES = {
    "lichtblick_custom_camera.json_CompressedImage": 10,
    "mcap_explorer_demo.protobuf_CompressedImage": 30,
}


def broken(names: Iterable[str]) -> pytest.MarkDecorator:
    """Run a test over damaged logs: ours, and the shared ones of the same names."""
    cases = both("broken", *(f"{name}.mcap" for name in names))
    return pytest.mark.parametrize("log", cases, indirect=True)


def real(*names: str) -> list[Path]:
    return [path for name in names for path in shared("mcap", "real", name)]


def place(path: Path) -> int:
    """Return the byte at which a log is damaged."""
    ours = not (SHARED and path.is_relative_to(SHARED))
    return BROKEN_HERE[path.stem][1]().at if ours else SHARED_AT.get(path.stem, 0)


def decoded(log: Log) -> tuple[int, int]:
    """Frames that decode, and frames in the log; labels included."""
    stream, good = log.frames(log.select()), 0
    for frame in stream:
        with suppress(FrameError):
            frame.decode()
            good += 1
    return good, stream.accounting.in_log


@pytest.mark.parametrize("folder", [None, *shared("mcap", "broken")])
def test_the_tables_name_every_file(folder: Path | None) -> None:
    names = {path.stem for path in folder.glob("*.mcap")} if folder else set(BROKEN_HERE)
    no_log = {Path(name).stem for name in NO_LOG}
    assert names == {*BROKEN, *LOSSY, *NO_FRAMES, *no_log}


@broken(BROKEN)
def test_a_log_that_lacks_nothing_loses_nothing(log: Path) -> None:
    good, in_log, reason = BROKEN[log.stem]
    with open_log(log) as opened:
        opened.verify()
        assert decoded(opened) == (good, in_log)
        assert opened.losses == ()
        sentences = " | ".join(map(str, opened.damage))
    assert bool(sentences) == bool(reason)
    assert matches(reason, sentences, log)


@broken(LOSSY)
def test_a_damaged_log_gives_what_is_readable_and_says_the_rest(log: Path) -> None:
    good, in_log, reason = LOSSY[log.stem]
    with open_log(log) as opened:
        assert decoded(opened) == (good, in_log)
        assert matches(reason, " | ".join(opened.losses), log)


@broken(["chunk_crc_field_bad"])
def test_a_damaged_chunk_is_told_once_and_not_again_with_each_of_its_frames(log: Path) -> None:
    with open_log(log) as opened:
        stream = opened.frames(opened.select())
        for frame in stream:
            with suppress(FrameError):
                frame.decode()
        assert len(stream.accounting.undecodable) == 2
        assert stream.accounting.losses == ()
        assert sum("a chunk whose checksum is wrong" in loss for loss in opened.losses) == 1


@broken(NO_FRAMES)
def test_a_log_without_a_readable_frame_still_says_what_it_lost(log: Path) -> None:
    with open_log(log) as opened:
        assert matches(NO_FRAMES[log.stem], " | ".join(opened.losses), log)
        with pytest.raises(LogError):
            opened.select()


@pytest.mark.parametrize("log", both("broken", *NO_LOG), indirect=True)
def test_what_is_no_log_is_called_by_its_name(log: Path) -> None:
    with pytest.raises(LogError, match=NO_LOG[log.name]):
        open_log(log)


def test_a_log_compressed_as_a_whole_is_called_by_its_name(tmp_path: Path) -> None:
    theirs = shared("mcap", "real", "tiryoh_whole_file_zstd.mcap.zstd")
    for path in (make("real/whole.mcap.zstd", tmp_path), *theirs):
        with pytest.raises(LogError, match=PRESSED):
            open_log(path)


def other_peoples(tmp_path: Path) -> dict[Path, int]:
    """Return logs with images, and their frames."""
    ours = {
        make(f"real/{name}.mcap", tmp_path): count for name, (_, _, count) in WITH_IMAGES.items()
    }
    theirs = {path: n for name, n in SHARED_WITH_IMAGES.items() for path in real(f"{name}.mcap")}
    return ours | theirs


def test_a_camera_among_other_topics(tmp_path: Path) -> None:
    for path, count in other_peoples(tmp_path).items():
        with open_log(path) as log:
            assert decoded(log) == (count, count), path.name
            assert log.damage == ()


def without_images(tmp_path: Path) -> list[Path]:
    """Return our logs without images, and other people's."""
    ours = [make(f"real/{name}.mcap", tmp_path) for name in WITHOUT_IMAGES]
    theirs = [path for folder in real("") for path in sorted(folder.rglob("*.mcap"))]
    return ours + [path for path in theirs if path.stem not in SHARED_WITH_IMAGES]


def test_logs_without_images_say_what_they_have(tmp_path: Path) -> None:
    for path in without_images(tmp_path):
        with open_log(path) as log:
            log.verify()
            assert bool(log.losses) == (path.stem in {"cut_off", "tiryoh_truncated"}), path.name
            with pytest.raises(LogError, match="no image topic; the log has: "):
                log.select()


def folders(tmp_path: Path) -> dict[Path, int]:
    """Return folders of split files, and their messages."""
    for name in split_bag():
        make(f"real/rosbag2/{name}", tmp_path)
    ours = {tmp_path / "real" / "rosbag2": sum(SPLIT)}
    return ours | dict.fromkeys(real("rosbag2"), 1324 + 1324 + 529)


def test_a_folder_of_split_files_is_one_log(tmp_path: Path) -> None:
    for folder, messages in folders(tmp_path).items():
        with open_log(folder) as log:
            chatter = next(topic for topic in log.topics if topic.name == "/chatter")
        assert chatter.count == messages


@pytest.mark.parametrize(
    ("there", "missing_numbers"),
    [
        ([0, 1, 3], [2]),
        ([0, 3], [1, 2]),
        ([0, *range(2, 12)], [1]),
        ([0, 1, 2], []),
        ([1, 3], []),  # a part that somebody took out: where it begins is not known
    ],
)
@pytest.mark.parametrize(
    ("name", "lacking"),
    [("run_{}.mcap", "run_{}.mcap"), ("{0}_run_2026_03_01-10_00_{0:02}.mcap", "{}_run_*.mcap")],
)
def test_a_file_that_lacks_is_told_by_old_names_of_rosbag2_and_by_new(
    tmp_path: Path, name: str, lacking: str, there: list[int], missing_numbers: list[int]
) -> None:
    """Names of splits since rosbag2 0.33.1: ``{n}_{name}_{date}.mcap``, n not padded."""
    for number in there:
        (tmp_path / name.format(number)).write_bytes(LOGS["broken/ok.mcap"].data())
    with open_log(tmp_path) as log:
        missing = [loss for loss in log.losses if "missing" in loss]
    assert missing == [
        f"{lacking.format(number)}: the file is missing (byte 0)" for number in missing_numbers
    ]


@pytest.mark.parametrize(
    "change",
    [
        lambda path, content: path.write_bytes(content[:5000] + bytes(8) + content[5008:]),
        lambda path, content: path.write_bytes(content[: len(content) // 2]),
        lambda path, content: path.write_bytes(content + content),
    ],
    ids=["other bytes", "cut off", "longer"],
)
def test_a_log_that_is_written_anew_while_it_is_read_is_refused(tmp_path: Path, change) -> None:
    path = make("broken/ok.mcap", tmp_path)
    content = path.read_bytes()
    with open_log(path) as log:
        change(path, content)
        os.utime(path, ns=(1, 1))  # a coarse clock would hide it
        with pytest.raises(LogError, match=r"it changed while it was read; run again$"):
            assert log.losses


def test_a_log_that_grows_or_is_replaced_while_it_is_read_is_as_it_was(tmp_path: Path) -> None:
    path = make("broken/ok.mcap", tmp_path)
    content, new = path.read_bytes(), tmp_path / "new.mcap"
    with open_log(path) as log:
        new.write_bytes(content[:100])
        new.replace(path)
        assert log.losses == ()
    path.write_bytes(content[: len(content) // 2])
    with open_log(path) as log:
        before = log.losses
        path.write_bytes(content)
        assert log.losses == before


def test_a_folder_that_may_not_be_listed_says_so(tmp_path: Path, monkeypatch) -> None:
    def refuse(path: Path) -> None:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "iterdir", refuse)
    with pytest.raises(LogError, match=f"^{re.escape(str(tmp_path))}: Permission denied$"):
        open_log(tmp_path)


NOTE = """\
rosbag2_bagfile_information:
  version: 9
  storage_identifier: mcap
  relative_file_paths:
    - {}
  files:
    - path: a_0.mcap
      message_count: 80
"""


@pytest.mark.parametrize(
    ("listed", "there", "missing_names"),
    [
        ("a_0.mcap a_1.mcap", "a_0.mcap a_1.mcap", ""),
        ("a_0.mcap a_1.mcap a_2.mcap", "a_0.mcap", "a_1.mcap a_2.mcap"),
        ("a_0.mcap a_1.mcap", "a_1.mcap", "a_0.mcap"),
        ("bag/a_0.mcap bag/a_1.mcap", "a_1.mcap", "a_0.mcap"),
        ("'a_0.mcap' \"a_1.mcap\"", "a_1.mcap", "a_0.mcap"),
        ("a_0.mcap a_1.mcap", "a_0.mcap a_1.mcap added.mcap", ""),
        ("a_0.mcap a_1.mcap a_3.mcap", "a_0.mcap a_3.mcap", "a_1.mcap a_2.mcap"),
        ("a_0.mcap a_1.mcap", "renamed.mcap", ""),
    ],
)
def test_a_file_that_a_recorder_lists_and_that_lacks_is_told(
    tmp_path, listed, there, missing_names
):
    for name in there.split():
        (tmp_path / name).write_bytes(LOGS["broken/ok.mcap"].data())
    for end in ("\n", "\r\n"):
        note = NOTE.format("\n    - ".join(listed.split())).replace("\n", end)
        (tmp_path / "metadata.yaml").write_bytes(note.encode())
        with open_log(tmp_path) as log:
            missing = [loss for loss in log.losses if "images kept" not in loss]
            assert missing == [
                f"{name}: the file is missing (byte 0)" for name in missing_names.split()
            ]


@pytest.mark.parametrize(
    "note",
    [
        b"",
        b"\xff\xfe\x00relative_file_paths",
        b"relative_file_paths: [a_0.mcap, a_1.mcap]\n",
        b"  relative_file_paths:\n    - \n    - ..\n    - /\n",
        b"  relative_file_paths:\n" + b"    - [\n" * 200_000,
        b" " * 5_000_000,
        b"  relative_file_paths:\n    - a" + b" " * 5_000_000 + b"a\n",
    ],
    ids=["empty", "no text", "in one line", "no names", "deep", "blank", "wide"],
)
def test_a_note_that_says_nothing_of_files_is_no_loss(tmp_path: Path, note: bytes) -> None:
    (tmp_path / "a_0.mcap").write_bytes(LOGS["broken/ok.mcap"].data())
    (tmp_path / "metadata.yaml").write_bytes(note)
    start = process_time()
    with open_log(tmp_path) as log:
        assert log.losses == ()
    assert process_time() - start < 5


MEASURE = f"""
{PEAK}
import sys
from roadeval.logs.errors import FrameError, LogError
from roadeval.logs.log import open_log
import cv2, mcap_ros1.decoder, mcap_ros2.decoder, mcap_protobuf.decoder
baseline = peak()
for path in sys.argv[1:]:
    try:
        with open_log(path) as log:
            log.verify()
            for frame in log.frames(log.select()):
                try:
                    frame.decode()
                except FrameError:
                    pass
    except LogError:
        pass
print((peak() - baseline) / 1024)
"""


def test_no_length_field_makes_memory_grow(tmp_path: Path) -> None:
    paths = [make(name, tmp_path) for name in LOGS if name.startswith(("broken/", "real/"))]
    folders = [*shared("mcap", "broken"), *shared("mcap", "real")]
    paths += [path for folder in folders for path in folder.rglob("*.mcap*")]
    words = [sys.executable, "-c", MEASURE, *map(str, paths)]
    run = subprocess.run(words, capture_output=True, check=True, text=True)
    assert run.stderr == ""
    assert float(run.stdout) < 150


def matches(pattern: str, text: str, path: Path) -> bool:
    return re.search(pattern.replace("{at}", str(place(path))), text) is not None

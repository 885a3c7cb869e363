"""What is saved of damaged and odd logs, and what is said about the rest."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from roadeval.logs import FrameError, Log, LogError, open_log
from tests.measuring import PEAK

CAM = "/cam/image/compressed"
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
    "huge_len_chunk": (40, 40, r"head of a chunk is damaged.*byte 66147.*no message is lost"),
    "trunc_in_summary": (40, 40, "does not end as it should .*no message is lost"),
    "trunc_last1": (40, 40, "does not end as it should .*no message is lost"),
}
LOSSY = {
    "chunk_crc_field_bad": (38, 40, r"checksum is wrong \(byte 66147, 0.600 to 0.700 s\); lost: 2"),
    "chunk_data_flip_lz4": (38, 40, r"checksum is wrong \(byte 77235, 0.600 to 0.700 s\); lost: 2"),
    "huge_len_msg_unchunked": (39, 39, r"beyond the end .*byte 440492, 0.400 to 0.500 s.*39 of 40"),
    "live": (36, 36, r"never finished.*byte 375816, after 3.500 s.*36 images kept"),
    "trunc_midchunk": (36, 36, r"ends inside a chunk \(byte 395258, after 3.500 s\)"),
    "trunc_nofooter": (40, 40, r"never finished.*byte 439479, after 3.900 s"),
    "trunc_unchunked": (28, 28, r"beyond the end of the file \(byte 2462562, after 2.700 s\)"),
    "zero_hole": (38, 38, r"cannot uncompress \(byte 66147, 0.600 to 0.700 s\).*38 of 40"),
}
NO_FRAMES = {
    "magic_only": "never finished",
    "fox_killed_lz4_onechunk": r"ends inside a chunk \(byte 68, after 5.700 s\).*58 images kept",
}
NO_LOG = {
    "broken/bagV2.mcap": "a ROS 1 bag: mcap convert bagV2.mcap bagV2_converted.mcap",
    "broken/notmcap.mcap": r"something else \(it begins with 00 01 00 01",
    "broken/zero.mcap": "the file is empty",
    "real/tiryoh_whole_file_zstd.mcap.zstd": "compressed as a whole by zstd: zstd -d",
    "real/missing.mcap": "No such file",
}
REAL_WITH_IMAGES = {
    "lichtblick_custom_camera.json_CompressedImage": 10,
    "mcap_explorer_demo.protobuf_CompressedImage": 30,
}


def decoded(log: Log) -> tuple[int, int]:
    """Frames that decode, and frames in the log; labels included."""
    stream, good = log.frames(log.select()), 0
    for frame in stream:
        try:
            frame.decode()
        except FrameError:
            continue
        good += 1
    return good, stream.accounting.in_log


def test_the_tables_name_every_file(data: Path) -> None:
    names = {path.stem for path in (data / "mcap" / "broken").glob("*.mcap")}
    no_log = {Path(name).stem for name in NO_LOG if name.startswith("broken")}
    assert names == {*BROKEN, *LOSSY, *NO_FRAMES, *no_log}


@pytest.mark.parametrize("name", BROKEN)
def test_a_log_that_lacks_nothing_loses_nothing(data: Path, name: str) -> None:
    good, in_log, said = BROKEN[name]
    with open_log(data / "mcap" / "broken" / f"{name}.mcap") as log:
        log.verify()
        assert decoded(log) == (good, in_log)
        assert log.losses == ()
        sentences = " | ".join(map(str, log.damage))
    assert bool(sentences) == bool(said)
    assert matches(said, sentences)


@pytest.mark.parametrize("name", LOSSY)
def test_a_damaged_log_gives_what_is_readable_and_says_the_rest(data: Path, name: str) -> None:
    good, in_log, said = LOSSY[name]
    with open_log(data / "mcap" / "broken" / f"{name}.mcap") as log:
        assert decoded(log) == (good, in_log)
        assert matches(said, " | ".join(log.losses))


@pytest.mark.parametrize("name", NO_FRAMES)
def test_a_log_without_a_readable_frame_still_says_what_it_lost(data: Path, name: str) -> None:
    with open_log(data / "mcap" / "broken" / f"{name}.mcap") as log:
        assert matches(NO_FRAMES[name], " | ".join(log.losses))
        with pytest.raises(LogError):
            log.select()


@pytest.mark.parametrize("name", NO_LOG)
def test_what_is_no_log_is_called_by_its_name(data: Path, name: str) -> None:
    with pytest.raises(LogError, match=NO_LOG[name]):
        open_log(data / "mcap" / name)


@pytest.mark.parametrize("name", REAL_WITH_IMAGES)
def test_other_peoples_logs_with_images(data: Path, name: str) -> None:
    with open_log(data / "mcap" / "real" / f"{name}.mcap") as log:
        assert decoded(log) == (REAL_WITH_IMAGES[name],) * 2
        assert log.damage == ()


def test_other_peoples_logs_without_images(data: Path) -> None:
    paths = sorted((data / "mcap" / "real").rglob("*.mcap"))
    rest = [path for path in paths if path.stem not in REAL_WITH_IMAGES]
    assert len(rest) == 27
    for path in rest:
        with open_log(path) as log:
            log.verify()
            assert bool(log.losses) == (path.stem == "tiryoh_truncated")
            with pytest.raises(LogError, match="no image topic; the log has: "):
                log.select()


def test_a_folder_of_split_files_is_one_log(data: Path) -> None:
    with open_log(data / "mcap" / "real" / "rosbag2") as log:
        chatter = next(topic for topic in log.topics if topic.name == "/chatter")
    assert chatter.count == 1324 + 1324 + 529


def test_data_of_a_wrong_checksum_is_kept_on_demand(data: Path) -> None:
    path = data / "mcap" / "broken" / "chunk_crc_field_bad.mcap"
    with open_log(path, keep_corrupt=True) as log:
        assert decoded(log) == (40, 40)
        assert "checksum is wrong, used all the same" in log.losses[0]


MEASURE = f"""
{PEAK}
import sys
from roadeval.logs import FrameError, LogError, open_log
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


def test_no_length_field_makes_memory_grow(data: Path) -> None:
    paths = [*(data / "mcap" / "broken").iterdir(), *(data / "mcap" / "real").rglob("*.mcap*")]
    run = subprocess.run(
        [sys.executable, "-c", MEASURE, *map(str, paths)],
        capture_output=True,
        check=True,
        text=True,
    )
    assert run.stderr == ""
    assert float(run.stdout) < 150


def matches(pattern: str, text: str) -> bool:
    return re.search(pattern, text) is not None

"""The walk from record to record, over what is damaged, and over whatever MCAP leaves open."""

import json
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import Any

import lz4.frame
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.writer import CompressionType, Writer

from roadeval.logs.container.file import containers_in, damage_of
from roadeval.logs.container.records import Message
from roadeval.logs.errors import LogError
from roadeval.logs.log import open_log
from roadeval.logs.settings import LogConfig, TopicSettings
from tests.fixtures import broken, conformance
from tests.fixtures.broken import (
    HEAD,
    LENGTH_AT,
    chunk,
    data_end,
    good,
    length_of,
    mended,
    over,
)
from tests.fixtures.shared import shared
from tests.fuzz.intact import FRAMES as INTACT
from tests.fuzz.intact import Intact, Reading, intact_logs, read
from tests.logs.making import CAMERA, FRAMES, START, chunk_record, small_log

FOOTER = HEAD + 20 + 8


def kept_images(path: Path) -> list[int]:
    """Positions in the good log of the images that are kept whole."""
    with open_log(path, LogConfig(topics=TopicSettings(image=CAMERA, truth=""))) as log:
        frames = [frame.decode() for frame in log.frames(log.select())]
    return [round(float(frame.image.mean()) / 20) for frame in frames]


def records(data: bytes, opcode: Opcode) -> list[int]:
    """Offsets of the records of a kind outside chunks."""
    return list(broken.records(data, opcode))


def changed(path: Path, at: int, data: bytes) -> Path:
    path.write_bytes(over(path.read_bytes(), at, data))
    return path


@pytest.fixture
def unchunked(tmp_path: Path) -> Path:
    """Images and labels in turn, each a record of its own."""
    path = tmp_path / "log.mcap"
    small_log(path, "unchunked")
    return path


@pytest.fixture
def chunked(tmp_path: Path) -> Path:
    path = tmp_path / "log.mcap"
    small_log(path, "zstd")
    return path


@pytest.mark.parametrize("longer", [-40, -1, 1, 3, 40, 700])
def test_an_image_of_wrong_length_costs_only_itself(unchunked: Path, longer: int) -> None:
    data = unchunked.read_bytes()
    at = records(data, Opcode.MESSAGE)[6]
    length = length_of(data, at) - HEAD + longer
    images = kept_images(changed(unchunked, at + LENGTH_AT, length.to_bytes(8, "little")))
    assert set(range(FRAMES)) - set(images) <= {3}


def test_a_wrong_message_index_costs_nothing_and_no_order(chunked: Path) -> None:
    good = chunked.read_bytes()
    at = records(good, Opcode.MESSAGE_INDEX)[3]
    channel, entries = at + 9, at + 9 + 2 + 4
    assert good[channel] == 1, "the second chunk's index of the camera"
    for byte in range(entries, entries + 3 * 16):
        chunked.write_bytes(good)
        assert kept_images(changed(chunked, byte, bytes([good[byte] ^ 4]))) == [*range(FRAMES)]


def test_a_wrong_message_index_is_noted(chunked: Path) -> None:
    second_offset = records(chunked.read_bytes(), Opcode.MESSAGE_INDEX)[3] + 9 + 2 + 4 + 16 + 8
    with open_log(changed(chunked, second_offset, b"?")) as log:
        for frame in log.frames(log.select()):
            frame.decode()
        assert "message index of a chunk is wrong" in str(log.damage[0])
        assert log.losses == ()


@pytest.mark.parametrize("offset", range(8))
def test_a_wrong_byte_at_the_very_beginning_is_forgiven(chunked: Path, offset: int) -> None:
    changed(chunked, offset, b"?")
    assert kept_images(chunked) == [*range(FRAMES)]
    with open_log(chunked) as log:
        assert log.losses == ()
        assert "does not begin as it should" in str(log.damage[0])


@pytest.mark.parametrize("container", ["unchunked", "zstd"])
def test_a_missing_record_at_the_end_of_the_data_is_no_loss(tmp_path: Path, container: str) -> None:
    path = tmp_path / "log.mcap"
    small_log(path, container)
    data = path.read_bytes()
    at = data_end(data)
    start = int.from_bytes(data[-FOOTER + HEAD :][:8], "little") - length_of(data, at)
    # Writers that leave this record out give no checksums, and no offsets of summary sections.
    footer = over(data[-FOOTER:], HEAD, start.to_bytes(8, "little") + bytes(12))
    path.write_bytes(data[:at] + data[at + length_of(data, at) : -FOOTER] + footer)
    assert kept_images(path) == [*range(FRAMES)]
    with open_log(path) as log:
        log.verify()
        assert log.losses == ()
        assert "the record that ends the data is missing" in str(log.damage[0])


def test_a_footer_that_points_into_the_data_ends_nothing(unchunked: Path) -> None:
    data = unchunked.read_bytes()
    start = records(data, Opcode.MESSAGE)[6].to_bytes(8, "little")
    path = changed(unchunked, len(data) - FOOTER + HEAD, start + bytes(12))
    assert kept_images(path) == [*range(FRAMES)]


SIZE = 9 * (2 << 20)
"""A whole number of empty records, so that zeros would add up if they were taken for them."""
COMPRESSED_ZEROS = {
    "zstd": zstandard.ZstdCompressor(write_content_size=False).compress(bytes(SIZE)),
    "lz4": lz4.frame.compress(bytes(SIZE), store_size=False),
}


@pytest.mark.parametrize("compression", COMPRESSED_ZEROS)
@pytest.mark.parametrize(
    ("largest", "loss"),
    [
        (1 << 30, "a chunk whose records do not add up"),
        (10 << 20, "a chunk of more than 10485760 bytes"),
    ],
)
def test_zeros_in_place_of_records_are_told_and_given_up_if_they_grow_beyond_all_bounds(
    tmp_path, monkeypatch, compression, largest, loss
):
    """They lie in front of all other chunks, in a log without a summary."""
    monkeypatch.setattr("roadeval.logs.container.records.LARGEST_CHUNK", largest)
    path = tmp_path / "log.mcap"
    small_log(path, "uncompressed")
    log = path.read_bytes()
    begin, end = 8 + length_of(log, 8), data_end(log)
    # Its times are those of the log, so that no message lies before what was its first one.
    chunk = chunk_record(COMPRESSED_ZEROS[compression], compression, SIZE, start=START)
    tail = b"\x0f" + struct.pack("<QI", 4, 0) + b"\x02" + struct.pack("<Q", 20) + bytes(20)
    path.write_bytes(log[:begin] + chunk + log[begin:end] + tail + log[:8])
    assert kept_images(path) == [*range(FRAMES)]
    with open_log(path) as opened:
        assert loss in opened.losses[0]


def test_two_descriptions_of_a_topic_outside_chunks_are_told(unchunked: Path) -> None:
    """Which is right nothing tells: the summary has a checksum, the data was what messages met."""
    content = unchunked.read_bytes()
    name = b"sensor_msgs/msg/CompressedImage"
    last = content.rindex(name)
    wrong = content[:last] + name.replace(b"sensor", b"tensor") + content[last + len(name) :]
    unchunked.write_bytes(mended(wrong))
    with open_log(unchunked) as log:
        loss, *_ = log.losses
    assert "a topic is described here in another way" in loss


def test_topics_are_read_as_the_data_describes_them(chunked: Path) -> None:
    """The summary's copy of a definition may say something else under a checksum that is right."""
    content = chunked.read_bytes()
    wrong = content.replace(b"string format\nuint8[] data", b"string format\nuint8[] dota")
    assert wrong != content
    chunked.write_bytes(mended(wrong))
    assert kept_images(chunked) == list(range(FRAMES))
    with open_log(chunked) as log:
        loss, *_ = log.losses
    assert "described here in another way than before" in loss


def test_a_message_without_room_for_its_head_is_damage_and_costs_no_image(unchunked: Path) -> None:
    data = unchunked.read_bytes()
    at = records(data, Opcode.MESSAGE)[6]
    short = b"\x05" + (10).to_bytes(8, "little") + data[at + 9 : at + 19]
    unchunked.write_bytes(data[:at] + short + data[at:])
    assert kept_images(unchunked) == [*range(FRAMES)]
    with open_log(unchunked) as log:
        assert "of a length that cannot be" in log.losses[0]


@pytest.mark.parametrize("opcode", [0, 4, 5, 9, 0x0F, 0x87])
def test_a_message_index_under_another_kind_costs_nothing(chunked: Path, opcode: int) -> None:
    at = records(chunked.read_bytes(), Opcode.MESSAGE_INDEX)[3]
    assert kept_images(changed(chunked, at, bytes([opcode]))) == [*range(FRAMES)]


def test_a_chunk_that_calls_itself_an_attachment_is_read_without_any_summary(chunked: Path) -> None:
    data = chunked.read_bytes()
    chunked.write_bytes(data[: data_end(data)])
    at = records(data, Opcode.CHUNK)[1]
    assert kept_images(changed(chunked, at, b"\x09")) == [*range(FRAMES)]


CHUNK_LENGTH_AT = HEAD + 8 + 8 + 8
"""The offset of the chunk's length in a chunk index."""


def without(number: int, data: bytes) -> bytes:
    """Leave a chunk out."""
    at = chunk(number, data)
    return data[:at] + data[at + length_of(data, at) :]


@pytest.mark.parametrize("length", [0, 1, 1 << 62])
def test_an_index_of_a_chunk_that_cannot_be_so_long_is_not_followed(tmp_path, length):
    """One of no length would lead back to its own chunk, again and again."""
    data = good()
    at = records(data, Opcode.CHUNK_INDEX)[0]
    path = tmp_path / "drive.mcap"
    path.write_bytes(mended(over(data, at + CHUNK_LENGTH_AT, length.to_bytes(8, "little"))))
    with open_log(path) as log:
        assert log.topics[0].count == broken.FRAMES


def left_out() -> tuple[bytes, str]:
    """Leave a chunk out though all others are sound."""
    return without(3, good()), f"{length_of(good(), chunk(3, good()))} bytes are missing before it"


def repeated() -> tuple[bytes, str]:
    data, at = good(), chunk(3, good())
    length = length_of(data, at)
    return data[:at] + data[at : at + length] + data[at:], f"{length} bytes too many lie before it"


def without_an_end() -> tuple[bytes, str]:
    """Leave counts behind the data, which tell what is missing."""
    return without(3, good())[:-20], "lost: 2 of /cam/image/compressed"


def without_a_summary() -> tuple[bytes, str]:
    """Leave only the checksum of all data, which is wrong."""
    data = broken.log(enable_data_crcs=True).bytes()
    end = data_end(data)
    damaged = without(3, data[: end + length_of(data, end)])
    return damaged, "nothing tells which messages are wrong or missing"


def of_wrong_records() -> tuple[bytes, str]:
    """Change a length in a chunk under a checksum that is right."""
    data = broken.log(use_statistics=False, compression=broken.CompressionType.NONE).bytes()
    places = broken.inside(data, chunk(3, data))
    message = next(at for at in places if data[at] == Opcode.MESSAGE)
    damaged = mended(over(data, message + broken.LENGTH_AT, broken.ABSURD))
    return damaged, "records do not add up"


@pytest.mark.parametrize(
    "damage", [left_out, repeated, without_an_end, without_a_summary, of_wrong_records]
)
def test_a_chunk_that_is_missing_repeated_or_wrong_is_told(tmp_path, damage):
    data, reason = damage()
    path = tmp_path / "drive.mcap"
    path.write_bytes(data)
    with open_log(path) as log:
        log.verify()
        assert reason in " | ".join(log.losses)


FOLDERS = "NoData OneAttachment OneMessage OneMetadata OneSchemalessMessage TenMessages"


def plain(value: Any) -> Any:
    """A value as the suite's JSON writes it: numbers and bytes as strings."""
    if isinstance(value, bytes | memoryview):
        return [str(byte) for byte in value]
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    return value if isinstance(value, str) else str(value)


def fields(record: Any) -> dict[str, Any]:
    named = record._asdict() if isinstance(record, Message) else vars(record)
    return {key: plain(value) for key, value in named.items()}


Suite = list[tuple[Path, list[tuple[str, dict[str, Any]]]]]
"""Logs, and the records expected of each, by kind and fields."""


def here(content: str, folder: Path) -> Suite:
    """Write every variant of a content, and read its records by the MCAP project's reader."""
    suite = []
    for name, data in conformance.variants(content):
        path = folder / f"{name}.mcap"
        path.write_bytes(data)
        found_records = [
            (type(record).__name__, fields(record)) for record in conformance.records(data)
        ]
        suite.append((path, [record for record in found_records if record[0] != "MessageIndex"]))
    return suite


def published(folder: Path) -> Suite:
    """Return the MCAP project's suite, and what it says itself."""
    suite = []
    for path in sorted(folder.glob("*.mcap")):
        listed = json.loads(path.with_suffix(".json").read_text())["records"]
        suite.append((path, [(record["type"], dict(record["fields"])) for record in listed]))
    return suite


@pytest.fixture(params=[*conformance.CONTENTS, *shared("mcap", "conformance")], ids=str)
def suite(request: pytest.FixtureRequest, tmp_path: Path) -> Suite:
    if isinstance(request.param, str):
        return here(request.param, tmp_path)
    return [case for folder in FOLDERS.split() for case in published(request.param / folder)]


def test_every_message_topic_and_schema_is_found_and_nothing_is_called_damaged(suite: Suite):
    assert suite
    for path, expected in suite:
        (container,) = containers_in(path, lambda *_: True, lambda *_: 0)
        found_records = [
            ("Message", fields(container.message(chunk, offset)))
            for log in container.logs.values()
            for chunk, entries in log.blocks
            for _, offset in entries.tolist()
        ]
        assert damage_of(container) == (), path.name
        container.close()
        assert found_records == [record for record in expected if record[0] == "Message"], path.name
        for kind, described in (("Channel", container.channels), ("Schema", container.schemas)):
            records = {number: (kind, fields(record)) for number, record in described.items()}
            listed = {int(record[1]["id"]): record for record in expected if record[0] == kind}
            assert records == listed, path.name


# --- Chunks that are intact are read, whatever is damaged beside them; what earlier ones misread


CHUNK_START, CHUNK_SIZE, DATA_SIZE, NAME = 9, 25, 41, 37
"""Offsets in a chunk: its start time, the size of its records, the size of its data if its name is
empty, and the length of the name."""

Damage = Callable[[Intact], bytes]


def places(log: Intact, opcode: Opcode) -> list[int]:
    """Return where records of a kind begin."""
    return list(records(log.data, opcode))


def more(data: bytes, at: int, by: int, width: int = 8) -> bytes:
    """Make a number larger."""
    number = int.from_bytes(data[at : at + width], "little") + by
    return over(data, at, number.to_bytes(width, "little"))


def data_size(log: Intact) -> bytes:
    """Let the first chunk claim more compressed data than there is: it ends all the same."""
    at = places(log, Opcode.CHUNK)[0]
    return more(log.data, at + DATA_SIZE + log.data[at + NAME], 64)


def records_size(log: Intact) -> bytes:
    """Let a chunk claim more records than its data holds; its checksum is right."""
    return more(log.data, places(log, Opcode.CHUNK)[2] + CHUNK_SIZE, 1)


def start_behind_damage(log: Intact) -> bytes:
    """Change a chunk's start, and the kind of the record before it."""
    at = places(log, Opcode.CHUNK)[2]
    before = max(end for _, end, _ in log.records if end < at)
    return over(more(log.data, at + CHUNK_START, 1), before, b"\x03")


def index_to_the_end(log: Intact) -> bytes:
    """Let a message index reach to the last eight bytes, and damage the summary."""
    at = places(log, Opcode.MESSAGE_INDEX)[3]
    length = len(log.data) - 8 - at - HEAD
    data = more(log.data, data_end(log.data) + 40, 1, 1)
    return over(data, at + 1, length.to_bytes(8, "little"))


def head_twice(log: Intact) -> bytes:
    """Repeat the first eight bytes of a chunk in front of it."""
    at = places(log, Opcode.CHUNK)[2]
    return log.data[: at + 8] + log.data[at:]


def first_bytes_missing(log: Intact) -> bytes:
    """Leave out what the file begins with; this one has no end either."""
    return log.data[8:]


def beginning_missing(log: Intact) -> bytes:
    """Leave out all before the first chunk."""
    return log.data[places(log, Opcode.CHUNK)[0] :]


def channel_in_the_summary(log: Intact) -> bytes:
    """Let a damaged summary describe the camera's topic by another number as well."""
    at = places(log, Opcode.CHANNEL)[0]
    return over(log.data, at + HEAD, bytes(4))


def number_of_labels_in_the_summary(log: Intact) -> bytes:
    """Number the labels' topic otherwise: what describes it lies where no label does."""
    at = places(log, Opcode.CHANNEL)[1] + HEAD
    return mended(over(log.data, at, b"\xff\xff"))


def beside(log: Intact, tmp_path: Path, damage: Damage) -> tuple[Reading, list[int]]:
    """Read a damaged log; also list the frames that are not read as they were logged."""
    path = tmp_path / "drive.mcap"
    path.write_bytes(damage(log))
    reading = read(path)
    frames = log.frames.items()
    return reading, [log.number_of(frame[0]) for frame in frames if frame not in reading.frames]


@pytest.mark.parametrize(
    ("kind", "damage", "reason"),
    [
        ("zstd", data_size, ""),
        ("lz4", data_size, ""),
        ("no_index", data_size, ""),
        ("no_index", records_size, ""),
        ("zstd", start_behind_damage, ""),
        ("uncompressed", index_to_the_end, "lengths contradict"),
        ("no_index", head_twice, "8 bytes too many"),
        ("no_index", channel_in_the_summary, ""),
        ("unfinished", first_bytes_missing, "never finished"),
        ("unfinished", beginning_missing, "never finished"),
        ("uncompressed", channel_in_the_summary, ""),
        ("uncompressed", number_of_labels_in_the_summary, ""),
    ],
)
def test_every_frame_is_read(tmp_path, kind, damage, reason):
    reading, other = beside(intact_logs()[kind], tmp_path, damage)
    assert len(reading.frames) == INTACT, reading.told
    assert not other
    assert reason in " | ".join(reading.told)
    assert bool(reason) or not reading.told


@pytest.mark.parametrize("by", [-1, 1, 64])
def test_no_message_of_a_chunk_whose_checksum_cannot_be_right_is_read(tmp_path, by):
    """Whether its lengths contradict each other as well, or not."""
    log = intact_logs()["uncompressed"]
    at = places(log, Opcode.CHUNK)[3]

    def damage(log: Intact) -> bytes:
        data = more(log.data, data_end(log.data) + 40, 1, 1)  # the summary cannot help
        data = more(data, at + 1, by)
        mask = at + length_of(log.data, at) - 20
        return over(data, mask, bytes([data[mask] ^ 7]))

    reading, other = beside(log, tmp_path, damage)
    touched = [time for time, blocks in log.blocks.items() if at in (begin for begin, _ in blocks)]
    assert set(other) <= set(map(log.number_of, touched))
    assert reading.told
    assert all(frame == log.frames[time] for time, frame in reading.frames if frame.truth)


def test_an_unchunked_log_whose_data_hides_its_topics_is_read_by_the_summarys_records(tmp_path):
    def damage(log: Intact) -> bytes:
        at = places(log, Opcode.CHANNEL)[0] + 24
        return log.data[:at] + bytes(512) + log.data[at:]

    reading, other = beside(intact_logs()["unchunked"], tmp_path, damage)
    assert not other
    assert "512 bytes too many" in " ".join(reading.told)


def logged(path: Path, messages: int, first: int = 0) -> bytes:
    """A log of JSON messages on one topic, some four in a chunk."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=2_000, compression=CompressionType.NONE)
        writer.start()
        channel = writer.register_channel("/a", "json", 0)
        for number in range(first, first + messages):
            data = b'{"n":%d,"fill":"%s"}' % (number, b"x" * 480)
            writer.add_message(channel, 1_000 * number, data, 1_000 * number)
        writer.finish()
    return path.read_bytes()


def told_of(tmp_path: Path, data: bytes) -> tuple[int, list[str]]:
    """The number of messages that a log gives, and what is said about it."""
    path = tmp_path / "read.mcap"
    path.write_bytes(data)
    with open_log(path) as log:
        log.verify()
        return log.topics[0].count, [str(damage) for damage in log.damage]


@pytest.mark.parametrize("logs", [1, 2, 3])
def test_logs_joined_end_to_end_are_read_one_after_the_other(tmp_path, logs):
    parts = [logged(tmp_path / f"{n}.mcap", 12, first=12 * n) for n in range(logs)]
    count, told = told_of(tmp_path, b"".join(parts))
    assert count == 12 * logs
    assert sum("another log begins here" in damage for damage in told) == logs - 1
    assert "are missing" not in " ".join(told)


def test_a_chunk_that_lies_in_a_message_is_no_chunk_of_the_log(tmp_path):
    inner = logged(tmp_path / "inner.mcap", 8)
    with (tmp_path / "outer.mcap").open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE, use_chunking=False)
        writer.start()
        channel = writer.register_channel("/a", "json", 0)
        writer.add_message(channel, 0, inner, 0)
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    count, _ = told_of(tmp_path, (tmp_path / "outer.mcap").read_bytes())
    assert count == 2


def test_a_log_that_is_a_link_to_itself_is_one_line(tmp_path):
    path = tmp_path / "loop.mcap"
    path.symlink_to(path)
    with pytest.raises(LogError) as caught:
        open_log(path)
    assert "\n" not in str(caught.value)


def millions_of_empty_records() -> bytes:
    records = (b"\x80" + bytes(8)) * 8_000_000
    return chunk_record(zstandard.compress(records), "zstd", len(records), zlib.crc32(records))


def chunks_of_a_wrong_size_that_unpack_to_gigabytes() -> bytes:
    return 50 * chunk_record(zstandard.compress(bytes(256 << 20)), "zstd", 1_000, 12_345)


@pytest.mark.parametrize(
    ("bomb", "seconds"),
    [(millions_of_empty_records, 10), (chunks_of_a_wrong_size_that_unpack_to_gigabytes, 5)],
)
def test_bombs_take_seconds(tmp_path, bomb, seconds):
    data, chunks = logged(tmp_path / "whole.mcap", 4), bomb()
    at = broken.chunk(0, data)
    began = process_time()
    count, told = told_of(tmp_path, data[:at] + chunks + data[at:])
    assert process_time() - began < seconds
    assert count == 4
    assert told


@pytest.mark.parametrize("folder", shared("failures"))
@pytest.mark.parametrize(
    ("name", "frames", "said"),
    [
        ("hole_in_chunk_0", 15, "lost: 4 of /camera/image"),
        ("schema_byte_changed", 6, "that is believed; messages fit it better"),
        ("schema_byte_intact", 6, ""),
    ],
)
def test_each_known_failure_is_read_and_said(folder, name, frames, said):
    began = process_time()
    with open_log(folder / f"{name}.mcap") as log:
        log.verify()
        assert {topic.count for topic in log.topics} == {frames}
        told = " ".join(map(str, log.damage))
    assert said in told
    assert bool(said) == bool(told)
    assert process_time() - began < 10

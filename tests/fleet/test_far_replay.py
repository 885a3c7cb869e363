"""Replays of a log behind a URL: what they read, in how many requests, and their tables."""

import io
import random
import re
from datetime import timedelta
from itertools import islice, pairwise

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rich.console import Console

import roadeval
from roadeval.cli.screens import replay as screen
from roadeval.errors import RoadevalError
from roadeval.fleet import remote
from roadeval.fleet.remote import open_source
from roadeval.logs.frames import merge_streams
from roadeval.logs.log import open_log
from tests.fleet.serving import CONTENT, Server
from tests.fleet.test_far_info import chunks_of, has_long_indexes, is_moved, rewrite_summary, spoil
from tests.jobs.making import settings, write_log

FRAMES = 90
CHUNK = 300_000
LIDAR = 100_000
"""Bytes of the message beside each frame: a chunk holds three frames."""
RANGE = {"start": 5, "max_frames": 12, "train_frames": 4}
"""Frames of five chunks at most."""


@pytest.fixture
def server(tmp_path, monkeypatch):
    """A server whose errors are not waited for; logs of more than a megabyte are large."""
    for module in ("logs.log", "logs.topics.reader"):
        monkeypatch.setattr(f"roadeval.{module}.SMALL", 1_000_000)
    pause = {"init_backoff": timedelta(milliseconds=1), "max_backoff": timedelta(milliseconds=9)}
    monkeypatch.setattr(remote, "RETRIES", {"max_retries": 2, "backoff": pause})
    with Server(tmp_path) as server:
        yield server


def long_log(path, *, labels_last=False, **options):
    """Write small frames with their labels beside large messages; or the labels behind all."""
    noise, channels = np.random.default_rng(0), dict[int, int]()
    bare = write_log(path.with_suffix(".bare"), numbers=range(FRAMES))
    with bare.open("rb") as source, path.open("wb") as file:
        options = {"chunk_size": CHUNK, "compression": CompressionType.NONE} | options
        writer = Writer(file, **options)
        writer.start()
        lidar = writer.register_channel("/lidar", "", writer.register_schema("cloud", "", b""))
        messages = [*make_reader(source).iter_messages()]
        if labels_last:
            messages.sort(key=lambda message: message[1].topic != "/camera/image")
        for schema, channel, message in messages:
            if channel.id not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(channel.topic, "protobuf", number)
            time = message.log_time
            if channel.topic == "/camera/image":
                writer.add_message(lidar, time, noise.bytes(LIDAR), time)
            writer.add_message(channels[channel.id], time, message.data, time)
        writer.finish()
    return path


def tables(drive, folder, **frames):
    """Replay a drive; return its outcome, tables, losses and identity."""
    outcome = roadeval.replay(drive, settings(record="none", **frames), reports=folder)
    files = {file.name: file.read_bytes() for file in folder.glob("*.csv")}
    assert "frames.csv" in files
    return outcome, (files, outcome.losses, outcome.facts.log.digest)


def test_a_range_reads_its_chunks_and_the_indexes_of_the_others(server, tmp_path):
    path = long_log(tmp_path / "drive.mcap")
    outcome, far = tables(server.url("drive.mcap"), tmp_path / "far", **RANGE)
    assert far == tables(path, tmp_path / "near", **RANGE)[1]
    # Its chunks, and samples of ten labels all over the log.
    assert server.sent < (5 + 10) * CHUNK + 500_000 < path.stat().st_size * 0.6
    traffic = outcome.traffic
    assert (traffic.requests, traffic.bytes) == (len(server.requests), server.sent)
    assert traffic.total == path.stat().st_size


def test_of_a_range_without_labels_little_but_its_chunks_is_read(server, tmp_path):
    path = long_log(tmp_path / "drive.mcap")
    config = settings(record="none", source="patch", truth="", **RANGE)
    for drive, folder in ((server.url("drive.mcap"), "far"), (path, "near")):
        roadeval.replay(drive, config, reports=tmp_path / folder)
    files = [(tmp_path / folder / "unlabelled.csv").read_bytes() for folder in ("far", "near")]
    assert files[0] == files[1]
    assert server.sent < (5 + 1) * CHUNK + 300_000  # its chunks, and the first one


def test_the_whole_is_read_once(server, tmp_path):
    path = long_log(tmp_path / "drive.mcap")
    _, far = tables(server.url("drive.mcap"), tmp_path / "far")
    assert far == tables(path, tmp_path / "near")[1]
    assert server.sent < 1.1 * path.stat().st_size


def test_indexes_samples_and_frames_are_asked_for_several_at_once(server, tmp_path):
    long_log(tmp_path / "drive.mcap")
    server.latency = 0.1
    most = {}

    def note(what):
        most[what], server.waiting.most = server.waiting.most, 0

    for some in (range(FRAMES), range(4, FRAMES, 9)):
        with open_log(open_source(server.url("drive.mcap"))) as log:
            note("indexes")
            selection = log.select()
            note("samples")
            stream = log.frames(selection, some)
            assert len([*(merge_streams([stream]) if len(some) == FRAMES else stream)]) == len(some)
            note(f"{len(some)} frames")
    assert all(2 < count <= remote.AT_ONCE + 1 for count in most.values()), most


@pytest.mark.sweep
def test_what_reads_much_asks_for_several_parts_at_once(server, tmp_path):
    path = long_log(tmp_path / "drive.mcap", enable_crcs=False, enable_data_crcs=True)
    server.latency = 0.1
    for name in ("fingerprint", "verify_data", "verify"):
        with open_log(open_source(server.url("drive.mcap"))) as log:
            server.waiting.most = 0
            assert len([*islice(getattr(log.containers[0], name)() or (), 9)]) in (0, 9)
        assert server.waiting.most > 2, name
    cut(path)
    server.waiting.most = server.sent = 0
    open_log(open_source(server.url("drive.mcap"))).close()
    assert server.waiting.most > 2
    assert server.sent < 1.1 * path.stat().st_size


@pytest.mark.sweep
def test_labels_behind_all_images_are_read_ahead_beside_them(server, tmp_path):
    path = long_log(tmp_path / "drive.mcap", labels_last=True, chunk_size=CHUNK // 3)
    _, far = tables(server.url("drive.mcap"), tmp_path / "far")
    assert far == tables(path, tmp_path / "near")[1]
    assert server.sent < 1.1 * path.stat().st_size


def spoil_in_range(path):
    """Damage the data of a chunk of the range."""
    spoil(path, next(c for c in chunks_of(path) if c.message_start_time >= 5_500_000_000))


def cut(path):
    """Keep the part of a log that was written before the power failed, within the range."""
    path.write_bytes(path.read_bytes()[: int(0.66 * path.stat().st_size)])


def lose_summary(path):
    """Cut off the last byte."""
    path.write_bytes(path.read_bytes()[:-1])


def lie_on_places(path):
    """Let the summary list chunks where there are none."""
    rewrite_summary(path, is_moved)


def lie_on_indexes(path):
    """Let the summary claim indexes that are longer than the log."""
    rewrite_summary(path, has_long_indexes)


def double(path):
    """Let another log follow in the same file."""
    path.write_bytes(path.read_bytes() * 2)


DAMAGES = (spoil_in_range, cut, lose_summary, lie_on_places, lie_on_indexes, double)


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_log_gives_what_it_gives_on_a_disk(server, tmp_path, damage):
    path = long_log(tmp_path / "drive.mcap", compression=CompressionType.ZSTD)
    damage(path)
    _, far = tables(server.url("drive.mcap"), tmp_path / "far", **RANGE)
    assert far == tables(path, tmp_path / "near", **RANGE)[1]
    assert bool(far[1]) == (damage in (spoil_in_range, cut))


@pytest.mark.parametrize("options", [{"enable_crcs": False}, {"use_chunking": False}])
def test_a_log_without_checksums_or_chunks_gives_what_it_gives_on_a_disk(server, tmp_path, options):
    path = long_log(tmp_path / "drive.mcap", **options)
    _, far = tables(server.url("drive.mcap"), tmp_path / "far", **RANGE)
    assert far == tables(path, tmp_path / "near", **RANGE)[1]


@pytest.mark.parametrize("requests", [3, 30, 40])
def test_a_server_that_fails_halfway_is_told_in_one_line(server, tmp_path, requests):
    long_log(tmp_path / "drive.mcap")
    server.fails_after = requests
    with pytest.raises(RoadevalError) as error:
        tables(server.url("drive.mcap"), tmp_path / "far")
    assert str(error.value) == f"{server.url('drive.mcap')}: the server cannot give it"
    assert not (tmp_path / "far").exists()


def test_the_terminal_tells_how_much_was_read_of_how_much(server, tmp_path):
    path = long_log(tmp_path / "drive.mcap")
    far, near = (
        tables(drive, tmp_path / folder, **RANGE)[0]
        for drive, folder in ((server.url("drive.mcap"), "far"), (path, "near"))
    )
    shown = []
    for outcome in (far, near):
        out = Console(width=120, file=io.StringIO())
        screen.show(outcome, out)
        shown.append(out.file.getvalue().splitlines())
    amount = f"{server.sent / 1e6:.1f} of {path.stat().st_size / 1e6:.1f} MB"
    assert shown[0][1] == f"read {amount} in {len(server.requests)} requests"
    assert not any(line.startswith("read ") for line in shown[1])


def test_what_is_expected_or_not_is_read_right_and_little_is_asked_for_ahead():
    chance = random.Random(0)
    with Server() as server:
        file = open_source(server.url("whole/a.mcap")).file
        for _ in range(12):
            begins = [chance.randrange(len(CONTENT)) for _ in range(chance.randrange(50))]
            parts = [(begin, begin + chance.choice((0, 300, 3_000_000))) for begin in begins]
            file.expect(parts)
            for begin, end in chance.sample(parts, len(parts) // 2):
                file.seek(max(begin - chance.choice((0, 0, 5)), 0))
                at, size = file.seek(max(begin - 5, 0)), min(end - begin + 9, 50_000)
                assert file.read(size) == CONTENT[at : at + size]
        sizes = [int(end) - int(begin) for begin, end in map(bounds, server.requests[1:])]
        assert max(sizes) < remote.PIECE
        server.sent = 0
        file.expect([(0, len(CONTENT))])
        file.close()
        assert server.sent <= remote.AT_ONCE * remote.PIECE


def test_parts_that_adjoin_are_asked_for_together_and_once_in_whatever_order_they_are_read(
    monkeypatch,
):
    monkeypatch.setattr(remote, "AT_ONCE", 2)
    parts = [(begin, begin + 9000) for begin in range(0, 9_000_000, 10_000)]
    with Server() as server:
        file = open_source(server.url("whole/a.mcap")).file
        within = [(begin + 1000, end - 1000) for begin, end in parts]
        file.expect([part for both in zip(parts, within, strict=True) for part in both] * 2)
        for begin, end in (*parts[840:860], *parts[:832]):
            file.seek(begin)
            assert file.read(end - begin) == CONTENT[begin:end]
        asked = sorted(tuple(map(int, bounds(request))) for request in server.requests[1:])
    assert len(asked) == 9
    assert all(one[1] < two[0] for one, two in pairwise(asked))


def bounds(request):
    """The first and the last byte that a request asks for."""
    return re.fullmatch(r"bytes=(\d+)-(\d+)", request[2]["range"]).groups()


def test_a_part_is_asked_for_once_whatever_is_read_of_it(server, tmp_path):
    path = long_log(tmp_path / "drive.mcap")
    with open_log(open_source(server.url("drive.mcap"))) as log:
        walked = len(server.requests)
        log.verify()
        ranges = [headers["range"] for method, _, headers in server.requests if method == "GET"]
    assert walked <= len(chunks_of(path)) + 8
    assert len(ranges) <= len({*ranges}) + 1  # the end is read once more

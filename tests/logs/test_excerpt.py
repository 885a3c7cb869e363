"""A part of a log: the messages of all topics of a span, as they were logged."""

from collections import Counter

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_ros2._dynamic import serialize_dynamic

from roadeval.logs.log import open_log
from tests.fixtures.make import make
from tests.logs.making import COMPRESSED, SECOND, compressed, grey, jpeg, ros2_log

TENTH = SECOND // 10


def write(path, beginning=0, frames=100):
    """A camera at 10 Hz, labels a quarter of a second later, other topics, and what stands."""
    encode = serialize_dynamic("sensor_msgs/msg/CompressedImage", COMPRESSED)
    encode = encode["sensor_msgs/msg/CompressedImage"]
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=2000)
        writer.start("ros2", "test")
        picture = writer.register_schema(
            "sensor_msgs/msg/CompressedImage", "ros2msg", COMPRESSED.encode()
        )
        other = {
            name: writer.register_schema(name, "ros2msg", b"uint8 x\n")
            for name in ("tf2_msgs/msg/TFMessage", "sensor_msgs/msg/CameraInfo", "sensor_msgs/Imu")
        }
        transforms, info, imu = other.values()
        qos = {"offered_qos_profiles": "- durability: 1"}
        channels = {
            "/camera": writer.register_channel("/camera", "cdr", picture),
            "/labels": writer.register_channel("/labels", "cdr", picture),
            "/imu": writer.register_channel("/imu", "cdr", imu),
            "/bare": writer.register_channel("/bare", "json", 0),
            "/camera_info": writer.register_channel("/camera_info", "cdr", info),
            "/tf_static": writer.register_channel("/tf_static", "cdr", transforms, qos),
            "/tf": writer.register_channel("/tf", "cdr", transforms),
        }
        for number in range(beginning, beginning + frames):
            time = (number + 1) * TENTH
            data = encode(compressed(time, jpeg(grey(number))))
            messages = [("/camera", time, data), ("/labels", time + TENTH * 5 // 2, data)]
            messages += [("/imu", time + 3, b"imu"), ("/bare", time, b"{}"), ("/tf", time, b"tf")]
            messages += [("/camera_info", time, b"%d" % number)] if number % 50 == 0 else []
            messages += [("/tf_static", time, b"%d" % number)] if number in (0, 1) else []
            for topic, log_time, content in messages:
                writer.add_message(channels[topic], log_time, content, log_time - 1, number)
        writer.finish()
    return path


def written(path):
    with path.open("rb") as file:
        return [
            (channel.topic, schema and schema.name, channel.metadata, message)
            for schema, channel, message in make_reader(file).iter_messages()
        ]


@pytest.fixture(params=["file", "split"])
def log(request, tmp_path):
    if request.param == "file":
        return write(tmp_path / "drive.mcap")
    (tmp_path / "drive").mkdir()
    write(tmp_path / "drive" / "drive_0.mcap", 0, 47)
    write(tmp_path / "drive" / "drive_1.mcap", 47, 53)
    return tmp_path / "drive"


def test_an_excerpt_has_all_topics_from_two_seconds_before_to_the_last_frames_end(log, tmp_path):
    with open_log(log, every_topic=True) as opened:
        opened.write_excerpt("/camera", 40, 49, tmp_path / "part.mcap")
        assert opened.losses == ()
    messages = written(tmp_path / "part.mcap")
    begin = 41 * TENTH - 2 * SECOND
    assert Counter(topic for topic, *_ in messages) == {
        "/camera": 30,
        "/labels": 30 + 2,  # two of them are logged after the end
        **dict.fromkeys(("/imu", "/bare", "/tf"), 30),
        "/camera_info": 1,
        "/tf_static": 2,
    }
    standing = {topic: m for topic, _, _, m in messages if topic in ("/camera_info", "/tf_static")}
    assert {m.log_time for m in standing.values()} == {begin}
    assert standing["/camera_info"].data == b"0"
    assert standing["/camera_info"].publish_time == TENTH - 1
    files = [log] if log.is_file() else [*log.iterdir()]
    before = {
        (t, s, str(q), m.publish_time, m.sequence, m.data)
        for f in files
        for t, s, q, m in written(f)
    }
    after = {(t, s, str(q), m.publish_time, m.sequence, m.data) for t, s, q, m in messages}
    assert after < before
    times = [m.log_time for *_, m in messages]
    assert times == sorted(times)
    assert all(m.log_time in (m.publish_time + 1, begin) for *_, m in messages)


def test_where_all_stamps_are_equal_nothing_later_is_taken_for_a_label(tmp_path):
    images = [("/camera", at * TENTH, compressed(7, jpeg(grey(at)))) for at in range(50)]
    with open_log(ros2_log(tmp_path / "drive.mcap", images), every_topic=True) as log:
        log.write_excerpt("/camera", 24, 25, tmp_path / "part.mcap")
    assert [m.log_time // TENTH for *_, m in written(tmp_path / "part.mcap")] == [*range(4, 26)]


def test_the_video_of_an_excerpt_begins_at_a_keyframe(tmp_path):
    """Every fourth frame is one; here the frames are a second apart."""
    with make("flavours/fox_pb_CompressedVideo_h264.mcap", tmp_path).open("rb") as file:
        messages = [*make_reader(file).iter_messages()]
    with (tmp_path / "slow.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema, channel, _ = messages[0]
        number = writer.register_schema(schema.name, schema.encoding, schema.data)
        video = writer.register_channel(channel.topic, channel.message_encoding, number)
        for second, (*_, message) in enumerate(messages):
            writer.add_message(video, second * SECOND, message.data, message.publish_time)
        writer.finish()
    with open_log(tmp_path / "slow.mcap", every_topic=True) as log:
        log.write_excerpt(channel.topic, 7, 8, tmp_path / "part.mcap")
    assert len(written(tmp_path / "part.mcap")) == 5
    with open_log(tmp_path / "part.mcap") as part:
        assert [frame.decode().number for frame in part.frames(part.select())] == [*range(5)]

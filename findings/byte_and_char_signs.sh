#!/usr/bin/env bash
# Two libraries that decode ROS 2 messages disagree on the signs of `byte` and of `char`, in turn.
#
# Software: mcap-ros2-support 0.6.0 and rosbags 0.11.9, with numpy 2.4.6.
#
# Both decode the same bytes of a message by the same definition. The bits of 200 are
#
#            mcap_ros2   rosbags
#     byte      200        -56
#     char      -56        200
#     int8      -56        -56
#     uint8     200        200
#
# and arrays of these types likewise. So `byte` and `char` cannot be compared between tools, and a
# script that changes its library gets other numbers from the same log, without an error.
#
# Both give the bits as `value & 0xFF`.
#
# Source: the table of readers in mcap_ros2/_dynamic.py has `uint8` for byte and `int8` for char;
# rosbags/serde/primitives.py unpacks a byte as "b", with a sign, and a char as "B".
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  mcap-ros2-support==0.6.0 rosbags==0.11.9 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import io

from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

TYPES = ("byte", "char", "int8", "uint8")
NAME = "car_msgs/msg/State"
TEXT = "".join(f"{kind} {kind}_one\n{kind}[2] {kind}_two\n" for kind in TYPES)
MESSAGE = b"\0\1\0\0" + bytes([200]) * 3 * len(TYPES)

file = io.BytesIO()
writer = Writer(file)
writer.start(profile="ros2")
schema = writer.register_schema(NAME, "ros2msg", TEXT.encode())
channel = writer.register_channel("/state", "cdr", schema)
writer.add_message(channel, log_time=0, data=MESSAGE, publish_time=0)
writer.finish()
file.seek(0)
reader = make_reader(file, decoder_factories=[DecoderFactory()])
((_, _, _, by_mcap),) = reader.iter_decoded_messages()

types = get_typestore(Stores.ROS2_JAZZY)
types.register(get_types_from_msg(TEXT, NAME))
by_rosbags = types.deserialize_cdr(MESSAGE, NAME)


def values(message, kind):
    one, two = getattr(message, f"{kind}_one"), getattr(message, f"{kind}_two")
    assert [int(value) for value in two] == [one] * 2
    assert one & 0xFF == 200
    return one


found = {kind: (values(by_mcap, kind), values(by_rosbags, kind)) for kind in TYPES}
for kind, (mcap, rosbags) in found.items():
    print(f"{kind}: mcap_ros2 {mcap}, rosbags {rosbags}")
assert found == {"byte": (200, -56), "char": (-56, 200), "int8": (-56, -56), "uint8": (200, 200)}
PYTHON

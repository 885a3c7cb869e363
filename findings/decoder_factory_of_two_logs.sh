#!/usr/bin/env bash
# One DecoderFactory of mcap that reads two logs decodes the second by the definitions of the first.
#
# Software: mcap 1.6.0 with mcap-ros2-support 0.6.0, mcap-ros1-support 0.9.0 and
# mcap-protobuf-support 0.6.0.
#
# A message has the fields `speed` and `steering`, and the next release of its package has them the
# other way round. A log of each release stores its own definition, and a factory of its own reads
# each of them rightly. One factory that was made before the loop over the logs gives the values of
# the second log under the wrong names: 12.5 m/s become a steering angle. Nothing is raised, and the
# schema that the reader returns beside the message is the right one. ROS 2, ROS 1 and protobuf are
# all alike in this.
#
# So each log needs factories of its own.
#
# Source: `decoder_for` in mcap_ros2/decoder.py, mcap_ros1/decoder.py and mcap_protobuf/decoder.py
# keeps decoders by `schema.id`. An id counts within one file, and writers begin with 1.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check mcap==1.6.0 \
  mcap-ros2-support==0.6.0 mcap-ros1-support==0.9.0 mcap-protobuf-support==0.6.0
"$folder/venv/bin/python" - <<'PYTHON'
import io
import struct

import mcap_protobuf.decoder
import mcap_ros1.decoder
import mcap_ros2.decoder
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorSet
from mcap.reader import make_reader
from mcap.writer import Writer

VALUES = {"speed": 12.5, "steering": -0.25}
RELEASES = (["speed", "steering"], ["steering", "speed"])


def ros(fields):
    return "".join(f"float32 {name}\n" for name in fields).encode()


def protobuf(fields):
    files = FileDescriptorSet()
    file = files.file.add(name="car.proto", package="car_msgs", syntax="proto3")
    message = file.message_type.add(name="State")
    optional, float32 = FieldDescriptorProto.LABEL_OPTIONAL, FieldDescriptorProto.TYPE_FLOAT
    for number, name in enumerate(fields, 1):
        message.field.add(name=name, number=number, type=float32, label=optional)
    return files.SerializeToString()


def packed(fields):
    return b"".join(struct.pack("<f", VALUES[name]) for name in fields)


def tagged(fields):  # a field's number and the wire type of 32 bits, then its value
    return b"".join(
        bytes([8 * number + 5]) + struct.pack("<f", VALUES[name])
        for number, name in enumerate(fields, 1)
    )


FORMATS = {
    "ros2": ("car_msgs/msg/State", "ros2msg", "cdr", ros, lambda f: b"\0\1\0\0" + packed(f)),
    "ros1": ("car_msgs/State", "ros1msg", "ros1", ros, packed),
    "protobuf": ("car_msgs.State", "protobuf", "protobuf", protobuf, tagged),
}
FACTORIES = {
    "ros2": mcap_ros2.decoder.DecoderFactory,
    "ros1": mcap_ros1.decoder.DecoderFactory,
    "protobuf": mcap_protobuf.decoder.DecoderFactory,
}


def log(name, fields):
    schema, kind, encoding, define, encode = FORMATS[name]
    file = io.BytesIO()
    writer = Writer(file)
    writer.start()
    number = writer.register_schema(schema, kind, define(fields))
    channel = writer.register_channel("/car", encoding, number)
    writer.add_message(channel, log_time=0, data=encode(fields), publish_time=0)
    writer.finish()
    file.seek(0)
    return file


def read(file, factory):
    reader = make_reader(file, decoder_factories=[factory])
    ((schema, _, _, message),) = reader.iter_decoded_messages()
    return schema.data, {name: getattr(message, name) for name in VALUES}


exchanged = {"speed": VALUES["steering"], "steering": VALUES["speed"]}
for name, make in FACTORIES.items():
    define, shared = FORMATS[name][3], make()
    for fields, wrong in zip(RELEASES, (VALUES, exchanged)):
        schema, values = read(log(name, fields), shared)
        print(f"{name}: one factory for both logs: {values}")
        assert schema == define(fields)
        assert values == wrong
        assert read(log(name, fields), make()) == (schema, VALUES)
PYTHON

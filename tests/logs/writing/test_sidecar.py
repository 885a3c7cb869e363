"""Results written back to MCAP, for people who live in Foxglove."""

import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from roadeval.data import (
    ERRORS,
    Counts,
    Frame,
    FrameResult,
    Layer,
    Output,
    Packed,
    Role,
    StageResult,
    Tally,
    VariantResult,
)
from roadeval.logs.writing.writer import SidecarWriter

MASK = np.array([[0, 1]], np.uint8)
RATES = {"ERR": 0.5, "TNR": math.nan}
STAMP, LOGGED = 1_700_000_000_000_000_005, 1_700_000_000_007_000_000


def result() -> FrameResult:
    frame = Frame(3, STAMP, LOGGED, np.zeros((1, 2, 3), np.uint8), b"")
    stage = StageResult("post", Output(mask=Packed.of(MASK)), 0.0)
    return FrameResult(
        frame,
        Role.EVALUATED,
        (VariantResult("filtered", (stage,)),),
        errors={"filtered": Layer(ERRORS, np.array([[2, 1]], np.uint8))},
        tallies=(Tally("filtered", "post", Counts(tp=1, fp=1), rates=RATES),),
    )


def write(path: Path, frame_id: str = "cam_front", camera: str = "") -> Path:
    with SidecarWriter(path) as sidecar:
        sidecar.write(result(), frame_id, camera)
    return path


def image(data: bytes) -> list[list[list[int]]]:
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels.ndim == 3:
        pixels = cv2.cvtColor(pixels, cv2.COLOR_BGRA2RGBA)
    values: list[list[list[int]]] = pixels.tolist()
    return values


@pytest.mark.parametrize(("source", "frame_id"), [("cam_front", "cam_front"), ("", "camera")])
def test_masks_are_in_the_frame_of_the_camera(tmp_path: Path, source: str, frame_id: str) -> None:
    with write(tmp_path / "results.mcap", source, "/front").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        frame_ids = {
            channel.topic: message.frame_id
            for _, channel, _, message in reader.iter_decoded_messages(
                ["/roadeval/front/filtered/post", "/roadeval/front/filtered/errors"]
            )
        }
    assert frame_ids == {
        f"/roadeval/front/filtered/{name}": frame_id for name in ("post", "errors")
    }


def test_masks_and_errors_bear_the_images_own_times(tmp_path: Path) -> None:
    with write(tmp_path / "results.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        topics = ["/roadeval/filtered/post", "/roadeval/filtered/errors"]
        messages = {
            channel.topic: (message.log_time, decoded.timestamp.ToNanoseconds(), decoded.data)
            for _, channel, message, decoded in reader.iter_decoded_messages(topics)
        }
    assert {times[:2] for times in messages.values()} == {(LOGGED, STAMP)}
    assert image(messages[topics[0]][2]) == [[0, 255]]
    assert image(messages[topics[1]][2]) == [[[213, 94, 0, 220], [0, 158, 115, 160]]]


def test_metrics_are_json_with_a_schema_and_undefined_rates_are_null(tmp_path: Path) -> None:
    with write(tmp_path / "results.mcap").open("rb") as file:
        messages = make_reader(file).iter_messages(["/roadeval/metrics/filtered/post"])
        ((schema, channel, message),) = messages
    assert schema is not None
    assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
    fields = json.loads(message.data)
    properties = json.loads(schema.data)["properties"]
    assert set(properties) == set(fields)
    # Foxglove takes what has this title for a time.
    assert properties["timestamp"]["title"] == "time"
    assert fields["timestamp"] == {"sec": STAMP // 10**9, "nsec": 5}
    assert (fields["TP"], fields["FP"], fields["N"]) == (1, 1, 2)
    assert (fields["ERR"], fields["TNR"]) == (0.5, None)

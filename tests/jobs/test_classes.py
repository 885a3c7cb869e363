"""Classes of a drive's truth in its results: as a plain judge counts them, or none."""

from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from roadeval import Result, replay
from roadeval.results.sentences import describe_classes
from tests.fixtures.shared import shared
from tests.jobs.making import settings


def ids_in(path):
    """The label images of a drive's topic of ids, in order, by the MCAP project's own reader."""
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        messages = reader.iter_decoded_messages(topics=["/labels/semantic"])
        images = [message for *_, message in messages]
    images.sort(key=lambda image: (image.header.stamp.sec, image.header.stamp.nanosec))
    return [np.frombuffer(bytes(i.data), np.uint8).reshape(i.height, i.width) for i in images]


@pytest.mark.parametrize("drive", shared("drives", "camvid_0016E5_15hz.mcap"))
def test_classes_of_a_drive_of_ids_are_those_of_a_plain_judge(drive: Path, tmp_path):
    pixels, road = np.zeros(256, np.int64), np.zeros(256, np.int64)
    ids, frames = ids_in(drive), list[int]()

    def judge(result):
        if result.tallies:
            frames.append(result.frame.number)
            labels = ids[result.frame.number]
            mask = result.variants[0].final()
            pixels[:] += np.bincount(labels.ravel(), minlength=256)
            road[:] += np.bincount(labels[mask == 1], minlength=256)

    config = settings(road=[3], ignore=[11], max_frames=13, train_frames=8, record="none")
    config = config.override({"only": ["unfiltered"], "labels": {"names": {"4": "pavement"}}})
    replay(drive, config, reports=tmp_path / "reports", on_frame=judge)
    rows = Result(tmp_path / "reports").table("classes")
    of_variant = rows[rows["variant"] == "unfiltered"]
    assert of_variant["class"].tolist() == np.flatnonzero(pixels).tolist()
    assert of_variant["pixels"].tolist() == pixels[pixels > 0].tolist()
    assert of_variant["road"].tolist() == road[pixels > 0].tolist()
    assert {*of_variant["frames"]} == {len(frames)}
    assert of_variant.set_index("class")["truth"].loc[[3, 4, 11]].tolist() == [
        *("road", "other", "ignored")
    ]
    false = np.delete(road, [3, 11])
    first = describe_classes(rows, "unfiltered")["false"]
    assert first.startswith(f"{100 * road[4] / false.sum():.0f} % of the false road is pavement")


@pytest.mark.parametrize("drive", shared("drives", "camvid_0006R0_1hz.mcap"))
def test_a_drive_of_plain_masks_has_no_table_of_classes(drive: Path, tmp_path):
    config = settings(max_frames=13, train_frames=8, record="none")
    replay(drive, config.override({"only": ["unfiltered"]}), reports=tmp_path / "reports")
    assert not (tmp_path / "reports" / "classes.csv").exists()
    assert Result(tmp_path / "reports").table("classes").empty

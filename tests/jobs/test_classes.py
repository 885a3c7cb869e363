"""Classes of a drive's truth in its results: as a plain judge counts them, or none."""

import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from roadeval import Result, replay, replay_fleet, write_report
from roadeval.evaluation.tables import by_class, only
from roadeval.results.why import describe_classes
from tests.e2e.test_fleet import Here
from tests.fixtures.logged import write_drive
from tests.fixtures.shared import shared
from tests.jobs.making import NS, settings
from tests.training.making import frame


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

    config = settings(road=[3], ignore=[11], max_frames=13, train_frames=8, record="worst:1")
    config = config.override({"only": ["unfiltered"], "labels": {"names": {"4": "pavement"}}})
    to = {"save": tmp_path / "out.rrd", "reports": tmp_path / "reports"}
    replay(drive, config, **to, on_frame=judge)
    rows = Result(to["reports"]).table("classes")
    pd.testing.assert_frame_equal(Result(to["save"]).table("classes"), rows)
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


def write_ids(path: Path, width: int) -> None:
    """Write a drive with the ids of road (3), verge (4) and car (8), of so many columns."""

    def messages(number):
        made = frame(number + width)
        labels = np.where(made.truth == 1, 3, 4).astype(np.uint8)
        labels[:12, :width] = 8
        made.image[8:12] = made.image[20:]  # the verge's last rows look like road
        return {"/camera/image": made.image, "/labels": labels}

    write_drive(path, (((number + 1) * NS, messages(number)) for number in range(14)))


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    """A fleet of two drives whose verge is of two classes, the second one rarer in drive b."""
    folder = tmp_path_factory.mktemp("fleet")
    logs = folder / "logs"
    logs.mkdir()
    for name, width in (("a", 16), ("b", 4)):
        write_ids(logs / f"{name}.mcap", width)
    config = settings(road=["road"], train_frames=4, only=["unfiltered"])
    config = config.override({"labels": {"names": {"3": "road", "4": "verge", "8": "car"}}})
    replay_fleet([logs], folder / "f", config, executor=Here())
    return folder / "f"


def test_a_fleet_has_the_classes_of_its_drives_and_says_their_mean(fleet, tmp_path):
    rows = Result(fleet).table("classes")
    of_drives = [
        Result(path).table("classes")
        for path in sorted((fleet / "results").iterdir())
        if path.is_dir()
    ]
    assert rows["road"].tolist() == [*of_drives[0]["road"], *of_drives[1]["road"]]
    shares = by_class(only(rows, variant="unfiltered"))["false"]
    parts = [by_class(only(part, variant="unfiltered"))["false"] for part in of_drives]
    assert shares["verge"] == pytest.approx((parts[0]["verge"] + parts[1]["verge"]) / 2)
    sentence = describe_classes(rows, "unfiltered")["false"]
    assert re.fullmatch(
        r"6\d % of the false road is verge, 3\d % car \(mean of 2 drives\)\.", sentence
    )
    page = write_report(fleet, tmp_path / "fleet.html").read_text()
    assert sentence in page


def test_a_fleet_from_before_classes_were_counted_has_none(fleet, tmp_path):
    old = shutil.copytree(fleet, tmp_path / "f")
    shutil.rmtree(old / "classes")
    (old / "classes.parquet").unlink()
    assert Result(old).table("classes").empty
    assert "What is taken for road" not in write_report(old, tmp_path / "fleet.html").read_text()

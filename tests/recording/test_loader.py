"""Our recordings beside those that Rerun itself makes of an MCAP file."""

import subprocess
from pathlib import Path

import numpy as np
import pytest
import rerun_cli
from rerun.chunk import RrdReader

import roadeval
from roadeval.recording.layout import FOXGLOVE_TIME, HEADER_TIME, LOG_TIME
from tests.jobs.making import write_log
from tests.logs.topics.test_calibration import info, ros2

LOADER = (HEADER_TIME, FOXGLOVE_TIME, LOG_TIME)
RERUN = next(Path(rerun_cli.__file__).parent.glob("rerun*"))


def times(path: Path, entity: str) -> dict[str, list[int]]:
    """The times of an entity's images in a recording, by timeline."""
    found: dict[str, list[int]] = {}
    reader = RrdReader(path)
    for entry in reader.recordings():
        for chunk in reader.stream(store=entry):
            batch = chunk.to_record_batch()
            if chunk.entity_path == entity and "EncodedImage:blob" in batch.schema.names:
                for name in {*batch.schema.names} & {*LOADER}:
                    times = batch.column(name).cast("int64").to_pylist()
                    found[name] = [*found.get(name, []), *times]
    return found


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("both")
    log = ros2(folder / "a.mcap", {"/front/camera_info": info()})
    roadeval.replay(log, save=folder / "out.rrd", reports=folder / "reports")
    convert = [RERUN, "mcap", "convert", log, "-o", folder / "log.rrd"]
    subprocess.run(convert, check=True, capture_output=True)
    return folder / "out.rrd", folder / "log.rrd"


def test_frames_have_the_times_that_the_loader_gives_them(both: tuple[Path, Path]):
    ours, theirs = times(both[0], "/camera"), times(both[1], "/front/image/compressed")
    assert ours == theirs
    assert {*ours} == {HEADER_TIME, LOG_TIME}


def test_frames_of_foxgloves_messages_have_the_times_that_the_loader_gives_them(tmp_path: Path):
    log = write_log(tmp_path / "a.mcap")
    roadeval.replay(log, save=tmp_path / "out.rrd", reports=tmp_path / "reports")
    convert = [RERUN, "mcap", "convert", log, "-o", tmp_path / "log.rrd"]
    subprocess.run(convert, check=True, capture_output=True)
    ours, theirs = (
        times(tmp_path / "out.rrd", "/camera"),
        times(tmp_path / "log.rrd", "/camera/image"),
    )
    assert ours == theirs
    assert {*ours} == {FOXGLOVE_TIME, LOG_TIME}


def test_the_camera_has_the_loaders_pinhole_and_place(both: tuple[Path, Path]):
    def components(path: Path, entity: str) -> dict[str, object]:
        found, reader = {}, RrdReader(path)
        for entry in reader.recordings():
            for chunk in reader.stream(store=entry):
                batch = chunk.to_record_batch()
                for name in batch.schema.names if chunk.entity_path == entity else ():
                    if name.startswith(("Pinhole:", "Transform3D:")):
                        found[name] = batch.column(name)[0].as_py()
        return found

    ours = components(both[0], "/camera")
    pinhole = components(both[1], "/front/camera_info")
    assert pinhole
    assert {name: ours[name] for name in pinhole} == pinhole
    assert ours["Transform3D:parent_frame"] == ["base_link"]
    mounting = roadeval.Recording(both[0]).facts.drive.calibration.mounting
    assert np.allclose(ours["Transform3D:translation"][0], mounting.translation)

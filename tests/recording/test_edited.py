"""Recordings that Rerun's own commands have merged, cut or made: read, or refused by name."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
import rerun_cli
from rerun.chunk import RrdReader

import roadeval
from roadeval import RoadevalError
from tests.jobs.making import settings, write_log
from tests.logs.topics.test_calibration import info, ros2

RERUN = next(Path(rerun_cli.__file__).parent.glob("rerun*"))


def rerun(*words: object, to: Path) -> Path:
    """Run a command of `rerun rrd` that writes a file."""
    with to.open("wb") as file:
        subprocess.run([RERUN, "rrd", *words], check=True, stdout=file, stderr=subprocess.PIPE)
    return to


def read(path: Path) -> tuple[object, ...]:
    """All that a recording is asked for."""
    result = roadeval.Result(path)
    return result.summary, result.frames.to_csv(), result.drive and [*result.drive.pictured]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log, and recordings of two runs of it."""
    folder = tmp_path_factory.mktemp("edited")
    log = write_log(folder / "a.mcap")
    for name, frames in (("run", 10), ("other", 5), ("again", 10)):
        config = settings(record="all", train_frames=frames)
        roadeval.replay(log, config, save=folder / f"{name}.rrd", reports=folder / name)
    return folder


def identity(path: Path) -> str:
    from rerun.chunk import RrdReader

    return RrdReader(path).recordings()[0].recording_id


def curve(folder: Path, timeline: str, entity: str = "/mine") -> Path:
    """A curve of a user's own, in a recording of the same name."""
    path = folder / f"{timeline}.rrd"
    with rr.RecordingStream("roadeval", recording_id=identity(folder / "run.rrd")) as stream:
        stream.save(path)
        for number in range(3):
            stream.set_time(timeline, sequence=number)
            stream.log(entity, rr.Scalars(number))
    return path


def with_log(folder: Path) -> Path:
    words = ["mcap", "convert", folder / "a.mcap", "-o", folder / "log.rrd"]
    words += ["--application-id", "roadeval", "--recording-id", identity(folder / "run.rrd")]
    subprocess.run([RERUN, *words], check=True, capture_output=True)
    return folder / "log.rrd"


@pytest.mark.parametrize(
    "added",
    [
        with_log,
        lambda folder: curve(folder, "my_tick"),
        lambda folder: curve(folder, "at_the_camera", "/camera"),
        lambda folder: curve(folder, "frame"),
        lambda folder: folder / "run.rrd",
    ],
    ids=["the log", "a curve", "a curve at an entity of ours", "a curve of frames", "itself"],
)
def test_a_recording_that_was_merged_with_other_data_is_read(
    folder: Path, tmp_path: Path, added: Callable[[Path], Path]
):
    merged = rerun("merge", folder / "run.rrd", added(folder), to=tmp_path / "merged.rrd")
    assert read(merged) == read(folder / "run.rrd")


@pytest.mark.parametrize(
    "words",
    [
        ["filter", "--drop-timeline", "stamp"],
        ["filter", "--drop-entity", "/__properties/roadeval"],
        ["optimize"],
    ],
    ids=" ".join,
)
def test_what_a_filter_drops_and_nobody_needs_is_not_missed(
    folder: Path, tmp_path: Path, words: list[str]
):
    left = rerun(*words, folder / "run.rrd", to=tmp_path / "left.rrd")
    assert read(left) == read(folder / "run.rrd")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["merge", "other.rrd"], "holds 2 recordings, or parts of one"),
        (["merge", "again.rrd"], "holds 2 recordings|several runs in one"),
        (["filter", "--drop-timeline", "frame"], "its timeline frame was dropped"),
        (["filter", "--drop-entity", "/results/layout"], "its /results/layout was dropped"),
        (["filter", "--drop-entity", "/results/frames"], r"\(0 of \d+ rows\)"),
        (["filter", "--drop-entity", "/camera"], "lacks images of frames that it lists"),
    ],
)
def test_what_is_no_whole_recording_of_one_run_is_refused_by_its_name(
    folder: Path, tmp_path: Path, words: list[str], said: str
):
    given = [folder / word if word.endswith(".rrd") else word for word in words]
    edited = rerun(*given, folder / "run.rrd", to=tmp_path / "edited.rrd")
    with pytest.raises(RoadevalError, match=said) as error:
        read(edited)
    assert "replay" not in str(error.value)


@pytest.mark.parametrize("part", [0, 1])
def test_a_part_of_a_split_is_refused_as_one(folder: Path, tmp_path: Path, part: int):
    cut = ["split", "--timeline", "frame", "-t", "15", "-o", tmp_path, folder / "run.rrd"]
    rerun(*cut, to=tmp_path / "said.txt")
    parts = sorted(tmp_path.glob("*.rrd"))
    with pytest.raises(RoadevalError, match="it is a part, or several runs in one"):
        read(parts[part])


LOADER = HEADER_TIME, FOXGLOVE_TIME, LOG_TIME = "ros2_timestamp", "timestamp", "message_log_time"


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

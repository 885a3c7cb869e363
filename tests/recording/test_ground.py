"""The ground in the viewer, below which paths it lies, and what the viewer needs of the machine."""

import subprocess
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np
import pytest
import rerun as rr
import rerun.blueprint as rrb

from roadeval.data import Calibration, VariantLayout, mask_spec
from roadeval.geometry.ground import ground_of
from roadeval.geometry.settings import GroundSettings
from roadeval.recording import viewer
from roadeval.recording.layout import GROUND, Layout, RecordingError
from roadeval.recording.views import arrange, before_the_first_frame

SIZE = 64, 48
GIVEN = GroundSettings(height=1.3, pitch=4, roll=2, focal=(56.0,))


def a_layout() -> Layout:
    ground, _ = ground_of(None, GIVEN, SIZE)
    assert ground is not None
    lens = Calibration("", *SIZE, ground.matrix, frame_id="cam")
    variants = (VariantLayout("filtered", "", ("post",), (mask_spec("post", "Road mask"),)),)
    return Layout("d", *SIZE, variants, ("ERR",), calibration=lens, ground=ground)


def values(component: Any) -> list[Any]:
    (found,) = component.as_arrow_array().to_pylist()
    return found


@pytest.mark.parametrize("place", [(6.0, 10.0), (46.0, -10.0), (20.0, 3.0)])
def test_a_place_on_the_ground_lies_in_space_where_the_camera_sees_it(place: tuple[float, float]):
    layout = a_layout()
    assert layout.ground is not None
    (logged,) = [
        parts
        for path, parts in before_the_first_frame(layout, {})
        if path == GROUND and isinstance(parts[0], rr.Pinhole)
    ]
    pinhole, transform = logged
    matrix = np.reshape(values(pinhole.image_from_camera), (3, 3)).T
    # The picture's pixel of the place, as far from the virtual camera as its plane is.
    across, along = 10 - place[1], 46 - place[0]
    width, height = values(pinhole.resolution)
    pixel = np.array([across / 20 * width, along / 40 * height, 1.0])
    point = np.linalg.inv(matrix) @ pixel * values(pinhole.image_plane_distance)
    turn = np.reshape(values(transform.mat3x3), (3, 3)).T
    in_camera = turn @ point + values(transform.translation)
    seen = np.reshape(layout.ground.matrix, (3, 3)) @ in_camera
    assert seen[:2] / seen[2] == pytest.approx(layout.ground.pixels(np.array([place]))[0], abs=1e-3)


def spaces(part: Any) -> list[rrb.Spatial3DView]:
    """The views of a blueprint that show space."""
    if isinstance(part, rrb.View):
        return [part] if isinstance(part, rrb.Spatial3DView) else []
    return [found for each in part.contents for found in spaces(each)]


@pytest.mark.parametrize("prefix", ["", "/front"])
def test_the_space_shows_camera_ground_and_the_logs_point_clouds(prefix: str):
    blueprint = arrange({prefix: replace(a_layout(), clouds=("/lidar/points",))})
    (space,) = spaces(blueprint.root_container)
    paths = [f"{prefix}{path}" for path in ("/ground", "/ground/filtered", "/camera")]
    assert space.contents == [*paths, "/lidar/points"]
    assert [*space.visualizer_overrides] == [f"{prefix}/camera", f"{prefix}/ground"]


@pytest.fixture
def fake(tmp_path, monkeypatch):
    """A viewer that says how it was called and ends at once."""
    script = tmp_path / "rerun"
    script.write_text('#!/bin/sh\necho "$@ CI=$CI"\nexit 3\n')
    script.chmod(0o700)
    monkeypatch.setenv("VK_ICD_FILENAMES", "/my/driver.json")
    start = subprocess.Popen
    monkeypatch.setattr(
        subprocess, "Popen", lambda words, **options: start([script, *words[1:]], **options)
    )


def test_a_viewer_that_does_not_start_is_quoted_and_would_listen_on_this_machine_alone(
    fake, tmp_path
):
    said = r"the viewer did not start: .*--bind 127\.0\.0\.1 --port \d+ .* CI=1"
    with pytest.raises(RecordingError, match=said):
        viewer.screenshot(tmp_path / "x.rrd", tmp_path / "x.png")


def test_a_viewer_that_is_late_is_asked_again():
    answers = iter([TimeoutError("Deadline expired"), TimeoutError("Deadline expired"), "drawn"])

    def request():
        answer = next(answers)
        if isinstance(answer, Exception):
            raise answer
        return answer

    assert viewer.ask(request) == "drawn"


@pytest.mark.parametrize(
    ("failure", "said"),
    [
        (TimeoutError("Deadline expired"), "the viewer did not answer within 120 s"),
        (ConnectionError("tcp connect error"), "the viewer has ended: tcp connect error"),
        (RuntimeError("no window"), "the viewer has ended: no window"),
    ],
)
def test_a_viewer_that_never_answers_or_has_ended_is_told_in_one_line(failure, said, monkeypatch):
    clock = count(step=100)
    monkeypatch.setattr("time.monotonic", lambda: next(clock))

    def request():
        raise failure

    with pytest.raises(RecordingError, match=f"^{said}$"):
        viewer.ask(request)

"""Logs of real writers whose lens, and whose ground by distance, are known."""

import numpy as np
import pytest

from roadeval.geometry.settings import GroundSettings
from roadeval.logs.log import open_log
from roadeval.logs.settings import LogConfig, TopicSettings
from tests.fixtures.shared import shared

FOLDER = shared("failures", "reality")
PLAIN = [7680, 1760, 960, 480]
"""Pixels of a frame from 0 to 10, 20, 40 and 80 m, by the camera that drew them."""
WRITTEN = (
    "camera_info_binning.mcap",
    "camera_info_roi.mcap",
    "camera_info_no_schema_text.mcap",
    "camera_info_omgidl.mcap",
    "calibration_flatbuffer.mcap",
    "ros1_converted",
    "ros1_converted_renamed",
)


@pytest.mark.parametrize("folder", FOLDER)
@pytest.mark.parametrize("name", WRITTEN)
def test_the_lens_is_the_same_whoever_wrote_it(folder, name: str):
    with open_log(folder / "writers" / name, LogConfig(topics=TopicSettings(truth=""))) as log:
        lens = log.select().calibration
    assert (lens.matrix[0], lens.matrix[2], lens.width) == (80, 48, 96)


@pytest.mark.parametrize("folder", FOLDER)
@pytest.mark.parametrize(
    ("name", "pose", "expected"),
    [
        *((name, (1.5, 4.0), PLAIN) for name in ("plain", "binned", "roi", "tf_body")),
        *((name, (1.5, 4.0), PLAIN) for name in ("tf_optical", "rect_flat", "rect_nested")),
        ("fish_zero", (1.2, 20.0), [9692, 386, 192, 102]),
    ],
)
def test_pixels_lie_at_the_distances_at_which_they_were_drawn(folder, name, pose, expected):
    config = LogConfig(ground=GroundSettings(height=pose[0], pitch=pose[1]))
    with open_log(folder / "cameras" / f"{name}.mcap", config) as log:
        ground = log.select().ground
    pixels = np.indices((ground.width, ground.height)).reshape(2, -1).T.astype(float)
    ahead = ground.places(pixels)[:, 0]
    bands = ((0, 10), (10, 20), (20, 40), (40, 80))
    assert [int(((ahead >= near) & (ahead < far)).sum()) for near, far in bands] == expected


@pytest.mark.parametrize("folder", FOLDER)
def test_pixels_beyond_the_fold_of_a_polynomial_lie_nowhere(folder):
    with open_log(
        folder / "cameras" / "fold.mcap", LogConfig(ground=GroundSettings(height=1.5, pitch=4.0))
    ) as log:
        ground = log.select().ground
    pixels = np.indices((ground.width, ground.height)).reshape(2, -1).T.astype(float)
    assert abs(np.isnan(ground.rays(pixels)[:, 0]).sum() - 2096) <= 8


@pytest.mark.parametrize("folder", FOLDER)
def test_a_lens_without_a_name_is_named_so_twice(folder):
    topics = TopicSettings(truth="")
    with open_log(folder / "times" / "ci_nomodel4.mcap", LogConfig(topics=topics)) as log:
        reasons = "\n".join(log.select().reasons)
    assert "(a nameless distortion)" in reasons
    assert "without a name of 4 numbers" in reasons

"""What was recorded is read back: images, numbers and texts, layers of each kind."""

import io
import json
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO
from itertools import count
from typing import Any

import cv2
import numpy as np
import pytest
import rerun as rr
import rerun.blueprint as rrb
from PIL import Image

from roadeval import Recording
from roadeval.data import (
    ERRORS,
    RESERVED,
    TRUTH,
    Calibration,
    LayerKind,
    LayerSpec,
    Packed,
    VariantLayout,
    mask_spec,
)
from roadeval.geometry.ground import ground_of
from roadeval.geometry.settings import GroundSettings
from roadeval.images.decoding import palette_indices, to_labels
from roadeval.images.formats import Limits
from roadeval.recording import codecs as pngs
from roadeval.recording import viewer, views
from roadeval.recording.codecs import codec, codecs_of
from roadeval.recording.layout import GROUND, SHADOW_TRUTH, Layout, RecordingError, RecordRule
from roadeval.recording.recorder import Recorder
from roadeval.recording.views import arrange, before_the_first_frame
from tests.recording.making import (
    NDI,
    POST,
    RESULTS,
    RINGS,
    VARIANT,
    frame,
    layout,
    paths_of,
    record,
    rows_of,
    unscored,
)
from tests.results.making import lines


def test_the_cameras_own_file_is_passed_on(tmp_path):
    shown = frame(0)
    jpeg = cv2.imencode(".jpg", shown.image, [cv2.IMWRITE_JPEG_QUALITY, 30])[1].tobytes()
    logged = replace(shown, payload=memoryview(jpeg), media_type="image/jpeg")
    back = record(tmp_path / "out.rrd", [replace(unscored(0), frame=logged)]).image(0)
    decoded = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR_RGB)
    np.testing.assert_array_equal(back, decoded)


def test_the_viewer_shows_each_frame_s_rates_in_percent_beside_the_drive_s(drive, tmp_path):
    recording = record(tmp_path / "out.rrd", [drive[1], drive[2]])
    rows = recording._file.rows("/results/frame/filtered", "TextDocument:text")
    assert dict(rows) == {
        1: "This frame:\nnot scored",
        2: "This frame:\nERR 25.00 %\nFPR 50.00 %\nFNR 50.00 %",
    }
    summary = json.dumps({"totals": {"filtered": {"post": {"ERR": 0.0279}}}})
    ended = dict(views.after_the_last_frame(layout(), {"summary": summary}))
    (header,) = ended["/results/guide/filtered"]
    assert "Drive:  \nERR 2.79 %" in str(header.text.as_arrow_array())


def test_the_viewer_shows_the_focus_first():
    known = layout(variants=(VARIANT, replace(VARIANT, name="mine")), focus="mine")
    names = [str(view.name) for view in views.overview(known).contents[0].contents]
    assert [name for name in names if "errors" in name] == ["mine: errors", "filtered: errors"]


def test_a_layer_that_a_frame_lacks_is_not_shown_from_the_frame_before(drive, tmp_path):
    bare = replace(drive[3], variants=(), errors={})
    recording = record(tmp_path / "out.rrd", [drive[2], bare, drive[4]])
    for number in ("2", None, 2.5, float("nan")):
        with pytest.raises(TypeError, match=f"frame: a whole number, not {number!r}"):
            recording.layer("filtered", "post", number)
    with pytest.raises(RecordingError, match="/filtered/post has nothing on frame 3"):
        recording.layer("filtered", "post", 3)
    assert rows_of(recording, "/filtered/post", "EncodedImage:blob") == {2: 1, 3: 0, 4: 1}


def test_frames_without_pictures_end_what_is_shown_and_are_not_among_those_that_have_some(
    drive, tmp_path
):
    pictured = [4, 5, 11]
    with Recorder(tmp_path / "out.rrd", layout(), RecordRule.parse("every:2")) as recorder:
        for each in drive:
            position = 0 if each.frame.number in pictured else 1
            recorder.write(recorder.encode(each, position), lines(each))
        recorder.finish(RESULTS)
    recording = Recording(recorder.path)
    assert recording.frame_numbers == tuple(pictured)
    np.testing.assert_array_equal(recording.truth(11), drive[11].frame.truth)
    with pytest.raises(RecordingError, match="/truth has nothing on frame 6"):
        recording.truth(6)
    for path, component in (
        ("/camera", "EncodedImage:blob"),
        ("/filtered/ndi", "EncodedDepthImage:blob"),
        ("/filtered/rings", "SegmentationImage:buffer"),
    ):
        assert rows_of(recording, path, component) == {4: 1, 5: 1, 6: 0, 11: 1, 12: 0}


@pytest.mark.parametrize(
    ("version", "told"),
    [
        (2, "made by roadeval 0.1.9 in a format that is no longer read: replay the log again"),
        (4, "made by roadeval 0.1.9, a later version: update roadeval"),
    ],
)
def test_a_recording_of_another_format_is_one_line(version, told, tmp_path, monkeypatch):
    path = tmp_path / "out.rrd"
    monkeypatch.setattr("roadeval.recording.layout.FORMAT", version)
    record(path, [unscored(0)], layout(properties={"version": "0.1.9"}))
    monkeypatch.undo()
    with pytest.raises(RecordingError) as caught:
        Recording(path)
    assert str(caught.value) == f"{path}: {told}"


@pytest.mark.parametrize("content", [b"", b"RR", b"\x89MCAP0\r\n", b"frame,stamp_ns\n"])
def test_a_file_that_is_no_recording_is_told(content, tmp_path):
    (tmp_path / "x.rrd").write_bytes(content)
    with pytest.raises(RecordingError, match=r"x\.rrd: not a recording"):
        Recording(tmp_path / "x.rrd")


def test_a_recording_by_another_program_is_told(tmp_path):
    other = rr.RecordingStream("someone_else")
    other.save(tmp_path / "x.rrd")
    other.log("words", rr.TextDocument("hello"))
    other.flush()
    other.disconnect()
    with pytest.raises(RecordingError, match="by someone_else, not by roadeval"):
        Recording(tmp_path / "x.rrd")


def test_a_torn_file_is_read_to_the_last_whole_message(drive, recording, tmp_path):
    whole, path = recording.path.read_bytes(), tmp_path / "torn.rrd"
    # In the middle of a picture: cut between two messages, a file has nothing torn in it.
    path.write_bytes(whole[: whole.rindex(b"\x89PNG") + 30])
    torn = Recording(path)
    assert not torn.complete
    assert torn.frame_numbers == recording.frame_numbers
    np.testing.assert_array_equal(torn.truth(0), drive[0].frame.truth)


@pytest.mark.parametrize("has_index", [True, False])
def test_every_frame_comes_back_in_any_order(drive, recording, has_index, tmp_path):
    path = tmp_path / "again.rrd"
    path.write_bytes(recording.path.read_bytes()[: None if has_index else -1])
    again = Recording(path)
    assert again.complete == has_index
    for each in (*drive[9:], *reversed(drive)):
        np.testing.assert_array_equal(again.truth(each.frame.number), each.frame.truth)


def test_a_layout_survives_its_json():
    whole = layout(first_frame=10, rate_hz=15.0, properties={"version": "1", "frames": 3})
    assert Layout.from_json(whole.to_json()) == whole


@pytest.mark.parametrize("name", [*sorted(RESERVED), "../x", "a b", "", "größe"])
def test_a_variant_cannot_take_a_name_that_the_recording_uses_or_cannot_hold(name):
    variant = type(VARIANT)(name, "", ("post",), VARIANT.layers)
    with pytest.raises(RecordingError, match=f"named '{name}'"):
        layout(variants=(variant,))


def test_every_path_that_is_no_variants_begins_with_a_reserved_name(recording):
    tops = {path.split("/")[1] for path in paths_of(recording.path)}
    assert tops - {"filtered", "__properties"} < RESERVED


@pytest.mark.parametrize("text", ["all", "masks", "none", "worst:1", "every:10", "worst:99999999"])
def test_a_rule_is_its_kind_and_number(text):
    rule = RecordRule.parse(text)
    kind, _, number = text.partition(":")
    assert (rule.kind, rule.number) == (kind, int(number or 0))


def test_a_rule_is_checked_without_rerun():
    code = (
        "import sys; from roadeval.recording.layout import RecordRule; RecordRule.parse('all'); "
        "sys.exit('rerun' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


HEIGHT, WIDTH = 9, 13
DRAW = np.random.default_rng(0)
RAMP = np.add.outer(np.arange(HEIGHT), np.arange(WIDTH)).astype(np.float32) / (HEIGHT + WIDTH)


def there_and_back(spec, array):
    chosen = codec(spec, array.shape[1], array.shape[0])
    return chosen.decode(chosen.encode(array))


@pytest.mark.parametrize("spec", [POST, RINGS, ERRORS, TRUTH, SHADOW_TRUTH])
def test_masks_and_labels_come_back_equal(spec):
    values = np.array([each.value for each in spec.classes], np.uint8)
    array = DRAW.choice(values, (HEIGHT, WIDTH))
    assert set(values) == set(array.flat)
    np.testing.assert_array_equal(there_and_back(spec, array), array)


def test_an_exact_number_map_comes_back_to_the_nearest_of_256_levels():
    ndi = DRAW.uniform(-1, 1, (HEIGHT, WIDTH)).astype(np.float32)
    back = there_and_back(NDI, ndi)
    assert back.dtype == np.float32
    assert np.abs(back - ndi).max() <= 1 / 255 + 1e-6


def test_a_number_map_that_need_not_be_exact_comes_back_nearly_and_at_full_size():
    spec = LayerSpec("distance", LayerKind.SCALAR, "", value_range=(0.0, 6.0), exact=False)
    back = there_and_back(spec, 6 * RAMP)
    assert back.shape == (HEIGHT, WIDTH)
    assert np.abs(back - 6 * RAMP).max() < 0.5


PHOTOGRAPHIC = replace(NDI, photographic=True)


@pytest.mark.parametrize("seed", range(3))
def test_a_photographic_map_comes_back_within_3_levels_on_average_even_if_it_is_noise(seed):
    codes = np.random.default_rng(seed).integers(0, 256, (96, 128)).astype(np.uint8)
    error = np.abs((there_and_back(PHOTOGRAPHIC, codes) + 1) * 127.5 - codes)
    assert 1 < error.mean() < 3
    assert error.max() < 32


def test_both_ends_of_the_range_of_a_photographic_map_come_back_the_same_inside_their_areas():
    codes = DRAW.integers(20, 236, (64, 64)).astype(np.uint8)
    codes[:19], codes[40:] = 0, 255
    back = there_and_back(PHOTOGRAPHIC, codes)
    np.testing.assert_array_equal(back[:16], -1)
    np.testing.assert_allclose(back[40:], 1, atol=1e-6)
    beyond = np.where(codes == 255, np.inf, np.where(codes == 0, -np.inf, 0)).astype(np.float32)
    np.testing.assert_allclose(there_and_back(PHOTOGRAPHIC, beyond)[40:], 1, atol=1e-6)


@pytest.mark.parametrize(
    ("spec", "signature"), [(NDI, b"\x89PNG"), (PHOTOGRAPHIC, b"\xff\xd8\xff")]
)
def test_a_photographic_map_is_a_jpeg_whose_kind_the_viewer_takes_from_its_bytes(spec, signature):
    chosen = codec(spec, WIDTH, HEIGHT)
    assert chosen.encode(RAMP).startswith(signature)
    (style,) = views._style(chosen)
    assert style.media_type is None


def test_an_image_that_need_not_be_exact_comes_back_nearly_and_at_full_size():
    spec = LayerSpec("compensated", LayerKind.RGB, "", exact=False)
    image = np.dstack([255 * RAMP, 255 - 255 * RAMP, 128 + 0 * RAMP]).astype(np.uint8)
    back = there_and_back(spec, image)
    assert back.shape == image.shape
    assert np.abs(back.astype(int) - image).mean() < 10


@pytest.mark.parametrize("spec", [POST, NDI, LayerSpec("aligned", LayerKind.RGB, "")])
def test_a_damaged_picture_is_refused(spec):
    chosen = codec(spec, WIDTH, HEIGHT)
    shape = (HEIGHT, WIDTH, 3) if spec.kind is LayerKind.RGB else (HEIGHT, WIDTH)
    payload = bytearray(chosen.encode(np.ones(shape, np.uint8)))
    payload[len(payload) // 2] ^= 1
    with pytest.raises(ValueError, match="a damaged PNG"):
        chosen.decode(bytes(payload))


def test_a_map_of_a_large_image_has_the_means_of_blocks_to_a_127th():
    drawn = DRAW.uniform(-1, 1, (1200, 1920)).astype(np.float32)
    found = codec(NDI, 1920, 1200)
    with Image.open(BytesIO(payload := found.encode(drawn))) as picture:
        assert picture.size == (384, 240)
    means = drawn.reshape(240, 5, 384, 5).mean((1, 3))
    levels = to_labels(payload, Limits())
    np.testing.assert_allclose(levels / 127.5 - 1, means, atol=1 / 127)
    assert found.decode(payload).shape == (1200, 1920)
    exact = codec(NDI, 800, 600)
    assert np.abs(exact.decode(exact.encode(drawn[:600, :800])) - drawn[:600, :800]).max() < 1 / 254


def test_a_recordings_layers_fit_beside_the_cameras_picture_of_any_size():
    """Of maps and colours: noise, which nothing packs, at sizes of real cameras."""
    distance = LayerSpec("distance", LayerKind.SCALAR, "", value_range=(0.0, 6.0), exact=False)
    for width, height in ((1280, 720), (1920, 1200), (3840, 2160)):
        noise = DRAW.uniform(-1, 1, (height, width)).astype(np.float32)
        for spec in (NDI, distance):
            assert len(codec(spec, width, height).encode(noise)) < 100_000


# --- Label images, grey levels and colours as PNG files -------------------------------------------

ROAD = [(0, 0, 0, 0), (0, 158, 115, 160)]


def decode(png):
    return palette_indices(png, Limits())


@pytest.mark.parametrize("classes", [2, 3, 4, 5, 16, 17, 256])
@pytest.mark.parametrize("width", [1, 7, 8, 13])
def test_labels_come_back_whatever_their_number_and_the_width(classes, width):
    labels = np.random.default_rng(0).integers(0, classes, (5, width)).astype(np.uint8)
    png = pngs.encode_labels(labels, [(i, 0, 0, 255) for i in range(classes)])
    np.testing.assert_array_equal(decode(png), labels)


@pytest.mark.parametrize("classes", [2, 3])
@pytest.mark.parametrize("width", [1, 7, 8, 13, 63, 64, 65, 130])
def test_a_packed_mask_gives_the_same_file(classes, width):
    mask = np.random.default_rng(0).integers(0, 2, (5, width)).astype(np.uint8)
    palette = [(i, 0, 0, 255) for i in range(classes)]
    png = pngs.encode_labels(mask, palette)
    assert pngs.encode_labels(Packed.of(mask), palette) == png


def test_another_library_sees_the_colours_and_how_opaque_they_are():
    png = pngs.encode_labels(np.array([[0, 1]], np.uint8), ROAD)
    rgba = np.asarray(Image.open(io.BytesIO(png)).convert("RGBA"))
    assert [tuple(pixel) for pixel in rgba[0]] == ROAD


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (7, 1), (9, 13), (9, 13, 3), (1, 1, 3)])
def test_levels_come_back_by_another_library(shape):
    levels = np.random.default_rng(0).integers(0, 256, shape).astype(np.uint8)
    png = pngs.encode_levels(levels)
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(png))), levels)
    read = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(read[..., ::-1] if levels.ndim == 3 else read, levels)


@pytest.mark.parametrize("noise", [2, 5])
def test_a_noisy_map_takes_hardly_more_than_in_the_smallest_file_of_opencv(noise):
    draw = np.random.default_rng(0)
    slope = np.add.outer(np.arange(240), np.arange(320)) / 4 + draw.normal(0, noise, (240, 320))
    levels = slope.clip(0, 255).astype(np.uint8)
    how = (
        *(cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_PAETH),
        *(cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE),
    )
    least = len(cv2.imencode(".png", levels, how)[1])
    assert len(pngs.encode_levels(levels)) < 1.05 * least


# --- The images and masks of disturbed frames: their paths, and their tab in the viewer -----------


POST_MASK = mask_spec("post", "Road mask")
VARIANTS = tuple(VariantLayout(name, "", ("post",), (POST_MASK,)) for name in ("net", "masks"))
LAYOUT = Layout("d", 64, 48, VARIANTS, ("ERR",), disturbed={"fog-2": ("net",)})
PATHS = [f"/disturbed/fog-2/{name}" for name in ("camera", "net/post", "net/errors")]


def views_in(part: Any) -> Iterator[Any]:
    if isinstance(part, rrb.View):
        yield part
    else:
        for inner in part.contents:
            yield from views_in(inner)


def test_only_variants_that_run_on_disturbed_images_have_masks_there():
    assert sorted(p for p in codecs_of(LAYOUT) if "disturbed" in p) == sorted(PATHS)
    assert Layout.from_json(LAYOUT.to_json()) == LAYOUT


@pytest.mark.parametrize("prefix", ["", "/front"])
def test_the_tab_shows_errors_over_the_disturbed_image(prefix):
    shown = [view.contents for view in views_in(arrange({prefix: LAYOUT}).root_container)]
    assert [prefix + PATHS[0], prefix + PATHS[2]] in shown
    plain = arrange({prefix: replace(LAYOUT, disturbed={})}).root_container
    assert not any("disturbed" in str(view.contents) for view in views_in(plain))


def test_no_variant_has_the_name_of_their_path():
    variant = replace(VARIANTS[0], name="disturbed")
    with pytest.raises(RecordingError, match="cannot be named 'disturbed'"):
        replace(LAYOUT, variants=(variant,), disturbed={})


# --- The ground in the viewer, below which paths it lies, and what the viewer needs of the machine


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

"""Which mask of a folder belongs to which frame, by its name; and what `pick.json` may say."""

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from roadeval.images.formats import ImageError, Limits
from roadeval.logs.errors import BadMessage, LogError
from roadeval.logs.messages.pictures import CompressedPicture
from roadeval.logs.messages.pixels import to_labels
from roadeval.logs.settings import MaskSettings
from roadeval.logs.truth.label_files import labels_in, npy_picture
from roadeval.logs.truth.meaning import Confidence, log_and_topic
from roadeval.logs.truth.named_labels import NamedLabels, find_keys
from roadeval.logs.truth.picks import Picked, Picks, Why
from tests.logs.making import png


def folder(tmp_path, *names):
    made = tmp_path / "masks"
    made.mkdir()
    for name in names:
        (made / name).write_bytes(name.encode())
    return made


def opened(path: Path, size=None, **settings) -> NamedLabels:
    settings = {"first": None if "images" in settings else 0, **settings}
    return find_keys(
        labels_in(path, size), str(path), MaskSettings(str(path), **settings), Limits()
    )


def keys(path, **settings):
    labels = opened(path, **settings)
    names = [label.path.name for label in labels.labels]
    return labels.by, dict(zip(names, labels.log_times.tolist(), strict=True))


def test_names_that_are_times_are_stamps(tmp_path):
    path = folder(tmp_path, "1700000000.25.png", "1700000000123.png", "1700000000500000001_gt.png")
    assert keys(path) == (
        "stamp",
        {
            "1700000000123.png": 1_700_000_000_123_000_000,
            "1700000000.25.png": 1_700_000_000_250_000_000,
            "1700000000500000001_gt.png": 1_700_000_000_500_000_001,
        },
    )


def test_a_mask_belongs_to_the_image_of_its_name_at_its_place(tmp_path):
    path = folder(tmp_path, "c_mask.png", "a.png", "other.png")
    images = tmp_path / "images"
    images.mkdir()
    for name in ("a.jpg", "b.jpg", "c.jpg"):
        (images / name).touch()
    assert keys(path, images=str(images)) == ("name", {"a.png": 0, "c_mask.png": 2})
    assert opened(path, images=str(images)).nameless == 1


@pytest.mark.parametrize(
    ("names", "settings", "message"),
    [
        ((), {}, "no image in it"),
        (("road.png",), {}, "road.png: its name has no number"),
        (("1.png", "01.npy"), {}, "1.png belong to the same frame, by number"),
        (("1.png",), {"pair": "stamp"}, "1.png: its name is not a time"),
    ],
)
def test_names_that_tell_no_frame_are_refused(tmp_path, names, settings, message):
    with pytest.raises(LogError, match=message):
        keys(folder(tmp_path, *names), **settings)


def test_the_digest_tells_content_and_frame_not_the_place(tmp_path):
    def digest(name, file, content):
        (tmp_path / name).mkdir()
        (tmp_path / name / file).write_bytes(content)
        return opened(tmp_path / name).digest

    one = digest("a", "1.png", b"x")
    assert digest("b", "frame_01.png", b"x") == one
    assert digest("c", "2.png", b"x") != one
    assert digest("d", "1.png", b"y") != one


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("a.mcap:/net", ("a.mcap", "/net")),
        ("d/a.mcap:net", ("d/a.mcap", "net")),
        ("bag:/net/road", ("bag", "/net/road")),
        ("a:b/masks", (None, None)),
        ("C:/masks", (None, None)),
        (r"C:\x\a.mcap:/road", (r"C:\x\a.mcap", "/road")),
        ("masks", (None, None)),
        ("d/a.mcap", ("d/a.mcap", None)),
    ],
)
def test_a_topic_of_a_log_is_told_from_a_folder(path, expected):
    assert log_and_topic(path) == expected


def test_confidences_of_eight_and_sixteen_bits_and_fractions_are_the_same():
    levels = np.arange(256, dtype=np.uint8).reshape(16, 16)
    wide, confidence = levels.astype(np.uint16) * 257, Confidence(0.5)
    for picture in (
        CompressedPicture(0, "png", png(levels)),
        CompressedPicture(0, "png", png(wide)),
        npy_picture(file_of(levels / 255), Limits()),
        npy_picture(file_of((levels / 255).astype(np.float32)), Limits()),
    ):
        codes = confidence.codes(picture, Limits())
        np.testing.assert_array_equal(codes, wide)
    np.testing.assert_array_equal(confidence.road(codes), levels / 255 >= 0.5)


# --- NPY files as pictures ------------------------------------------------------------------------

LIMITS = Limits(1000)


def file_of(array, **options):
    file = io.BytesIO()
    np.save(file, array, **options)
    return file.getvalue()


@pytest.mark.parametrize("dtype", ["?", "u1", "i1", "<u2", ">u2", "<i4", "<i8"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_whole_numbers_keep_their_values(dtype, order):
    array = np.array([[0, 1, 1], [1, 0, 0]], dtype, order=order)
    np.testing.assert_array_equal(to_labels(npy_picture(file_of(array), LIMITS), LIMITS), array)


class Bomb:
    def __reduce__(self):
        return pytest.fail, ("it ran",)


NEITHER = "neither a class nor a confidence"
WHOLE = file_of(np.zeros((2, 3), "u1"))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (file_of(np.zeros((2, 3, 1))), r"of shape \(2, 3, 1\)"),
        (file_of(np.zeros(3)), r"of shape \(3,\)"),
        (file_of(np.array([["a"]])), "not of numbers"),
        (file_of(np.array([[70_000]])), "it holds 70000"),
        (file_of(np.zeros((1, 1), complex)), "not of numbers"),
        *((file_of(np.array([[0.5, n]])), NEITHER) for n in (np.nan, np.inf, -np.inf, -1.5)),
        (file_of(np.array([[Bomb()]], object), allow_pickle=True), "no NPY file of numbers"),
        *((WHOLE[:length], "a damaged one") for length in (0, 5, 40, 128, 133)),
    ],
)
def test_what_is_no_array_of_labels_is_refused_and_nothing_of_it_is_run(content, message):
    with pytest.raises(BadMessage, match=message):
        npy_picture(content, LIMITS)


def test_more_pixels_than_are_allowed_are_refused():
    with pytest.raises(ImageError, match="more than the 1000 pixels"):
        npy_picture(file_of(np.zeros((40, 30), "u1")), LIMITS)


FRAMES = [*range(10, 20)]
STAMPS = [1_700_000_000_123_456_789 + number * 10**8 for number in FRAMES]
PICKED = [
    Picked(11, STAMPS[1], Why.RANDOM, 0.2, None, ""),
    Picked(12, STAMPS[2], Why.RANKED, None, 0.5, ""),
    Picked(17, STAMPS[7], Why.RANDOM, 0.2, None, ""),
]
PICKS = Picks("a", "/camera", None, {}, 0, 2, FRAMES, STAMPS, [None] * 10, PICKED)


def written(folder, picks):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "pick.json").write_text(picks.text())
    return folder


def test_what_was_written_is_read_again_also_beside_its_labels(tmp_path):
    folder = written(tmp_path / "picks", PICKS)
    assert Picks.read(folder) == Picks.of_labels(folder / "labels") == PICKS
    assert Picks.of_labels(folder / "labels" / "coco.json") == PICKS
    assert Picks.of_labels(tmp_path / "labels") is None


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"drawn": 3}, "2 frames are random, but 3 were drawn"),
        ({"drawn": -5}, "2 frames are random, but -5 were drawn"),
        ({"picked": PICKED[:2]}, "1 frames are random, but 2 were drawn"),
        ({"picked": PICKED * 2, "drawn": 4}, "a frame is picked twice"),
        ({"frames": [], "stamps": [], "scores": []}, "do not fit together"),
        ({"frames": FRAMES[:5]}, "do not fit together"),
        ({"stamps": [*STAMPS[:9], STAMPS[0]]}, "do not fit together"),
        (
            {"frames": FRAMES[:5], "stamps": STAMPS[:5], "scores": [None] * 5},
            "a picked frame is not in the list of all",
        ),
        ({"frames": FRAMES[::-1]}, "a picked frame is not in the list of all"),
    ],
)
def test_what_contradicts_itself_is_refused(tmp_path, changes, problem):
    with pytest.raises(LogError, match=problem) as caught:
        Picks.read(written(tmp_path, replace(PICKS, **changes)))
    assert "take the file as it was written" in str(caught.value)


@pytest.mark.parametrize(
    "rounded", [int, lambda stamp: int(float(stamp)), lambda n: n // 100 * 100]
)
def test_a_stamp_is_known_as_a_program_may_have_rounded_it(rounded):
    picked = [replace(each, stamp_ns=rounded(each.stamp_ns)) for each in PICKED]
    found = replace(PICKS, stamps=[*map(rounded, STAMPS)], picked=picked)
    assert found.is_picked(STAMPS[1], Why.RANDOM)
    assert not found.is_picked(STAMPS[2], Why.RANDOM)
    assert found.places[float(STAMPS[7])] == 7

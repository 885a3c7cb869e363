"""Which mask of a folder belongs to which frame, by its name; and what `pick.json` may say."""

import io
import random
import uuid
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from roadeval.images.formats import ImageError, Limits
from roadeval.logs.errors import BadMessage, FrameError, LogError
from roadeval.logs.files import images_of
from roadeval.logs.log import open_log
from roadeval.logs.messages.encoding import TopicKind
from roadeval.logs.messages.pictures import CompressedPicture
from roadeval.logs.messages.pixels import to_labels
from roadeval.logs.settings import LabelPlace, LogConfig, MaskSettings
from roadeval.logs.topics.choose import check_names
from roadeval.logs.topics.reader import TopicInfo
from roadeval.logs.truth.label_files import labels_in, npy_picture
from roadeval.logs.truth.meaning import Confidence, log_and_topic, meaning_of
from roadeval.logs.truth.named_labels import LabelSet, NamedLabel, NamedLabels, find_keys
from roadeval.logs.truth.picks import Picked, Picks, Why
from tests.fixtures import broken
from tests.fixtures.broken import (
    FRAMES,
    HEAD,
    HEIGHT,
    WIDTH,
    chunk,
    good,
    length_of,
    message,
    over,
)
from tests.fixtures.writing import START
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


SECOND = 1_700_000_000


@pytest.mark.parametrize("name", ["cam_{}_road", "frame{}", "{}_pred_v2", "cam0-{}.rectified"])
def test_the_text_around_the_times_is_the_same_in_all_names(tmp_path, name):
    times = (f"{SECOND + second}.5" for second in range(2))
    path = folder(tmp_path, *(f"{name.format(time)}.png" for time in times))
    by, stamps = keys(path)
    assert (by, [*stamps.values()]) == ("stamp", [SECOND * 10**9 + n * 10**8 for n in (5, 15)])


@pytest.mark.parametrize(
    "names",
    [
        ("left_1700000000123", "right_1700000001123"),
        ("drive_1700000000_000001", "drive_1700000000_000002"),
        ("frame_0000000001", "frame_0000000002"),
    ],
)
def test_a_number_is_not_taken_for_a_time(tmp_path, names):
    with suppress(LogError):
        assert keys(folder(tmp_path, *(f"{name}.png" for name in names)))[0] == "number"


@pytest.mark.parametrize(
    ("digits", "nanoseconds"),
    [
        (("50000000", "150000000", "0"), (50_000_000, 150_000_000, 0)),
        (("50000000",), (50_000_000,)),
        (("50000", "150000"), (50_000_000, 150_000_000)),
        (("50", "950"), (50_000_000, 950_000_000)),
        (("5", "25", "125", "0625"), (500_000_000, 250_000_000, 125_000_000, 62_500_000)),
        (("5000", "2500"), (500_000_000, 250_000_000)),
        (("051234567", "51234567"), (51_234_567, 512_345_670)),
    ],
)
def test_zeros_before_the_digits_of_a_second_may_be_left_out(tmp_path, digits, nanoseconds):
    names = [f"{SECOND + place}_{text}.png" for place, text in enumerate(digits)]
    _, stamps = keys(folder(tmp_path, *names))
    assert [stamps[name] % 10**9 for name in names] == [*nanoseconds]


def test_digits_of_a_second_that_may_be_either_are_refused(tmp_path):
    path = folder(tmp_path, f"{SECOND}.51234567.png", f"{SECOND}.151234567.png")
    with pytest.raises(LogError, match=r"may be decimals, or nanoseconds .*; write nine digits"):
        keys(path)


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
        (("1.png", "01.npy"), {}, "1.png belong to the same frame, by number; choose one"),
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


def tiff(array):
    file = io.BytesIO()
    Image.fromarray(array).save(file, "tiff")
    return CompressedPicture(0, "tiff", file.getvalue())


@pytest.mark.parametrize("read", [lambda array: npy_picture(file_of(array), Limits()), tiff])
def test_classes_that_are_stored_as_floats_keep_their_numbers(read):
    classes = np.array([[0, 1, 2, 255], [0, 0, 1, 7]], np.float32)
    for rows in (classes, classes[:, :2]):  # also where there are only 0 and 1
        np.testing.assert_array_equal(to_labels(read(rows), Limits()), rows)
    fractions = np.array([[0, 0.5, 1, 1]], np.float32)
    assert to_labels(read(fractions), Limits()).tolist() == [[0, 128, 255, 255]]
    assert Confidence(0.5).codes(read(fractions), Limits()).tolist() == [[0, 32768, 65535, 65535]]
    assert Confidence(0.5).codes(read(classes[:, :2]), Limits()).max() == 65535


@pytest.mark.parametrize(
    ("levels", "threshold", "is_told"),
    [
        (np.uint8([[0, 99]]), 0.5, True),
        (np.uint8([[0, 99]]), 0.3, False),
        (np.uint8([[0, 100]]), 0.3, True),
        (np.uint8([[0, 200]]), 0.5, False),
        (np.uint16([[0, 1000]]), 0.01, True),
        (np.uint16([[0, 40_000]]), 0.5, False),
    ],
)
def test_confidences_that_seem_to_have_another_scale_are_told(tmp_path, levels, threshold, is_told):
    (tmp_path / "0.png").write_bytes(png(levels))
    notes = meaning_of(opened(tmp_path), MaskSettings(str(tmp_path), threshold=threshold)).notes
    assert any("write 1 as 255 in 8 bits" in note for note in notes) == is_told


def test_rounding_takes_no_confidence_beyond_its_ends():
    rounded = np.array([[-1e-7, 1.0000001, 0.5]], np.float32)
    codes = Confidence(0.5).codes(npy_picture(file_of(rounded), Limits()), Limits())
    assert codes.tolist() == [[0, 65535, 32768]]


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


LISTED = [*range(10, 20)]
STAMPS = [1_700_000_000_123_456_789 + number * 10**8 for number in LISTED]
PICKED = [
    Picked(11, STAMPS[1], Why.RANDOM, 0.2, None, ""),
    Picked(12, STAMPS[2], Why.RANKED, None, 0.5, ""),
    Picked(17, STAMPS[7], Why.RANDOM, 0.2, None, ""),
]
PICKS = Picks("a", "/camera", None, {}, 0, 2, LISTED, STAMPS, [None] * 10, PICKED)


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
        ({"frames": LISTED[:5]}, "do not fit together"),
        ({"stamps": [*STAMPS[:9], STAMPS[0]]}, "do not fit together"),
        (
            {"frames": LISTED[:5], "stamps": STAMPS[:5], "scores": [None] * 5},
            "a picked frame is not in the list of all",
        ),
        ({"frames": LISTED[::-1]}, "a picked frame is not in the list of all"),
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


# --- Which digits of the names number the frames, of which camera; and where images are lost ------


def frames_of(labelled, frames, **settings):
    """Return the frame of each label, by its name."""
    labels = [NamedLabel(Path(name), bytes, None) for name in labelled]
    labels = find_keys(LabelSet(labels), "labels", LabelPlace(**settings), Limits(), frames)
    paths = (str(label.path) for label in labels.labels)
    return dict(zip(paths, labels.log_times.tolist(), strict=True))


@pytest.mark.parametrize(
    ("numbers", "frames", "first"),
    [
        ([*range(30)], 30, 0),
        ([0, 5, 17], 30, 0),
        ([*range(1, 31)], 30, 1),
        ([number for number in range(1, 31) if number != 16], 30, 1),
        ([3, 30], 30, 1),
        ([*range(100, 130)], 30, 100),
        # The last one lacks, every third, few, beyond the log, an unsure log.
        ([*range(1, 30)], 30, None),
        ([*range(1, 30, 3)], 30, None),
        ([5, 17, 24], 30, None),
        ([5, 40], 30, None),
        ([*range(1, 31)], None, None),
    ],
)
def test_what_the_numbers_say_of_the_first_frame_is_taken_or_else_asked_for(numbers, frames, first):
    names = [f"frame_{number:04}.png" for number in numbers]
    if first is not None:
        assert [*frames_of(names, frames).values()] == [number - first for number in numbers]
        return
    with pytest.raises(LogError, match=r"number 0 or 1; set `truth.first` to 0 or to 1"):
        frames_of(names, frames)
    for chosen in (0, 1):
        assert [*frames_of(names, frames, first=chosen).values()] == [n - chosen for n in numbers]


HASHES = [uuid.UUID(int=number**20 + 7).hex for number in range(30)]


@pytest.mark.parametrize(
    "name",
    [
        "frame_{number:04}.png",
        "frame_{number}_v2.json",
        "cam2_000{number:02}_x5.png",
        "{number}",
        "frame_{number:04}_jpg.rf.{hash}.jpg",
        "frame_{number:04}_jpg.rf.{hash}_mask.png",
        "{short}-frame_{number}.png",
        "{number}_{short}.png",
    ],
)
def test_the_digits_by_which_names_differ_are_the_number(name):
    names = [
        name.format(number=number, hash=text, short=text[:4] + text[-4:])
        for number, text in enumerate(HASHES)
    ]
    assert [*frames_of(names, 30).values()] == [*range(30)]


@pytest.mark.parametrize(
    "names",
    [
        *(
            [*(f"frame_{number}.png" for number in range(6)), name]
            for name in ("frame_12 (1).png", "frame_7_v2.png", "7.png", "take2_7.png")
        ),
        [*(f"frame_{number}.png" for number in range(6)), "frame_007_0.5.png"],
        [f"take{number + 1}_{number * 7}.png" for number in range(4)],
    ],
)
def test_names_that_differ_in_more_than_a_number_are_refused_with_the_way_to_show_it(names):
    with pytest.raises(LogError, match=r"show them by `truth.names`, as frame_\{number\}_\*"):
        frames_of(names, 30)


def test_the_number_is_taken_where_it_is_shown():
    numbers = frames_of([f"take{n + 1}_{n * 7}.png" for n in range(4)], 30, names="*_{number}.png")
    assert [*numbers.values()] == [0, 7, 14, 21]


def drawn_set(seed):
    """Return names of labels by chance, how many frames there are, and the frame of each label."""
    chance = random.Random(seed)
    frames, first = chance.randint(1, 60), chance.choice([0, 0, 1, 1, 1, 100])
    step, phase = chance.choice([1, 1, 2, 3, 10]), chance.randint(0, 3)
    chosen = [*range(frames)][phase * (step > 1) :: step] or [0]
    if chance.random() < 0.5:
        chosen = sorted(chance.sample(chosen, chance.randint(1, len(chosen))))
    before = chance.choice(
        ["", "frame_", "left/", "run3_", "2024-05-01_", "{short}-", "take{any}_"]
    )
    behind = chance.choice(
        ["", "", "_mask", "_v2", "_jpg.rf.{hash}", "_{short}", "_{any}", " ({any})"]
    )
    odd = chance.choice([0, 0, 0, 0.1, 0.5])
    name, ending = f"{{number:0{chance.choice([1, 4, 6])}}}", chance.choice([".png", ".json", ""])
    names = {}
    for frame in chosen:
        text = uuid.UUID(int=chance.getrandbits(128)).hex
        parts = {"hash": text, "short": text[:8], "any": chance.randint(0, 12)}
        tail = chance.choice([" (1)", "_2", "_v3"]) if chance.random() < odd else behind
        names[(before + name + tail).format(number=frame + first, **parts) + ending] = frame
    return names, frames, first


def test_of_random_sets_no_label_is_paired_with_a_wrong_frame():
    """1,000 sets of names, bases and gaps: the right frames, or a refusal that says what to do."""
    taken = 0
    for seed in range(1000):
        expected, frames, first = drawn_set(seed)
        for settings in ({}, {"first": first}):
            with suppress(LogError):
                numbers = frames_of(expected, frames, **settings)
                assert numbers == expected, seed
                taken += 1
    assert taken > 500


# --- Cameras --------------------------------------------------------------------------------------


def camera(name, frame_id=""):
    return TopicInfo(name, "", "", TopicKind.COMPRESSED, 9, frame_id=frame_id)


@pytest.mark.parametrize(
    ("names", "topics"),
    [
        (["left/0.png", "left/1.png"], ["/front/image"]),
        (["cam2_0000.png", "cam2_0001.png", "cam2_0002.png"], ["/cam1/image"]),
        (["rear/0.png", "rear/1.png"], ["/image", "/rear/image"]),
        (["front/0.png", "left/1.png"], ["/front/image"]),
        (["a_left_0.png", "a_right_0.png", "a_left_1.png"], ["/image"]),
        (["cam1/0.png", "cam2/0.png", "cam1/1.png"], ["/image"]),
    ],
)
def test_names_of_another_camera_or_of_several_are_refused(names, topics):
    with pytest.raises(LogError, match=r"choose those that count by `truth\.names`, as "):
        check_names(names, camera(topics[0]), [*map(camera, topics)])


@pytest.mark.parametrize(
    ("names", "topic", "frame_id"),
    [
        (["front/0.png", "front/1.png"], "/front/left/image", ""),
        (["front_0.png", "front_1.png"], "/image", "front_camera"),
        (["cam_0000.png", "cam_0001.png"], "/front/image", ""),
        (["cam0000.png", "cam0001.png"], "/front/image", ""),
        (["left/0.png", "left/1.png"], "/camera/image", ""),
        (["0.png", "1.png"], "/camera/0/image", ""),
    ],
)
def test_names_of_the_camera_itself_are_taken(names, topic, frame_id):
    check_names(names, camera(topic, frame_id), [camera(topic, frame_id)])


# --- Names of images ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("label", "image"),
    [
        ("drivable_{}.png", "{}.jpg"),
        ("road.mask-frame_{}.png", "frame_{}.jpg"),
        ("{}_drivable.png", "{}.jpg"),
        ("frame_{}_jpg.rf." + "0a" * 16 + ".jpg", "frame_{}.jpg"),
        ("0a1b2c3d-frame_{}.png", "frame_{}.jpg"),
        # macOS writes the dots of an umlaut as a letter of their own.
        ("Bru\u0308cke {}_mask.png", "Br\u00fccke {}.jpg"),
        ("Br\u00fccke {}.png", "Bru\u0308cke {}.jpg"),
    ],
)
def test_what_all_labels_have_around_the_name_of_the_image_is_no_part_of_it(label, image):
    numbers = [f"{number:04}" for number in (7, 8, 10)]
    pairs = images_of(*([Path(name.format(n)) for n in numbers] for name in (label, image)))
    expected = {Path(label.format(n)): Path(image.format(n)) for n in numbers}
    assert pairs == expected


BITS = 6


def marked(number: int) -> bytes:
    """Return a mask that tells its number by its first row."""
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    mask[0, :BITS] = [255 * (number >> bit & 1) for bit in range(BITS)]
    return png(mask)


@pytest.fixture(scope="module")
def masks(tmp_path_factory: pytest.TempPathFactory) -> MaskSettings:
    folder = tmp_path_factory.mktemp("masks")
    for number in range(FRAMES):
        (folder / f"{number:04}.png").write_bytes(marked(number))
    return MaskSettings(path=str(folder))


def paired(path: Path, settings: MaskSettings) -> tuple[list[int], int]:
    """Return the frames, by the number that each stamp is, that have a mask, and `unsure`.

    The mask must be the frame's own.
    """
    numbers = []
    with open_log(path, LogConfig(masks={"net": settings})) as log:
        selection = log.select()
        for logged in log.frames(selection):
            with suppress(FrameError):
                frame = logged.decode()
                if "net" in frame.external:
                    numbers.append((frame.stamp_ns - START) // broken.PERIOD)
                    bits = frame.external["net"][0, :BITS].tolist()
                    assert numbers[-1] == sum(bit << place for place, bit in enumerate(bits))
        return numbers, selection.masks["net"].pairing.unsure


def saved(folder: Path, data: bytes) -> Path:
    path = folder / "drive.mcap"
    path.write_bytes(data)
    return path


def without_a_chunk(times: int) -> bytes:
    data = good()
    at = chunk(3, data)
    end = at + length_of(data, at)
    return data[:at] + data[at:end] * times + data[end:]


def out_of_order() -> bytes:
    data = broken.log([10, 11, 0, 1, 12, 13, *range(2, 10), *range(14, FRAMES)]).bytes()
    begin, end, last = chunk(1, data), chunk(2, data), chunk(19, data)
    return over(data, begin, bytes(end - begin))[:last]


def foreign_message() -> bytes:
    data = good("unchunked")
    return over(data, message(13, data) + HEAD, b"\7")


SOUND = ("ok", "unchunked", "noindex", "nostats", "dataend_crc_bad", "trunc_last1")
COUNTED = ("chunk_crc_field_bad", "chunk_data_flip_lz4")
CASES: dict[str, tuple[Any, list[int], int | None]] = {
    **{name: (name, [*range(FRAMES)], 0) for name in SOUND},
    # The index tells how many messages the damage took.
    **{name: (name, [n for n in range(FRAMES) if n not in {6, 7}], 0) for name in COUNTED},
    "trunc_midchunk": ("trunc_midchunk", [*range(36)], 0),
    "trunc_unchunked": ("trunc_unchunked", [*range(28)], 0),
    # It took an unknown number, before so many frames that are left.
    "zero_hole": ("zero_hole", [*range(6)], 32),
    "huge_len_msg_unchunked": ("huge_len_msg_unchunked", [*range(5)], 34),
    "a chunk lacks": (lambda: without_a_chunk(0), [], None),
    "a chunk is there twice": (lambda: without_a_chunk(2), [], None),
    "a hole among chunks out of order": (out_of_order, [], None),
    "a message of another channel": (foreign_message, [*range(13)], None),
}


@pytest.mark.parametrize("case", CASES)
def test_a_frame_has_its_own_mask_or_none_whatever_was_lost_before_it(masks, tmp_path, case):
    made, expected, unsure = CASES[case]
    data = made() if callable(made) else broken.BROKEN[made][1]().data
    found = paired(saved(tmp_path, data), masks)
    assert found == (expected, found[1] if unsure is None else unsure)


@pytest.mark.parametrize(
    ("spoilt", "content"),
    [
        (0, lambda data: bytes(len(data))),
        (1, lambda data: bytes(len(data))),
        (1, lambda data: b""),
        (1, lambda data: data[:8]),
        (0, lambda data: data[:60]),
        (1, None),
    ],
    ids=["first zeroed", "zeroed", "empty", "nothing in it", "without a topic", "missing"],
)
def test_a_file_of_a_split_log_that_is_lost_leaves_no_number_sure(masks, tmp_path, spoilt, content):
    parts = [range(14), range(14, 28), range(28, FRAMES)]
    for place, part in enumerate(parts):
        data = broken.log([*part]).bytes()
        if place != spoilt or content is not None:
            data = content(data) if place == spoilt else data
            (tmp_path / f"drive_{place}.mcap").write_bytes(data)
    assert paired(tmp_path, masks) == ([], FRAMES - len(parts[spoilt]))


def test_what_a_split_log_lost_at_the_end_of_a_file_shifts_no_number_before_it(masks, tmp_path):
    for place, part in enumerate((range(14), range(14, FRAMES))):
        data = broken.log([*part]).bytes()
        data = data[: chunk(3, data) - 1] if place == 0 else data
        (tmp_path / f"drive_{place}.mcap").write_bytes(data)
    assert paired(tmp_path, masks) == ([*range(6)], FRAMES - 14)


@pytest.mark.parametrize("later_ns", [0, -(10**12), 10**12])
def test_masks_of_another_log_lose_their_numbers_too(tmp_path, later_ns):
    """Whatever the log times of the other log."""
    made = broken.log()
    moved = [replace(each, log_time=each.log_time + later_ns) for each in made.messages]
    data = replace(made, messages=tuple(moved)).bytes()
    begin, end = chunk(3, data), chunk(4, data)
    other = tmp_path / "other.mcap"
    other.write_bytes(over(data, begin, bytes(end - begin)))
    settings = MaskSettings(path=f"{other}:{broken.MASK}", pair="number")
    with open_log(saved(tmp_path, good()), LogConfig(masks={"net": settings})) as log:
        selection = log.select()
        seen = [frame.number for frame in log.frames(selection) if "net" in frame.labels]
    assert seen == list(range(6))
    assert selection.masks["net"].pairing.unsure == FRAMES - 6


def test_the_truth_is_not_held_against_itself_by_the_log_s_own_path(tmp_path):
    path = saved(tmp_path, good())
    itself = LogConfig(masks={"net": MaskSettings(path=f"{path}:{broken.MASK}")})
    with (
        open_log(path, itself) as log,
        pytest.raises(LogError, match="is the truth that it is scored"),
    ):
        log.select()


@pytest.mark.parametrize("count", [FRAMES - 1, FRAMES + 1])
def test_a_log_that_was_not_made_of_the_images_is_refused(masks, tmp_path, count):
    (tmp_path / "images").mkdir()
    for number in range(count):
        (tmp_path / "images" / f"{number:04}.jpg").touch()
    settings = replace(masks, images=str(tmp_path / "images"))
    with pytest.raises(LogError, match=f"holds {count} images and the log 40, so it was not made"):
        paired(saved(tmp_path, good()), settings)


@pytest.mark.parametrize("chunked", [True, False])
def test_without_any_time_labels_after_a_hole_belong_to_nobody(tmp_path, chunked):
    timeless = broken.log(list(range(FRAMES)), stamp=0, use_chunking=chunked).bytes()
    begin, end = (
        chunk(number, timeless) if chunked else message(number, timeless) for number in (3, 4)
    )
    holed = over(timeless, begin, bytes(end - begin))
    with open_log(saved(tmp_path, holed)) as log:
        stream = log.frames(log.select())
        assert [frame.number for frame in stream if frame.labels] == []

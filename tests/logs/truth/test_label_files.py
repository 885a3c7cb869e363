"""Labels beside the log that do not fit, or cannot be read: each is refused, or counted."""

import json
import shutil
import time
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest

from roadeval.logs.errors import FrameError, LogError
from roadeval.logs.log import open_log
from roadeval.logs.settings import LabelPlace, LabelSettings, LogConfig, TopicSettings
from roadeval.logs.truth.formats.coco import lengths_in
from roadeval.logs.truth.label_files import GREATEST, labels_in
from roadeval.logs.truth.meaning import label_files
from roadeval.runtime.sentence import Setting
from tests.e2e.commands import here
from tests.fixtures.logged import write_drive
from tests.fixtures.shared import shared
from tests.logs.making import compressed, grey, jpeg, raw, ros2_log
from tests.logs.truth.test_folder import opened
from tests.logs.truth.test_formats import LABELS, SIZE

FRAMES = 6
START = 1_700_000_000 * 10**9
STEP = 10**8
LOWER = np.zeros((32, 48), np.uint8)
LOWER[16:] = 255


@pytest.fixture(scope="module")
def drive(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("drive") / "drive.mcap"
    noise = [
        np.random.default_rng(n).integers(0, 256, (32, 48, 3), np.uint8) for n in range(FRAMES)
    ]
    return write_drive(path, ((START + n * STEP, {"/camera": i}) for n, i in enumerate(noise)))


def images(folder: Path, *names: str, pixels=LOWER) -> Path:
    folder.mkdir(exist_ok=True)
    for name in names:
        cv2.imwrite(str(folder / name), pixels)
    return folder


def select(drive: Path, path: Path, *road: int | str, resize: bool = False, **place: Any) -> Any:
    config = LogConfig(
        truth=LabelPlace(str(path), **place),
        labels=LabelSettings(road=road),
        topics=TopicSettings(resize_truth=resize),
    )
    with open_log(drive, config) as log:
        selection = log.select()
        frames = list(log.frames(selection))
        return selection, [frame.number for frame in frames if frame.labelled], frames


def refusal(*arguments: Any, **place: Any) -> LogError:
    with pytest.raises(LogError) as caught:
        select(*arguments, **place)
    assert "\n" not in str(caught.value)
    return caught.value


def replay(drive: Path, path: Path, *words: Any):
    """Score masks, which learn nothing, against truth beside the log."""
    folder = images(path.parent / "net", *(f"{number}.png" for number in range(FRAMES)))
    out = path.parent / "reports"
    run = here(
        *("replay", drive, "--truth", path, "--masks", f"net={folder}", "--only", "net", "-q"),
        *("--record", "none", "--reports", out, *words),
    )
    summary = out / "summary.json"
    return run, json.loads(summary.read_text()) if summary.exists() else {}


# --- Names ----------------------------------------------------------------------------------------


def test_numbers_count_from_the_first_frame_s_which_is_asked_for_if_nothing_tells_it(
    drive, tmp_path
):
    path = images(tmp_path / "truth", "2.png", "4.png")
    assert Setting("truth.first") in refusal(drive, path).remedy.parts
    assert select(drive, path, first=0)[1] == [2, 4]
    assert select(drive, path, first=1)[1] == [1, 3]
    selection, labelled, _ = select(drive, images(path, "6.png"))
    assert labelled == [1, 3, 5]
    assert selection.truth.why == "3 labels, paired by number, from 1"


def test_labels_of_several_cameras_are_refused_until_one_is_chosen(drive, tmp_path):
    path = tmp_path / "truth"
    path.mkdir()
    for side, count in (("left", 4), ("right", 6)):
        images(path / side, *(f"{number}.png" for number in range(count)))
    assert "`truth.names`, as 'left/*'" in refusal(drive, path).remedy
    assert select(drive, path, names="left/*")[1] == [0, 1, 2, 3]
    other = refusal(drive, path, names="rear/*")
    assert other.setting == "truth.names"
    assert "no label has a name as rear/*" in other.problem


def test_names_of_no_image_are_refused_with_three_of_each(drive, tmp_path):
    named = images(tmp_path / "images", *(f"a{letter}.png" for letter in "uvwxyz"))
    path = images(tmp_path / "truth", *(f"b{letter}.png" for letter in "uvwx"))
    message = refusal(drive, path, images=str(named)).problem
    assert "theirs are bu.png, bv.png, bw.png, ..., the images' au.png, av.png, aw.png" in message


@pytest.mark.parametrize("path", shared("failures"))
def test_shared_labels_in_wrong_forms_meet_their_frames_or_are_refused(path):
    log, labels = path / "labels" / "bare.mcap", path / "labels"
    lacking = select(log, labels / "lab1m")[1]
    assert lacking == [number for number in range(30) if number != 15]
    first = {"first": 0}
    assert select(log, labels / "roboflow_names.json", "road", **first)[1] == [10, 12, 17]
    named = select(log, labels / "prefix_names", images=str(labels / "lab"))[1]
    assert named == [*range(30)]
    for name in ("other_camera_names.json", "cvat_two_cameras.xml"):
        assert "`truth.names`" in refusal(log, labels / name, "road").remedy
    config = LogConfig(labels=LabelSettings(road=(3,), ignore=(11,)))
    with open_log(path / "one_stamp_in_the_future.mcap", config) as log:
        assert sum(frame.labelled for frame in log.frames(log.select())) == 40


def test_labels_that_find_no_frame_are_told(drive, tmp_path):
    """Frames lie 100 ms apart."""
    late = (0, 20, 51)
    names = (f"{(START + number * STEP) // 10**6 + late[number]}.png" for number in range(3))
    path = images(tmp_path / "truth", *names)
    run, summary = replay(drive, path, "--sync-tolerance", "30")
    assert summary["frames"]["labelled"] == 2
    assert "1 of the 3 labels of" in run.stderr
    assert "the first is 49.0 ms from the nearest, and at most 30.0 are allowed" in run.stderr


# --- Sizes and damage -----------------------------------------------------------------------------


def test_another_size_is_refused_or_scaled(drive, tmp_path):
    path = images(tmp_path / "truth", *(f"{number}.png" for number in range(FRAMES)))
    images(path, "3.png", pixels=LOWER[::2, ::2])
    assert str(refusal(drive, path)).endswith(
        "3.png is 24x16, but /camera is 48x32: scale the labels with `topics.resize_truth`"
    )
    _, _, frames = select(drive, path, resize=True)
    np.testing.assert_array_equal(frames[3].decode().truth, frames[2].decode().truth)


def test_labels_of_a_part_of_the_image_are_not_told_to_be_scaled(drive, tmp_path):
    names = (f"{number}.png" for number in range(FRAMES))
    path = images(tmp_path / "truth", *names, pixels=LOWER[16:])
    assert "another shape: fill labels of a part of the image up to" in str(refusal(drive, path))
    selection, _, _ = select(drive, path, resize=True)
    (warning,) = selection.truth.meaning.notes
    assert warning.startswith("labels of 48x16 are stretched to 48x32, another shape")


def test_a_damaged_file_among_many_loses_its_frame(drive, tmp_path):
    path = images(tmp_path / "truth", *(f"{number}.png" for number in range(FRAMES)))
    content = (path / "3.png").read_bytes()
    (path / "3.png").write_bytes(content[:50])
    run, summary = replay(drive, path)
    assert run.returncode == 3
    assert f"lost: frame 3: {path / '3.png'}: " in run.stderr
    assert summary["frames"]["skipped"] == {"undecodable": 1}


def test_a_frame_that_is_ignored_as_a_whole_is_evaluated_nowhere(drive, tmp_path):
    path = images(tmp_path / "truth", *(f"{number}.png" for number in range(FRAMES)))
    images(path, "3.png", pixels=np.full_like(LOWER, 128))
    _, summary = replay(drive, path)
    assert summary["frames"]["evaluated"] == summary["totals"]["net"]["post"]["frames"] == 5
    assert summary["beyond"]["net"]["frames"] == 5
    assert summary["frames"]["skipped"] == {"unlabelled": 1}


@pytest.mark.parametrize("name", ["1.png", "1.npy", "a.json", "a.xml", "1.txt"])
def test_a_damaged_file_alone_is_one_line(drive, tmp_path, name):
    path = tmp_path / "truth"
    path.mkdir()
    (path / name).write_bytes(b"\x89no label\xff")
    run, _ = replay(drive, path, "--road-label", "1")
    assert run.returncode == 1
    assert len(run.stderr.splitlines()) == 1
    assert run.stderr.startswith("roadeval: error: ")


@pytest.mark.parametrize("name", ["coco/labelformat.json", "cvat/annotations.xml"])
@pytest.mark.parametrize("share", [0.3, 0.9])
def test_a_file_that_ends_early_is_refused_alone_or_beside_another(tmp_path, name, share):
    content = (LABELS / name).read_text()
    path = written(tmp_path / "truth", f"b.{name[-4:]}", content[: int(share * len(content))])
    for place in (path, path.parent):
        with pytest.raises(LogError, match=r"it is not (JSON|XML), or ends early \(line \d+, col"):
            labels_in(place, SIZE)
        shutil.copy(LABELS / name, path.with_name(f"a.{name[-4:]}"))


@pytest.mark.parametrize("extra", ["notes.txt", "about.json", "._1.png", ".DS_Store"])
def test_a_note_or_a_hidden_file_beside_label_images_is_no_label(drive, tmp_path, extra):
    """macOS puts ``._NAME`` beside each file on other disks, and into ZIP archives."""
    path = images(tmp_path / "truth", "1.png")
    (path / extra).write_bytes(b'{"by": "us"}' if extra == "about.json" else b"\0\5\x16\7"[:4])
    assert select(drive, path, first=0)[1] == [1]
    is_hidden = extra.startswith(".")
    assert (path / extra in label_files(LabelPlace(str(path)))) is not is_hidden


def test_labels_lie_below_a_list_of_names(drive, tmp_path):
    """Label Studio exports labels in this way."""
    path = tmp_path / "export"
    shutil.copytree(LABELS / "yolo" / "labels", path / "labels")
    images(path / "images", "frame_0000.png")
    (path / "classes.txt").write_text("road\ncar\nego\n")
    assert select(drive, path, 0)[1] == [0, 1, 3]


# --- Annotation tools' files ----------------------------------------------------------------------


def written(path: Path, name: str, content: Any) -> Path:
    path.mkdir(exist_ok=True)
    (path / name).write_text(content if isinstance(content, str) else json.dumps(content))
    return path / name


@pytest.mark.parametrize("content", ["", " \n\n"])
def test_a_file_of_yolo_without_labels_is_an_image_without_a_shape(tmp_path, content):
    written(tmp_path, "1.txt", "0 .1 .1 .5 .1 .5 .5")
    written(tmp_path, "2.txt", content)
    notes = labels_in(tmp_path, SIZE).notes
    assert notes == ("1 of 2 images have no shape, and count as not labelled",)


def test_a_byte_order_mark_is_no_part_of_a_file_of_yolo(tmp_path):
    content = "\ufeff0 .1 .1 .5 .1 .5 .5\r\n1 .1 .1 .2 .1 .2 .2\r\n"
    assert dict(labels_in(written(tmp_path, "1.txt", content), SIZE).occurring) == {"0": 1, "1": 1}


def coco(segmentation: Any, **image: Any) -> dict[str, Any]:
    return {
        "images": [{"id": 1, "file_name": "1.png", "width": 48, "height": 32} | image],
        "categories": [{"id": 1, "name": "road"}],
        "annotations": [{"image_id": 1, "category_id": 1, "segmentation": segmentation}],
    }


SQUARE = [[10, 10, 20, 10, 20, 20, 10, 20]]


WRONG = {
    "a number that is none": coco([[10, 10, float("nan"), 10, 20, 20]]),
    "an endless one": coco([[10, 10, float("inf"), 10, 20, 20]]),
    "an odd number of numbers": coco([[10, 10, 20, 10, 20]]),
    "runs that are too short": coco({"counts": [10, 20], "size": [32, 48]}),
    "runs that are too long": coco({"counts": [10, 48 * 32], "size": [32, 48]}),
    "negative runs": coco({"counts": [-10, 48 * 32 + 10], "size": [32, 48]}),
    "runs that add up by overflow": coco({"counts": [2**63 - 1, 2**63 - 1, 48 * 32 + 2]}),
    "a text that is not runs": coco({"counts": "~~~"}),
    "a text that never ends": coco({"counts": "o" * 300_000}),
    "a text of other letters": coco({"counts": "\u20ac!"}),
    "a huge image": coco(SQUARE, width=10**9, height=10**9),
    "a negative one": coco(SQUARE, width=-48),
    "a list": [],
    "no images": {"images": 3, "annotations": [], "categories": []},
    "a class that is not listed": coco(SQUARE) | {"categories": []},
    "an image that is not listed": coco(SQUARE) | {"images": []},
}


@pytest.mark.parametrize("what", WRONG)
def test_what_cannot_be_drawn_is_one_line(drive, tmp_path, what):
    began = time.perf_counter()
    path = written(tmp_path / "truth", "a.json", WRONG[what])
    assert str(path) in str(refusal(drive, path, "road"))
    assert time.perf_counter() - began < 20


def test_what_is_doubtful_about_labels_is_among_the_reasons_that_info_prints(drive, tmp_path):
    content = coco(SQUARE, file_name="0.png")
    content["categories"].append({"id": 2, "name": "car"})
    content["images"].append(content["images"][0] | {"id": 2, "file_name": "2.png"})
    content["annotations"].append(content["annotations"][0] | {"image_id": 2, "category_id": 2})
    selection, _, _ = select(drive, written(tmp_path / "t", "a.json", content), "road")
    (doubt, *_) = (line for line in selection.reasons if "none of road" in line)
    assert doubt.startswith("truth: 1 of 2 images have shapes, but none of road")


def test_what_cannot_be_drawn_loses_its_frame_alone(drive, tmp_path):
    content = json.loads((LABELS / "coco" / "labelformat.json").read_text())
    content["annotations"][0]["segmentation"][0][0] = float("nan")
    content["images"][3]["width"] = 10**9
    run, summary = replay(drive, written(tmp_path / "t", "a.json", content), "--road-label", "road")
    assert run.returncode == 3
    assert "frame 0: frame_0000.png: an outline of road whose points are not pixels" in run.stderr
    assert "frame 3: frame_0003.png: an image of 1000000000x32, more than" in run.stderr
    assert summary["frames"]["evaluated"] == 1


def replaced(content: Any, value: Any):
    """Yield the content with each of its parts in turn replaced by a value."""
    yield value
    parts = content.items() if isinstance(content, dict) else ()
    parts = enumerate(content[:2]) if isinstance(content, list) else parts
    for key, part in parts:
        for other in replaced(part, value):
            changed = content.copy()
            changed[key] = other
            yield changed


def look(path: Path) -> None:
    """Read all labels that can be read; anything but a known error of one line fails the test."""
    errors = []
    try:
        labels = opened(path, SIZE)
        _ = labels.digest
        for position in range(len(labels)):
            try:
                labels.picture(position)
            except FrameError as error:
                errors.append(error)
    except LogError as error:
        errors.append(error)
    assert not any("\n" in str(error) for error in errors)


@pytest.mark.parametrize(
    "value",
    [None, 1e300, {"a": 1}, *(pytest.param(v, marks=pytest.mark.sweep) for v in (-1, "\0", []))],
    ids=repr,
)
@pytest.mark.parametrize("tool", ["coco/pycocotools", "labelme/frame_0001", "label_studio/tasks"])
def test_any_part_may_be_something_else(tmp_path, tool, value):
    content = json.loads((LABELS / f"{tool}.json").read_text())
    for changed in replaced(content, value):
        look(written(tmp_path, "frame_0001.json", changed))


@pytest.mark.parametrize(
    "value",
    [
        *("", "1e300", "9" * 5000, "1,2;3"),
        *(pytest.param(text, marks=pytest.mark.sweep) for text in ("x", "-1", "nan", "1,2,3;4")),
    ],
)
def test_any_attribute_may_be_something_else(tmp_path, value):
    for name in ("annotations.xml", "boxed.xml"):
        tree = ElementTree.parse(LABELS / "cvat" / name)
        for element in [*tree.iter()][-11:]:
            for key, before in element.attrib.items():
                element.attrib[key] = value
                tree.write(tmp_path / "1.xml")
                look(tmp_path / "1.xml")
                element.attrib[key] = before


LAUGHS = "".join(f'<!ENTITY l{n} "{f"&l{n - 1};" * 10 if n else "ha"}">' for n in range(12))
ENTITIES = (
    f"<!DOCTYPE a [{LAUGHS}]><annotations>&l11;</annotations>",
    '<!DOCTYPE a [<!ENTITY x "48">]><annotations><a b="&x;"/></annotations>',
)
HOSTILE = {
    **{
        f"{encoding} {len(text)}": ("1.xml", text.encode(encoding), "cannot be read as labels: ")
        for text in ENTITIES
        for encoding in ("utf-8", "utf-8-sig", "utf-16")
    },
    "another encoding": (
        "1.xml",
        b'<?xml version="1.0" encoding="cp037"?>' + ENTITIES[0].encode("cp037"),
        "cannot be read as labels: ",
    ),
    "deep XML": (
        "1.xml",
        b"<annotations>%s%s</annotations>" % (b"<a>" * 100_000, b"</a>" * 100_000),
        "without a shape",
    ),
    "deep JSON": ("1.json", b"[" * 100_000 + b"]" * 100_000, "more than 32 tables and lists"),
    "large JSON": ("1.json", None, f"314,572,800 bytes, and at most {GREATEST:,} are read"),
    "a long line": ("1.txt", b"0" + b" -1" * 5000 + b" x", "line 1 is not a class with an outline"),
}


@pytest.mark.parametrize("what", HOSTILE)
def test_a_hostile_file_is_refused_in_one_line_and_little_time(tmp_path, what):
    name, content, reason = HOSTILE[what]
    began = time.perf_counter()
    with (tmp_path / name).open("wb") as file:
        file.write(content or b"")
        file.truncate(300 << 20 if content is None else len(content))
    with pytest.raises(LogError, match=reason) as caught:
        labels_in(tmp_path / name, SIZE)
    assert "\n" not in str(caught.value)
    assert time.perf_counter() - began < 10


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("1.txt", "0 .5 .5 .2 .2", "0 is drawn as a box without an outline"),
        ("a.xml", "<annotations><track/></annotations>", "tracks of a video"),
        (
            "a.xml",
            '<annotations><image name="1.png" width="48" height="32"><spline label="a"/></image>'
            "</annotations>",
            "1.png: a is drawn as a spline",
        ),
        ("a.json", {"shapes": [], "imageWidth": 4, "imageHeight": 4}, "LabelMe without a shape"),
    ],
)
def test_what_a_format_has_and_nobody_reads_is_said(tmp_path, name, content, reason):
    with pytest.raises(LogError, match=reason):
        labels_in(written(tmp_path / "truth", name, content), SIZE)


def test_a_long_text_of_runs_is_read_in_a_time_that_grows_with_its_length():
    began = time.perf_counter()
    assert len(lengths_in("o" * 1_000_000)) > 1000
    assert time.perf_counter() - began < 10


# --- Another log ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def rig(tmp_path_factory) -> tuple[Path, Path]:
    """A log of two cameras, and logs of truth of the left one, by its topic and its header."""
    folder = tmp_path_factory.mktemp("rig")
    mask = grey(0)
    mask[3:] = 255

    def log(name, *topics):
        messages = []
        for stamp in range(START, START + FRAMES * STEP, STEP):
            for topic, side in topics:
                message = raw(stamp, mask, "mono8")
                if "image" in topic:
                    message = compressed(stamp, jpeg(grey(90)))
                message["header"]["frame_id"] = f"cam_{side}"
                messages.append((topic, stamp, message))
        return ros2_log(folder / name, messages)

    cameras = ("/left/image", "left"), ("/right/image", "right")
    by_path, by_id = ("/left/labels", "left"), ("/labels", "left")
    return log("rig.mcap", *cameras), log("path.mcap", by_path), log("id.mcap", by_id)


@pytest.mark.parametrize(("which", "topic"), [(1, "/left/labels"), (2, "/labels")])
def test_truth_of_another_camera_is_refused_unless_its_topic_is_named(rig, which, topic):
    def select_of(side, path):
        topics = TopicSettings(image=f"/{side}/image")
        with open_log(rig[0], LogConfig(topics=topics, truth=LabelPlace(path))) as log:
            return log.select().truth.where

    path = str(rig[which])
    assert select_of("left", path).startswith(f"{topic} of ")
    with pytest.raises(LogError, match=f"{topic} belongs to another camera than /right/image, by"):
        select_of("right", path)
    assert select_of("right", f"{path}:{topic}").startswith(f"{topic} of ")

"""Which digits of the names number the frames, from which number on, and of which camera."""

import random
import uuid
from contextlib import suppress
from pathlib import Path

import pytest

from roadeval.images.formats import Limits
from roadeval.logs.errors import LogError
from roadeval.logs.files import images_of
from roadeval.logs.messages.encoding import TopicKind
from roadeval.logs.settings import LabelPlace
from roadeval.logs.topics.choose import check_names
from roadeval.logs.topics.reader import TopicInfo
from roadeval.logs.truth.names import LabelSet, NamedLabel, find_keys


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
    with pytest.raises(LogError, match=r"give `truth\.first` 0 or `truth.first` 1"):
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
    """2,000 sets of names, bases and gaps: the right frames, or a refusal that says what to do."""
    taken = 0
    for seed in range(2000):
        expected, frames, first = drawn_set(seed)
        for settings in ({}, {"first": first}):
            with suppress(LogError):
                numbers = frames_of(expected, frames, **settings)
                assert numbers == expected, seed
                taken += 1
    assert taken > 1000


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
    ],
)
def test_what_all_labels_have_around_the_name_of_the_image_is_no_part_of_it(label, image):
    numbers = [f"{number:04}" for number in (7, 8, 10)]
    pairs = images_of(*([Path(name.format(n)) for n in numbers] for name in (label, image)))
    expected = {Path(label.format(n)): Path(image.format(n)) for n in numbers}
    assert pairs == expected

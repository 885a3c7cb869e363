"""Which label belongs to which image, of the same clock and of another."""

import re
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from roadeval.logs.errors import LogError
from roadeval.logs.log import open_log
from roadeval.logs.settings import LabelPlace, LogConfig, TopicSettings
from roadeval.logs.topics.reader import UNREADABLE
from roadeval.logs.truth.pairing import (
    Clock,
    Pairing,
    Partners,
    clock_of,
    frames_of,
    tolerance,
)
from roadeval.logs.writing.writer import LogWriter
from tests.logs.making import grey, png


class Stamps:
    def __init__(self, stamps: Sequence[int]) -> None:
        self.stamps = stamps
        self.read: set[int] = set()

    def __len__(self) -> int:
        return len(self.stamps)

    def stamp(self, position: int) -> int:
        self.read.add(position)
        return self.stamps[position]


NOW = 1_700_000_000_123_456_789
PAIRED = {
    "equal stamps": ([10, 20, 30], [10, 20, 30], 0, [0, 1, 2]),
    "an image without a label": ([10, 20, 30], [10, 30], 0, [0, None, 1]),
    "no label": ([10], [], 0, [None]),
    "a nanosecond apart": ([NOW], [NOW + 1], 0, [None]),
    "neighbours a nanosecond apart": ([NOW, NOW + 1], [NOW, NOW + 1], 0, [0, 1]),
    "the nearest within the tolerance": ([10, 20, 30], [12, 21, 36], 5, [0, 1, None]),
    "a label's nearest image alone": ([10, 14], [13], 5, [None, 0]),
    "an exact pair before a near image": ([10, 11], [11], 5, [None, 0]),
    "the first of two equally near images": ([10, 14], [12], 5, [0, None]),
    "repeated stamps in their order": ([10, 10, 20], [10, 10, 20], 0, [0, 1, 2]),
    "more images than labels of a stamp": ([7] * 9, [7] * 7, 0, [*range(7), None, None]),
    "more labels than images of a stamp": (
        [3, *[7] * 9, 9],
        [*[7] * 12, 9],
        0,
        [None, *range(9), 12],
    ),
    "a repeated image and one label": ([10, 10, 20], [10, 20], 0, [0, None, 1]),
    "logged out of order": ([10, 30, 20, 40], [20, 10, 40, 30], 0, [1, 3, 0, 2]),
    "unreadable": ([10, UNREADABLE, 30], [10, UNREADABLE, 30], 0, [0, None, 2]),
}


def paired(pairing):
    """The position of each image's label."""
    partners = Partners(pairing)
    return [partners.of(image) for image in range(len(pairing.images))]


@pytest.mark.parametrize(("images", "labels", "tolerance", "expected"), PAIRED.values(), ids=PAIRED)
def test_each_image_gets_the_label_that_is_its_own(images, labels, tolerance, expected):
    assert paired(Pairing(Stamps(images), Stamps(labels), tolerance)) == expected


def test_only_stamps_near_the_one_looked_for_are_read() -> None:
    images, labels = Stamps(range(0, 100_000, 10)), Stamps(range(0, 100_000, 10))
    assert Partners(Pairing(images, labels, 5)).of(7_000) == 7_000
    assert len(images.read) + len(labels.read) < 60


@given(
    st.lists(st.integers(0, 60), max_size=30).map(sorted),
    st.lists(st.integers(0, 60), max_size=30).map(sorted),
    st.integers(0, 6),
)
@example([0] * 6, [0] * 5, 0)
@example([0] * 3 + [7] * 9 + [9], [7] * 12, 2)
def test_the_frames_of_labels_are_those_that_find_a_label(images, labels, tolerance):
    pairing = Pairing(Stamps(images), Stamps(labels), tolerance)
    assert sorted(frames_of(pairing)) == [
        n for n, at in enumerate(paired(pairing)) if at is not None
    ]


def test_no_frame_is_given_twice_where_stamps_are_equal_and_out_of_order():
    images = [*[1] * 7, *[2] * 5, *[3] * 3, 4, *[5] * 5, *[7] * 3]
    labels = [0, 0, 1, 2, 5, 2, 5, 5, 5, 5, 6, 6, 7, 8, 8]
    frames = [*frames_of(Pairing(Stamps(images), Stamps(labels), 20))]
    assert sorted({*frames}) == sorted(frames)


rising = st.lists(st.integers(0, 60), max_size=30, unique=True).map(sorted)


@given(rising, rising, st.integers(0, 6), st.integers(2, 5))
def test_stamps_in_order_pair_the_same_however_few_are_read(images, labels, tolerance, period):
    few, all_around = (
        paired(Pairing(Stamps(images), Stamps(labels), tolerance, period_ns))
        for period_ns in (period, 0)
    )
    assert few == all_around


# --- By what images and labels are paired ---------------------------------------------------------

BAD = UNREADABLE
TIMES = [100, 200, 300]


class Topic:
    """The messages of a topic, of which only stamps and log times are known."""

    def __init__(self, stamps, times):
        self.stamp = stamps.__getitem__
        self.log_times = np.array(times)

    def __len__(self):
        return len(self.log_times)


@pytest.mark.parametrize(
    ("stamps", "times", "clock"),
    [
        ([1, 2, 3], TIMES, Clock.STAMP),
        ([0, 0, 0], TIMES, Clock.LOG_TIME),
        ([7, 7, 7], TIMES, Clock.LOG_TIME),
        ([0, 0, 0], [100, 100, 100], Clock.ORDER),
        ([7], [100], Clock.STAMP),
        ([0], [100], Clock.LOG_TIME),
        # If only one image can be read, its stamp does not show whether stamps differ.
        ([BAD, 7, BAD], TIMES, Clock.STAMP),
        ([*[BAD] * 20, 7, 8], list(range(22)), Clock.STAMP),
    ],
)
def test_stamps_count_unless_they_are_zero_or_equal(stamps, times, clock):
    assert clock_of(Topic(stamps, times)) is clock


@pytest.mark.parametrize(
    ("stamps", "times", "setting_ms", "expected"),
    [
        ([0, 1000, 2000, 3000], TIMES, None, 50),
        # Written in one go: the log times say nothing.
        ([0, 1000, 2000, 3000], [7, 7, 7, 7], None, 500),
        ([0, BAD, 2000, BAD], [7, 7, 7, 7], None, 1000),
        ([0, 1000, 2000, 3000], TIMES, 1.5, 1_500_000),
        ([1000], [100], None, 50_000_000),
        ([1000], [100], 1.5, 1_500_000),
    ],
)
def test_half_the_frame_period_may_lie_between_an_image_and_its_label(
    stamps, times, setting_ms, expected
):
    assert tolerance(Topic(stamps, times), setting_ms) == expected


@pytest.mark.parametrize(
    "stamps",
    [
        [*range(0, 250, 10), 9_000, *range(260, 400, 10)],
        [*range(0, 250, 10), 0, *range(260, 400, 10)],
        [*range(200, 400, 10), *range(0, 200, 10)],
        [*range(0, 400, 10)][::-1],
    ],
    ids=["one in the future", "one repeated", "two parts exchanged", "backwards"],
)
@pytest.mark.parametrize("labels", [lambda stamps: stamps, sorted], ids=["alike", "in order"])
def test_equal_stamps_are_a_pair_in_whatever_order_they_come(stamps, labels):
    pairing = Pairing(Stamps(stamps), Stamps(labels(stamps)), 4, is_small=True)
    partners = Partners(pairing)
    partner_labels = [partners.of(image) for image in range(len(stamps))]
    assert [labels(stamps)[label] for label in partner_labels] == stamps
    assert len({*partner_labels}) == len(partner_labels)
    assert partners.unpaired(of_all=True) == (0, 0)


def test_in_a_large_log_a_stamp_in_the_future_is_found_beside_the_last_pair():
    stamps = [*range(0, 250, 10), 9_000, *range(260, 4000, 10)]
    images, labels = Stamps(stamps), Stamps(stamps)
    partners = Partners(Pairing(images, labels, 4, period=10))
    assert [partners.of(image) for image in range(20, 30)] == [*range(20, 30)]
    assert len(labels.read) < 60


def test_labels_without_a_frame_and_frames_that_lose_theirs_are_counted():
    partners = Partners(Pairing(Stamps([100, 104, 200]), Stamps([40, 103, 190, 203]), 5))
    assert [partners.of(image) for image in range(3)] == [None, 1, 3]
    assert (partners.unpaired(of_all=True), partners.missed) == ((2, 60), 1)
    assert partners.unpaired(of_all=False) == (1, 10)
    none = Partners(Pairing(Stamps([900]), Stamps([40]), 5))
    assert (none.of(0), none.unpaired(of_all=False)) == (None, (0, 0))


START, STEP, FRAMES, NS = 1_700_000_000 * 10**9, 10**8, 40, 10**9
ROAD = np.full((6, 8), 255, np.uint8)


def write(path, topics):
    """Write a log of topics, each with the stamps and log times of its messages."""
    messages = [
        (logged, topic, stamp) for topic, times in topics.items() for stamp, logged in times
    ]
    with LogWriter(path) as writer:
        for logged, topic, stamp in sorted(messages):
            if topic == "/labels":
                writer.mask(topic, stamp, ROAD, log_time_ns=logged)
            else:
                writer.image(topic, stamp, png(grey(9)), "png", log_time_ns=logged)
    return path


def times(stamp_s=0.0, logged_s=0.0, chosen=range(FRAMES)):
    """Return stamps and log times, these many seconds behind the moments of the frames."""
    moments = [START + number * STEP for number in chosen]
    return [(at + round(stamp_s * NS), at + round(logged_s * NS)) for at in moments]


def labelled(path, **settings):
    with open_log(path, LogConfig(**settings)) as log:
        selection = log.select()
        return [frame.number for frame in log.frames(selection) if frame.labelled], selection


@pytest.mark.parametrize("apart", [-37, 37, -18, 3600, -7200])
@pytest.mark.parametrize("chosen", [range(FRAMES), range(20, 30, 3)], ids=["all", "some"])
def test_labels_that_another_clock_has_stamped_are_refused_with_the_offset(tmp_path, apart, chosen):
    topics = {"/camera": times(logged_s=0.01), "/labels": times(apart, 0.05, chosen)}
    path = write(tmp_path / "a.mcap", topics)
    with pytest.raises(LogError, match=f"offset_ms` {-1000 * apart} moves the truth's") as caught:
        labelled(path)
    side = "before" if apart < 0 else "after"
    assert f"they lie about {abs(apart)} s {side} them for the same log times" in str(caught.value)
    moved = TopicSettings(sync_offset_ms=-1000 * apart)
    assert labelled(path, topics=moved)[0] == [*chosen]


@pytest.mark.parametrize("in_ns", ["/camera", "/labels"])
@pytest.mark.parametrize("unit", [10**3, 10**6])
def test_stamps_in_another_unit_are_no_other_clock(tmp_path, unit, in_ns):
    topics = {
        topic: [(stamp if topic == in_ns else stamp // unit, logged) for stamp, logged in times()]
        for topic in ("/camera", "/labels")
    }
    ratio = f"{unit if in_ns == '/labels' else 1 / unit:.3g}"
    with pytest.raises(LogError, match=re.escape(f"its stamps are {ratio} times those of /camera")):
        labelled(write(tmp_path / "a.mcap", topics))


@pytest.mark.parametrize(
    "logged",
    [
        times(0, 8),
        [(stamp, START + 9 * NS + number) for number, (stamp, _) in enumerate(times())],
        times(0, -(10**6)),
        times(0, 0),
    ],
    ids=["late", "at the end", "years ago", "at once"],
)
def test_labels_that_are_only_logged_at_other_times_are_taken(tmp_path, logged):
    path = write(tmp_path / "a.mcap", {"/camera": times(logged_s=0.01), "/labels": logged})
    assert labelled(path)[0] == [*range(FRAMES)]


@pytest.mark.parametrize(
    ("camera", "late_ns", "unit", "said"),
    [
        *(
            # pymcap-cli 0.34 names exported pictures by each message's own log time.
            (times(logged_s=0.05), ms * 10**6, 1, f"lie {ms - 50}.0 ms after a frame's log time")
            for ms in (50, 51, 60, 75, 99)
        ),
        (times(), 20 * 10**6, 1, "by median they lie 20.0 ms after the nearest one"),
        (times(0.0005, 0.02), 0, 10**6, ""),
    ],
)
def test_names_that_are_log_times_or_no_frame_s_stamps_are_told(
    tmp_path, camera, late_ns, unit, said
):
    path, folder = write(tmp_path / "a.mcap", {"/camera": camera}), tmp_path / "labels"
    folder.mkdir()
    for stamp, _ in times()[:30]:
        (folder / f"{(stamp + late_ns) // unit}.png").write_bytes(png(ROAD))
    found, selection = labelled(path, truth=LabelPlace(str(folder)))
    assert found == [*range(30)]
    (note,) = selection.truth.notes or [""]
    assert said in note
    assert bool(note) == bool(said)

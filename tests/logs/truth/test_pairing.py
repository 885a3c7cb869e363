"""Which label belongs to which image."""

from collections.abc import Sequence

from hypothesis import example, given
from hypothesis import strategies as st

from roadeval.logs.topics.reader import UNREADABLE
from roadeval.logs.truth.pairing import Pairing, Partners, frames_of


class Stamps:
    def __init__(self, stamps: Sequence[int]) -> None:
        self.stamps = stamps
        self.read: set[int] = set()

    def __len__(self) -> int:
        return len(self.stamps)

    def stamp(self, position: int) -> int:
        self.read.add(position)
        return self.stamps[position]


def pairs(images: Sequence[int], labels: Sequence[int], tolerance: int = 0) -> list[int | None]:
    partners = Partners(Pairing(Stamps(images), Stamps(labels), tolerance))
    return [partners.of(image) for image in range(len(images))]


def test_equal_stamps_are_a_pair() -> None:
    assert pairs([10, 20, 30], [10, 20, 30]) == [0, 1, 2]


def test_an_image_without_a_label_stays_alone() -> None:
    assert pairs([10, 20, 30], [10, 30]) == [0, None, 1]


def test_stamps_that_differ_by_one_nanosecond_are_not_equal() -> None:
    now = 1_700_000_000_123_456_789
    assert pairs([now], [now + 1]) == [None]
    assert pairs([now, now + 1], [now, now + 1]) == [0, 1]


def test_the_nearest_within_the_tolerance_is_taken() -> None:
    assert pairs([10, 20, 30], [12, 21, 36], tolerance=5) == [0, 1, None]


def test_a_label_goes_to_its_nearest_image_only() -> None:
    assert pairs([10, 14], [13], tolerance=5) == [None, 0]


def test_an_exact_pair_keeps_its_label_from_a_near_image() -> None:
    assert pairs([10, 11], [11], tolerance=5) == [None, 0]


def test_of_two_equally_near_images_the_first_gets_the_label() -> None:
    assert pairs([10, 14], [12], tolerance=5) == [0, None]


def test_repeated_stamps_pair_in_their_order() -> None:
    assert pairs([10, 10, 20], [10, 10, 20]) == [0, 1, 2]


def test_a_stamp_that_comes_many_times_pairs_each_once() -> None:
    assert pairs([7] * 9, [7] * 7) == [*range(7), None, None]
    assert pairs([3, *[7] * 9, 9], [*[7] * 12, 9]) == [None, *range(9), 12]


def test_a_repeated_image_does_not_take_the_only_label_twice() -> None:
    assert pairs([10, 10, 20], [10, 20]) == [0, None, 1]


def test_neighbours_logged_out_of_order_are_found() -> None:
    assert pairs([10, 30, 20, 40], [20, 10, 40, 30]) == [1, 3, 0, 2]


def test_an_image_or_label_that_cannot_be_read_has_no_partner() -> None:
    assert pairs([10, UNREADABLE, 30], [10, UNREADABLE, 30]) == [0, None, 2]


def test_no_labels_no_partner() -> None:
    assert pairs([10], []) == [None]


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
    partners = Partners(pairing)
    expected = [image for image in range(len(images)) if partners.of(image) is not None]
    assert sorted(frames_of(pairing)) == expected


def test_no_frame_is_given_twice_where_stamps_are_equal_and_out_of_order():
    images = [*[1] * 7, *[2] * 5, *[3] * 3, 4, *[5] * 5, *[7] * 3]
    labels = [0, 0, 1, 2, 5, 2, 5, 5, 5, 5, 6, 6, 7, 8, 8]
    found = [*frames_of(Pairing(Stamps(images), Stamps(labels), 20))]
    assert sorted({*found}) == sorted(found)


rising = st.lists(st.integers(0, 60), max_size=30, unique=True).map(sorted)


@given(rising, rising, st.integers(0, 6), st.integers(6, 20))
def test_stamps_in_order_pair_the_same_however_few_are_read(images, labels, tolerance, reach):
    few, all_around = (
        Partners(Pairing(Stamps(images), Stamps(labels), tolerance, reach_ns))
        for reach_ns in (reach, None)
    )
    for image in range(len(images)):
        assert few.of(image) == all_around.of(image)


def test_labels_far_apart_are_read_one_at_a_time():
    images, labels = Stamps(range(0, 100_000, 10)), Stamps(range(0, 100_000, 200))
    partners = Partners(Pairing(images, labels, 5, reach_ns=40), near=34)
    assert partners.of(700) == 35
    assert images.read == {699, 700}
    assert labels.read <= {34, 35}
    images.read.clear()
    assert partners.of(705) is None
    assert images.read == {705}
    assert labels.read <= {34, 35, 36}

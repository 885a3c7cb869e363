"""The picked frames in `pick.json`, and its contradictions."""

from dataclasses import replace

import pytest

from roadeval.logs.errors import LogError
from roadeval.logs.truth.picks import Picked, Picks, Why

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
    picked = [replace(frame, stamp_ns=rounded(frame.stamp_ns)) for frame in PICKED]
    picks = replace(PICKS, stamps=[*map(rounded, STAMPS)], picked=picked)
    assert picks.is_picked(STAMPS[1], Why.RANDOM)
    assert not picks.is_picked(STAMPS[2], Why.RANDOM)
    assert picks.places[float(STAMPS[7])] == 7

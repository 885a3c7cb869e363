"""Labels whose times are of another clock than the images' stamps."""

import numpy as np
import pytest

from roadeval.logs.errors import LogError
from roadeval.logs.log import open_log
from roadeval.logs.settings import LabelPlace, LogConfig, TopicSettings
from roadeval.logs.writing.writer import LogWriter
from tests.logs.making import grey, png

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
    ("camera", "late_ns", "unit", "words"),
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
    tmp_path, camera, late_ns, unit, words
):
    path, folder = write(tmp_path / "a.mcap", {"/camera": camera}), tmp_path / "labels"
    folder.mkdir()
    for stamp, _ in times()[:30]:
        (folder / f"{(stamp + late_ns) // unit}.png").write_bytes(png(ROAD))
    numbers, selection = labelled(path, truth=LabelPlace(str(folder)))
    assert numbers == [*range(30)]
    (note,) = selection.truth.notes or [""]
    assert words in note
    assert bool(note) == bool(words)

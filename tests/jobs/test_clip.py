"""Short films of what fails: what is in their pictures after decoding, and beside them."""

from pathlib import Path

import av
import cv2
import numpy as np
import pytest

import roadeval
from roadeval import RoadevalError
from roadeval.data import ERRORS, ROAD
from roadeval.data.arrays import FN, FP, TN, TP
from roadeval.jobs.results import clip as job
from roadeval.report.images import DARKEN
from tests.e2e.commands import here
from tests.logs.making import SECOND, compressed, jpeg, raw, ros2_log

WIDTH, HEIGHT, FRAMES = 96, 60, 30
A, B = (30, 70), (20, 50)
"""Columns that two methods call road at first; they move to the right, the true road does not."""


def columns(first, last):
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    mask[20:, first:last] = 255
    return mask


def write_drive(path: Path, period: int = SECOND // 10) -> Path:
    """Write a drive of which the masks of ``a`` are worst at the end, and those of ``b`` better."""
    ramp = np.linspace(40, 200, WIDTH).astype(np.uint8)
    image = np.dstack([np.tile(ramp, (HEIGHT, 1))] * 3)
    messages = []
    for number in range(FRAMES):
        stamp = (number + 1) * period
        messages.append(("/camera", stamp, compressed(stamp, jpeg(image))))
        if number != 3:  # a label is logged after the next image
            messages.append(("/labels", stamp + period + 7, raw(stamp, columns(20, 60), "mono8")))
        for topic, (first, last), step in (("/a", A, 1), ("/b", B, 0)):
            mask = columns(first + step * number // 2, last + step * number // 2)
            messages.append((topic, stamp + 1, raw(stamp, mask, "mono8")))
    ordered = sorted(messages, key=lambda message: message[1])
    return ros2_log(path, ordered, chunk_size=20_000)


def replayed(log: Path) -> Path:
    masks = {"topics": {"image": "/camera", "truth": "/labels", "masks": {"a": "/a", "b": "/b"}}}
    config = roadeval.configure({**masks, "only": ["a", "b"], "output": {"figures": False}})
    roadeval.replay(log, config, save=log.with_suffix(".rrd"), reports=log.with_suffix(""))
    return log.with_suffix(".rrd")


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    return replayed(write_drive(tmp_path_factory.mktemp("drive") / "drive.mcap"))


def decoded(film):
    with av.open(str(film)) as video:
        stream = video.streams.video[0]
        form = stream.codec_context.name, stream.codec_context.pix_fmt
        assert form == (("gif", "bgra") if film.suffix == ".gif" else ("h264", "yuv420p"))
        return stream.average_rate, [f.to_ndarray(format="rgb24") for f in video.decode(video=0)]


def enlarged(picture):
    return picture.repeat(5, 0).repeat(5, 1)


def colours_of_outcomes(image):
    """The colour that each outcome has at each pixel of an image, before encoding."""
    for label in ERRORS.classes[:4]:
        share = label.rgba[3] / 255
        yield image * DARKEN * (1 - share) + np.array(label.rgba[:3]) * share


@pytest.mark.parametrize(("name", "mixed"), [("film.mp4", 1), ("film.gif", 9)])
def test_pixels_have_the_colour_of_their_outcome_after_decoding(recording, tmp_path, name, mixed):
    """A GIF has 256 colours and mixes them: the mean of ``mixed`` pixels is compared."""
    (film,), losses = roadeval.clip(recording, tmp_path / name, frames=range(2, 12))
    assert losses == []
    seen = roadeval.Recording(recording)
    rate, pictures = decoded(film)
    assert (rate, len(pictures)) == (10, 10)
    for frame, picture in zip(range(2, 12), pictures, strict=True):
        assert picture.shape == (5 * HEIGHT + 48, 960, 3)
        if frame == 3:  # it has no truth
            continue
        colours = np.stack([*colours_of_outcomes(enlarged(seen.image(frame)).astype(float))])
        road = (seen.truth(frame) == ROAD).astype(np.uint8)
        edge = enlarged(cv2.dilate(road, np.ones((3, 3), np.uint8)) > road)
        for variant, panel in zip("ab", np.hsplit(picture[24:-24].astype(float), 2), strict=True):
            errors = enlarged(seen.layer(variant, "errors", frame))
            distances = np.linalg.norm(cv2.blur(panel, (mixed, mixed)) - colours, axis=3)
            for outcome in (TN, TP, FP, FN) if variant == "a" else (TN, TP, FN):
                area = ((errors == outcome) & ~edge).astype(np.uint8)
                inside = cv2.erode(area, np.ones((11, 11), np.uint8), borderValue=0) > 0
                assert inside.any()
                assert (distances[:, inside].argmin(axis=0) == outcome).all()
                assert distances[outcome, inside].mean() < 8
            line = cv2.erode(edge.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
            assert panel[line].mean() > 220


def test_pictures_bear_number_rates_colours_and_drive(recording, tmp_path, monkeypatch):
    told = []
    draw = job.clip_picture
    monkeypatch.setattr(
        job, "clip_picture", lambda *a: told.append(([p.title for p in a[0]], a[2])) or draw(*a)
    )
    roadeval.clip(recording, tmp_path / "film.mp4", frames=range(2, 4), focus="b")
    rows = roadeval.Recording(recording).frames.query("frame == 2").set_index("variant")
    rates = {
        name: ", ".join(f"{rate} {100 * rows[rate][name]:.2f} %" for rate in ("ERR", "FPR", "FNR"))
        for name in "ab"
    }
    assert told == [
        ([f"frame 2, b: {rates['b']}", f"frame 2, a: {rates['a']}"], "drive"),
        (["frame 3, b: not scored", "frame 3, a: not scored"], "drive"),
    ]


def test_the_worst_scenes_are_filmed_from_two_seconds_before(recording, tmp_path):
    films, _ = roadeval.clip(recording, tmp_path / "clips", worst=2)
    assert [film.name for film in films] == ["drive-0028.mp4", "drive-0020.mp4"]
    assert sorted((tmp_path / "clips").iterdir()) == sorted(films)
    assert [len(decoded(film)[1]) for film in films] == [22, 30]
    again, _ = roadeval.clip(recording, tmp_path / "again", worst=2)
    assert [film.read_bytes() for film in films] == [film.read_bytes() for film in again]


def test_of_a_slow_drive_a_few_frames_are_shown_twice_a_second(tmp_path, monkeypatch):
    slow, told, draw = replayed(write_drive(tmp_path / "s.mcap", 5 * SECOND)), [], job.clip_picture
    monkeypatch.setattr(job, "clip_picture", lambda *a: told.append(a[2]) or draw(*a))
    (film,), _ = roadeval.clip(slow, tmp_path / "film.mp4", worst=1)
    rate, pictures = decoded(film)
    assert (rate, len(pictures), {*told}) == (2, 4, {"s, 10.0 x speed"})


def test_a_results_folder_stands_for_its_recording(recording, tmp_path):
    film = tmp_path / "a.mp4"
    run = here("clip", recording.with_suffix(""), "--frames", "3:4", "-o", film)
    assert (run.returncode, run.stdout) == (0, f"{film}\n")
    assert [path.name for path in tmp_path.iterdir()] == ["a.mp4"]


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        (("--worst", "2", "-o", "b.gif"), 1, "b.gif: a file holds one clip: name a folder"),
        (("--frames", "400:800"), 1, "such frames; there are some of 0 to 29\n"),
        (("--focus", "nobody"), 1, "--focus: there is no variant nobody"),
        (("--frames", "40-80"), 2, "--frames"),
        (("--frames", "80:40"), 2, "80:40: write the first and the last frame, as 40:80"),
        (("--frames", "4:8", "--worst", "2"), 2, "--worst and --frames do not go together"),
        (("-o", "{drive}.avi"), 1, ".avi: a clip ends in .mp4 or .gif"),
        (("-o", "{drive}.rrd/x"), 1, "drive.rrd"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(recording, words, code, sentence):
    there = str(recording.with_suffix(""))
    run = here("clip", recording, *(w.format(drive=there) for w in words))
    assert run.returncode == code
    assert sentence in run.stderr
    assert run.stderr.count("\n") == 1


def test_a_clip_that_fails_leaves_nothing(recording, tmp_path, monkeypatch):
    def fail(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(job, "clip_picture", fail)
    with pytest.raises(KeyboardInterrupt):
        roadeval.clip(recording, tmp_path / "clips")
    assert not [*tmp_path.iterdir()]


def test_drives_of_a_fleet_with_one_name_have_clips_of_their_own(recording, tmp_path, monkeypatch):
    both = [tmp_path / f"drive-{part}.rrd" for part in "ab"]
    for copy in both:
        copy.write_bytes(recording.read_bytes())
    monkeypatch.setattr(job, "find_recordings", lambda _: both)
    films, _ = roadeval.clip(tmp_path, tmp_path / "clips", frames=range(2))
    names = [str(film.relative_to(tmp_path / "clips")) for film in films]
    assert names == ["drive-a/drive-0000-0001.mp4", "drive-b/drive-0000-0001.mp4"]
    assert all(film.exists() for film in films)


# --- The log's own messages -----------------------------------------------------------------------


def test_the_messages_of_a_clip_replay_to_the_same_truth_and_never_replace_their_log(
    recording, tmp_path
):
    (film,), losses = roadeval.clip(recording, tmp_path / "f.mp4", frames=range(24, 28), mcap=True)
    assert (film.name, losses) == ("f.mp4", [])
    part = roadeval.Recording(replayed(film.with_suffix(".mcap"))).frames
    numbers = ["TP", "TN", "FP", "FN", "N", "truth"]
    before = roadeval.Recording(recording).frames.query("4 <= frame < 28")
    assert part["stamp_ns"].tolist() == before["stamp_ns"].tolist()
    assert part[numbers].to_numpy().tolist() == before[numbers].to_numpy().tolist()
    log = recording.with_suffix(".mcap")
    content = log.read_bytes()
    with pytest.raises(RoadevalError, match=r"drive.mcap: is an input or another output"):
        roadeval.clip(recording, log.with_suffix(".mp4"), frames=range(2), mcap=True)
    assert log.read_bytes() == content


def test_of_a_damaged_log_the_readable_part_is_written(tmp_path):
    log = write_drive(tmp_path / "cut.mcap")
    content = log.read_bytes()
    log.write_bytes(content[: len(content) * 4 // 5])
    places = "--save", tmp_path / "cut.rrd", "--reports", tmp_path / "cut"
    topics = "--image-topic", "/camera", "--truth-topic", "/labels", "--mask-topic", "a=/a"
    assert here("replay", log, *places, *topics, "--only", "a", "-q").returncode == 3
    film = tmp_path / "film.mp4"
    run = here("clip", tmp_path / "cut.rrd", "-o", film, "--mcap")
    assert (run.returncode, run.stdout) == (3, f"{film}, {film.with_suffix('.mcap')}\n")
    assert "roadeval: lost: cut.mcap: " in run.stderr
    assert not roadeval.info(film.with_suffix(".mcap")).losses


def test_without_its_log_a_result_gives_no_messages(tmp_path):
    log = write_drive(tmp_path / "drive.mcap")
    recording, content = replayed(log), log.read_bytes()
    for change, problem in (
        (lambda: log.write_bytes(content[:-3000]), "another log than that of this result"),
        (log.unlink, "the file is missing"),
    ):
        change()
        with pytest.raises(RoadevalError, match=f"drive.mcap: {problem}"):
            roadeval.clip(recording, tmp_path / "clips", mcap=True)
        assert not (tmp_path / "clips").exists()

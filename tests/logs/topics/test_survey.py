"""Images of several sizes, repeated images, and ignored fringes are told."""

from pathlib import Path

import pytest

from roadeval.logs import FrameSettings, LabelSettings, LogConfig, describe, log, open_log
from tests.logs.making import compressed, grey, jpeg, png, raw, ros2_log

SIZES = [(8, 6)] * 3 + [(16, 12)] * 2 + [(4, 3)]


def of_sizes(path: Path) -> Path:
    images = [raw(i, grey(9, *size), "mono8") for i, size in enumerate(SIZES)]
    return ros2_log(path, [("/camera", i, image) for i, image in enumerate(images)])


def repeated(path: Path, *, apart: int = 0) -> Path:
    """Write three images twice, the second ones so much later, and a fourth with an old stamp."""
    images = [compressed(1 + i, jpeg(grey(20 * i))) for i in range(3)]
    messages = [("/camera", 1 + i + again * apart, images[i]) for again in (0, 1) for i in range(3)]
    messages.append(("/camera", 100, compressed(3, jpeg(grey(200)))))
    return ros2_log(path, sorted(messages, key=lambda message: message[1]))


def oddities(path: Path, **asked: int) -> tuple[str, ...]:
    """Return what is told after all frames were read."""
    with open_log(path, LogConfig(frames=FrameSettings(**asked))) as opened:
        stream = opened.frames(opened.select())
        for frame in stream:
            frame.decode()
        return stream.oddities


def test_images_of_other_sizes_are_told(tmp_path: Path) -> None:
    path = of_sizes(tmp_path / "a.mcap")
    told = "not all of the 6 images are 8x6: 2 of 16x12, 1 of 4x3, from frame 3 on"
    assert oddities(path) == (told,)
    assert describe(path).oddities == (f"/camera: {told}",)
    assert oddities(path, max_frames=3) == ()


def test_images_that_repeat_others_are_told_wherever_they_lie(tmp_path: Path) -> None:
    for apart in (0, 50):
        path = repeated(tmp_path / f"{apart}.mcap", apart=apart)
        told = "3 of the 7 images repeat an earlier one, by stamp and content"
        assert oddities(path)[0].startswith(told)
        assert describe(path).oddities[0].startswith(f"/camera: {told}")


def test_of_a_large_log_they_are_told_only_where_it_was_read_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = repeated(tmp_path / "large.mcap")
    monkeypatch.setattr(log, "SMALL", 0)
    assert describe(path).oddities == ()
    assert len(describe(path, verify=True).oddities) == 1


def test_an_ordinary_log_has_no_oddities(tmp_path: Path) -> None:
    images = [compressed(1 + i, jpeg(grey(9))) for i in range(3)]
    path = ros2_log(tmp_path / "a.mcap", [("/camera", 1 + i, m) for i, m in enumerate(images)])
    assert oddities(path) == describe(path).oddities == ()


def test_the_share_of_ignored_fringes_is_told(tmp_path: Path) -> None:
    mask = grey(0)
    mask[:, 4:] = 255
    mask[0, :6] = 100
    messages = [("/camera", 1, compressed(1, png(grey(9)), "png"))]
    messages.append(("/road_mask", 1, compressed(1, png(mask), "png")))
    path = ros2_log(tmp_path / "a.mcap", messages)
    with open_log(path, LogConfig(labels=LabelSettings(tolerance=32))) as log:
        stream = log.frames(log.select())
        truth = next(stream).decode().truth
        assert truth is not None
        assert truth[0].tolist() == [255] * 6 + [1] * 2
        assert stream.oddities[0].startswith("/road_mask: 12 % of the pixels of 1 label images")

"""``roadeval train`` in a terminal."""

import cv2
import numpy as np
import pytest

from roadeval.cli.app import main
from tests.jobs.making import write_log

PATCH = '[training]\nsource = "patch"\nframes = 3'


@pytest.fixture
def bare(tmp_path, monkeypatch):
    """A log without truth in the current folder, and a configuration that asks for the patch."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "patch.toml").write_text(PATCH)
    return write_log(tmp_path / "bare.mcap", truth=False)


def test_the_patch_trains_a_log_without_truth(bare, capsys):
    assert main(["train", "bare.mcap", "--config", "patch.toml", "-o", "m.model"]) == 0
    streams = capsys.readouterr()
    assert "m.model: filtered, unfiltered; trained on 3 frames" in streams.out
    assert streams.out.endswith("pixels, by the patch\n")
    assert "guess" not in streams.err


def test_what_holds_for_one_drive_is_read_from_a_manifest(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ids.toml").write_text('[[drives]]\npath = "ids.mcap"\nlabels = { road = [3] }\n')
    write_log(tmp_path / "mask.mcap")
    write_log(tmp_path / "ids.mcap", codes=(5, 3))
    words = ["train", "mask.mcap", "ids.mcap", "-o", "m.model", "--train-frames", "2"]
    assert main([*words, "ids.toml"]) == 0
    streams = capsys.readouterr()
    assert "by the truth" in streams.out
    assert "warning" not in streams.err
    assert main(words) == 1
    assert "ids.mcap: /truth/road holds the values 3 5" in capsys.readouterr().err


def test_what_was_left_out_is_told_and_decides_the_exit_code(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_log(tmp_path / "broken.mcap", broken=8)
    assert main(["train", "broken.mcap", "-o", "m.model", "--train-frames", "3", "-q"]) == 3
    stderr = capsys.readouterr().err
    assert "roadeval: lost: frame 8: 8 bytes that are no image" in stderr
    assert "roadeval: lost: 1 of 3 training frames could not be decoded" in stderr
    assert (tmp_path / "m.model").exists()


def test_of_several_logs_the_one_that_frames_are_picked_from_is_named_with_its_folder(bare, capsys):
    write_log(bare.with_name("longer.mcap"), truth=False, numbers=range(40))
    words = ["bare.mcap", "longer.mcap", "-n", "1", "-o", "picks", "--config", "patch.toml"]
    assert main(["pick", *words]) == 0
    command = capsys.readouterr().out.rpartition("next")[2]
    assert "replay longer.mcap --config picks/longer/run.toml --truth picks/longer" in command


# --- The command ``pack``: a folder of images becomes a log that ``info`` and ``replay`` take -----


@pytest.fixture
def folder(tmp_path):
    """Three images in ``imgs``, and masks for the first two of them in ``masks``."""
    for name in ("imgs", "masks"):
        (tmp_path / name).mkdir()
    for number in range(3):
        image = np.full((6, 8, 3), 40 * number, np.uint8)
        cv2.imwrite(str(tmp_path / "imgs" / f"{number}.jpg"), image)
        if number < 2:
            cv2.imwrite(str(tmp_path / "masks" / f"{number}.png"), image[..., 0] * 0 + 255)
    return tmp_path


def test_images_and_masks_become_one_log(folder, capsys):
    words = ["pack", f"{folder}/imgs", "--truth", f"{folder}/masks", "-o", f"{folder}/d.mcap"]
    assert main(words) == 0
    streams = capsys.readouterr()
    assert "d.mcap: 3 images, 2 with a mask; 10 images a second" in streams.out
    assert "images without a mask: 2.jpg" in streams.err
    main(["info", f"{folder}/d.mcap"])
    assert "truth: /truth/road" in capsys.readouterr().out

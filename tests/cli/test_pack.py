"""The command ``pack``: a folder of images becomes a log that ``info`` and ``replay`` take."""

import cv2
import numpy as np
import pytest

from roadeval.cli.app import main


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
    said = capsys.readouterr()
    assert "d.mcap: 3 images, 2 with a mask; 10 images a second" in said.out
    assert "images without a mask: 2.jpg" in said.err
    main(["info", f"{folder}/d.mcap"])
    assert "truth: /truth/road" in capsys.readouterr().out


def test_a_folder_without_images_is_one_line(tmp_path, capsys):
    assert main(["pack", str(tmp_path), "-o", str(tmp_path / "d.mcap")]) == 1
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "d.mcap").exists()


def test_the_output_has_to_be_named(folder):
    assert main(["pack", f"{folder}/imgs"]) == 2


def test_masks_in_colours_are_packed_with_a_word_on_what_replay_needs(folder, capsys):
    for number in range(2):
        colours = np.full((6, 8, 3), (128, 64, 128), np.uint8)
        cv2.imwrite(str(folder / "masks" / f"{number}.png"), colours)
    words = ["pack", f"{folder}/imgs", "--truth", f"{folder}/masks", "-o", f"{folder}/d.mcap"]
    assert main(words) == 0
    (line,) = (line for line in capsys.readouterr().err.splitlines() if "replay" in line)
    assert "/truth/road holds the colours 128,64,128" in line
    assert line.endswith("with --road-color")

"""``roadeval train`` in a terminal."""

import pytest

from roadeval.cli.app import main
from tests.jobs.making import write_log

LABELS = "[labels]\nroad = [3]"
PATCH = '[training]\nsource = "patch"\nframes = 3'


@pytest.fixture
def bare(tmp_path, monkeypatch):
    """A log without truth in the current folder, and a configuration that asks for the patch."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "patch.toml").write_text(PATCH)
    return write_log(tmp_path / "bare.mcap", truth=False)


def test_the_patch_trains_a_log_without_truth(bare, capsys):
    assert main(["train", "bare.mcap", "--config", "patch.toml", "-o", "m.model"]) == 0
    told = capsys.readouterr()
    assert "m.model: filtered, unfiltered; trained on 3 frames" in told.out
    assert told.out.endswith("pixels, by the patch\n")
    assert "guess" not in told.err


def test_who_did_not_ask_for_the_patch_is_warned(bare, capsys):
    assert main(["train", "bare.mcap", "-o", "m.model"]) == 0
    assert (
        "warning: no drive has road truth in the range: the model learnt" in capsys.readouterr().err
    )


def test_what_holds_for_one_drive_is_read_from_its_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ids.toml").write_text(LABELS)
    write_log(tmp_path / "mask.mcap")
    write_log(tmp_path / "ids.mcap", codes=(5, 3))
    words = ["train", "mask.mcap", "ids.mcap", "-o", "m.model", "--train-frames", "2"]
    assert main([*words, "--drive", "ids.mcap=ids.toml"]) == 0
    told = capsys.readouterr()
    assert "by the truth" in told.out
    assert "warning" not in told.err
    assert main(words) == 1
    assert "ids.mcap: /truth/road holds the values 3 5" in capsys.readouterr().err
    assert main([*words, "--drive", "other.mcap=ids.toml"]) == 1
    assert "error: --drive other.mcap: is none of the drives" in capsys.readouterr().err


def test_what_was_left_out_is_told_and_decides_the_exit_code(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_log(tmp_path / "broken.mcap", broken=8)
    assert main(["train", "broken.mcap", "-o", "m.model", "--train-frames", "3", "-q"]) == 3
    told = capsys.readouterr().err
    assert "roadeval: lost: frame 8: 8 bytes that are no image" in told
    assert "roadeval: lost: 1 of 3 training frames could not be decoded" in told
    assert (tmp_path / "m.model").exists()


@pytest.mark.parametrize("value", ["ids.mcap", "=ids.toml", "ids.mcap="])
def test_a_drive_needs_a_file(value, capsys):
    assert main(["train", "a.mcap", "-o", "m.model", "--drive", value]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_bad_setting_of_a_drive_is_named_with_its_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.toml").write_text("[labels]\nroad = [-1]")
    assert main(["train", "a.mcap", "-o", "m.model", "--drive", "a.mcap=a.toml"]) == 1
    assert "error: a.toml a.mcap: labels.road, item 1: must be" in capsys.readouterr().err

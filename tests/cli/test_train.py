"""``roadeval train`` in a terminal."""

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
    told = capsys.readouterr()
    assert "m.model: filtered, unfiltered; trained on 3 frames" in told.out
    assert told.out.endswith("pixels, by the patch\n")
    assert "guess" not in told.err


def test_who_did_not_ask_for_the_patch_is_warned(bare, capsys):
    assert main(["train", "bare.mcap", "-o", "m.model"]) == 0
    assert (
        "warning: no drive has road truth in the range: the model learnt" in capsys.readouterr().err
    )

"""``--net``: the network of an ONNX file at the terminal, and what cannot be used."""

import pytest

from tests.e2e.commands import here
from tests.jobs.making import write_log
from tests.networks.making import red_network


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return write_log(tmp_path_factory.mktemp("log") / "drive.mcap")


@pytest.fixture
def refused(drive, tmp_path):
    """Replay with a network that cannot be used; returns the one line."""

    def refused(path, *words):
        outputs = ("--save", tmp_path / "out.rrd", "--reports", tmp_path / "reports")
        done = here("replay", drive, *outputs, "--quiet", "--net", f"mine={path}", *words)
        assert done.returncode == 1
        assert done.stdout == ""
        assert done.stderr.startswith("roadeval: error: ")
        assert done.stderr.count("\n") == 1
        assert not (tmp_path / "out.rrd").exists()
        return done.stderr

    return refused


def toml(folder, text):
    path = folder / "mine.toml"
    path.write_text(text)
    return path


def test_two_networks_stand_in_the_terminals_table(drive, tmp_path):
    red_network(tmp_path / "red.onnx")
    settings = toml(tmp_path, 'file = "red.onnx"\nthreshold = 0.4\n')
    done = here(
        *("replay", drive, "--reports", tmp_path / "reports", "--record", "none"),
        *("--net", f"red={tmp_path / 'red.onnx'}", "--net", f"mild={settings}"),
    )
    assert done.returncode == 0
    for name in ("red", "mild"):
        assert f"{name}  " in done.stdout
        assert f"{name} - blind" in done.stdout


def test_config_prints_its_settings_with_their_meaning(tmp_path):
    done = here("config", "--net", "mine=some.onnx")
    assert "[variants.mine.net]" in done.stdout
    assert 'file = "some.onnx"' in done.stdout


def test_a_missing_network(refused, tmp_path):
    assert "there is no such network" in refused(tmp_path / "none.onnx")


def test_settings_that_name_no_network(refused, tmp_path):
    assert "file must name the network" in refused(toml(tmp_path, "size = [8, 8]\n"))


def test_a_setting_that_is_not_known(refused, tmp_path):
    said = refused(toml(tmp_path, 'file = "n.onnx"\nsise = [8, 8]\n'))
    assert "mine.toml: net.sise: there is no such setting" in said

"""Configurations: whatever the bytes, one that is written and read back equal, or one line."""

from __future__ import annotations

import tomlkit

from roadeval import config_toml, configure, load_config
from roadeval.config.run import run_toml
from roadeval.config.variants import PRESETS
from tests.config.test_config import OTHER, tables
from tests.fuzz.harness import Harness, scratch


def check(data: bytes) -> None:
    """Read a file, write its configuration in both ways, and read these back."""
    path = scratch() / "run.toml"
    path.write_bytes(data)
    config = load_config(path)
    for text in (run_toml(config, "drive.mcap", "1.2.3"), config_toml(config)):
        path.write_text(text, encoding="utf-8")
        assert load_config(path) == config, text


def seeds() -> list[bytes]:
    """Return config_toml presets, and a file for every setting."""
    texts = [config_toml(configure({"preset": preset})) for preset in PRESETS]
    return [text.encode() for text in (*texts, *(tomlkit.dumps(tables(name)) for name in OTHER))]


HARNESS = Harness(check, seeds, quick=40)

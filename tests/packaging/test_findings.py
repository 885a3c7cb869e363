"""The scripts of ``findings/`` have the form that CONTRIBUTING.md gives."""

import re
import subprocess
from pathlib import Path

import pytest

FINDINGS = sorted((Path(__file__).resolve().parents[2] / "findings").iterdir())


@pytest.mark.parametrize("path", FINDINGS, ids=[path.stem for path in FINDINGS])
def test_a_finding_installs_pinned_packages_in_a_folder_that_it_removes(path):
    assert path.suffix == ".sh"
    text = path.read_text()
    header, _, script = text.partition("set -euo pipefail\n")
    assert header.startswith("#!/usr/bin/env bash\n# ")
    assert all(f"# {word}: " in header for word in ("Software", "Source"))
    assert script.startswith("folder=$(mktemp -d)\ntrap 'rm -rf \"$folder\"' EXIT\n")
    assert "python3 -m venv" in script
    command = re.search(r"/pip\" install (.*?[^\\])\n", script, re.DOTALL)
    packages = [word for word in command[1].split() if word[0] not in "-\\"]
    assert packages
    assert all("==" in package for package in packages)
    assert "roadeval" not in text
    assert not subprocess.run(["bash", "-n", path], check=False).returncode

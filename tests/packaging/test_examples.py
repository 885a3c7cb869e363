"""The scripts in examples/ run as they stand."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_the_tour_of_the_api_runs(tmp_path):
    (tmp_path / "recordings").mkdir()
    shutil.copy(ROOT / "recordings" / "demo.mcap", tmp_path / "recordings")
    run = subprocess.run(
        [sys.executable, ROOT / "examples" / "api.py"],
        cwd=tmp_path,
        env=os.environ | {"MPLBACKEND": "agg"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert "filtered   ERR of the final mask: " in run.stdout
    assert "svm" in run.stdout
    out = tmp_path / "reports" / "api"
    wanted = {"demo.rrd", "frames.csv", "errors.png", "layers.png", "demo.model"}
    assert wanted <= {path.name for path in out.iterdir()}

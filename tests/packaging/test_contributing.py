"""CONTRIBUTING.md's walk-throughs: each file on that page, put in its place, is enough."""

import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
from mcap.writer import Writer
from pypdf import PdfReader

import roadeval

ROOT = Path(__file__).resolve().parents[2]
FENCED = re.compile(r"^`(?P<path>[^`\n]+)`\n\n```\w+\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE)
FILES = {
    found["path"]: found["text"]
    for found in FENCED.finditer((ROOT / "CONTRIBUTING.md").read_text())
}
DISTURBANCE = re.compile(
    r"^```python\n(def haze.*?)```.*?`(DisturbanceKind.*?)`", re.DOTALL | re.MULTILINE
)
"""The function of the page's disturbance, and its kind."""
PERIOD_NS = 100_000_000
FRAMES = 22


COMMANDS = {
    "replay": "replay drive.mcap --variant bright=bright.toml --disturb haze:0.4 --save out.rrd "
    "--reports reports",
    "report": "report out.rrd -o report.pdf",
    "config": "config --variant bright=bright.toml",
    "compared": "compare out.rrd -o compared.pdf --json",
    "fail": "compare out.rrd --fail-if post.bright.BACC>0%",
    "inspect": "inspect out.rrd --list --worst 1",
    "info": "info drive.mcap --json",
    "labels": "replay drive.mcap --truth polygons --road-label road --record none --reports drawn",
    "worst": "worst out.rrd",
    "help": "--help",
}
"""By name, in the order in which they run."""
RUN = """
import io, json, sys
from contextlib import redirect_stderr, redirect_stdout
from roadeval.cli.app import main
from roadeval.report import figures

figures.write_figures = lambda *_, **__: []  # which take longer than all else of a small replay

def run(words):
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        code = main(words)
    return code, out.getvalue(), err.getvalue()

done = {name: run(line.split()) for name, line in json.loads(sys.argv[1]).items()}
print(json.dumps(done))
"""
"""Runs commands of the copy, all in one process."""


@dataclass(frozen=True)
class Workshop:
    """A copy of the package with the page's files in it, and what its commands did."""

    folder: Path
    runs: dict[str, tuple[int, str, str]]
    """Exit code, stdout and stderr of each command."""

    def done(self, name: str) -> str:
        """Return what a command printed, which must have succeeded."""
        code, out, err = self.runs[name]
        assert code == 0, err
        return out

    def table(self, name: str) -> pd.DataFrame:
        return pd.read_csv(self.folder / "reports" / f"{name}.csv")


def frame(number: int) -> tuple[np.ndarray, np.ndarray]:
    """A grey road between darker verges below a bright sky, and its truth."""
    noise = np.random.default_rng(number).integers(-12, 13, (48, 64, 3))
    image = np.full((48, 64, 3), 40) + noise
    truth = np.zeros((48, 64), np.uint8)
    image[:16] = 210
    image[16:, 20:44] += 80
    truth[16:, 20:44] = 255
    return image.clip(0, 255).astype(np.uint8), truth


def write_drive(path: Path) -> None:
    """A drive whose messages are in the encoding that the page adds."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channels = [writer.register_channel(t, "stamped_file", 0) for t in ("/camera", "/truth")]
        for number in range(FRAMES):
            stamp = 1_000_000_000 + number * PERIOD_NS
            for channel, pixels in zip(channels, frame(number), strict=True):
                data = stamp.to_bytes(8, "little") + cv2.imencode(".png", pixels)[1].tobytes()
                writer.add_message(channel, stamp, data, stamp)
        writer.finish()


def write_polygons(folder: Path) -> None:
    """The road of `frame` as Supervisely has it; its last one is damaged."""
    folder.mkdir()
    outlines = {
        "sky": [[0, 0], [64, 0], [64, 16], [0, 16]],
        "road": [[20, 16], [44, 16], [44, 48], [20, 48]],
    }
    figures = [
        {"classTitle": name, "points": {"exterior": points, "interior": []}}
        for name, points in outlines.items()
    ]
    text = json.dumps({"size": {"width": 64, "height": 48}, "objects": figures})
    for number in range(FRAMES):
        cut = text[:-9] if number == FRAMES - 1 else text
        (folder / f"street_{number:06d}.png.json").write_text(cut)


@pytest.fixture(scope="module")
def workshop(tmp_path_factory) -> Workshop:
    folder = tmp_path_factory.mktemp("workshop")
    shutil.copytree(Path(roadeval.__file__).parent, folder / "roadeval")
    for path, text in FILES.items():
        place = folder / path
        assert not place.exists(), f"{path} is there already"
        assert place.parent.is_dir(), f"{path} has no folder to lie in"
        place.write_text(text)
    disturbing = folder / "roadeval" / "images" / "disturbing.py"
    function, kind = DISTURBANCE.search((ROOT / "CONTRIBUTING.md").read_text()).groups()
    before, head, after = disturbing.read_text().partition("BUILT_IN: Final = (\n")
    disturbing.write_text(f"{before}{function}\n\n{head}    {kind},\n{after}")
    write_drive(folder / "drive.mcap")
    write_polygons(folder / "polygons")
    process = subprocess.run(
        [sys.executable, "-P", "-c", RUN, json.dumps(COMMANDS)],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode == 0, process.stderr
    return Workshop(folder, json.loads(process.stdout))


def words_of(path: Path) -> str:
    """The words of a PDF, in one line."""
    pages = PdfReader(path).pages
    return " ".join(" ".join(page.extract_text() for page in pages).split())


@pytest.fixture(scope="module")
def report(workshop) -> str:
    """The words of the drive's PDF."""
    workshop.done("report")
    return words_of(workshop.folder / "report.pdf")


@pytest.fixture(scope="module")
def recording(workshop) -> roadeval.Recording:
    return roadeval.Recording(workshop.folder / "out.rrd")


def test_the_page_adds_one_of_each():
    package = {str(Path(path).parent) for path in FILES} - {"."}
    assert package == {
        f"roadeval/{room}"
        for room in (
            *("pipeline/beyond", "evaluation/metrics", "evaluation/regions", "report/charts"),
            *("logs/messages/encodings", "logs/truth/formats", "jobs", "cli/commands"),
        )
    }


def test_its_files_pass_the_lint(workshop):
    pytest.importorskip("ruff")
    paths = [path for path in FILES if path.endswith(".py")]
    words = [sys.executable, "-m", "ruff", "check", "--config", ROOT / "pyproject.toml", *paths]
    checked = subprocess.run(words, cwd=workshop.folder, capture_output=True, check=False)
    assert checked.returncode == 0, checked.stdout.decode()


def test_the_stage_has_rows_a_mask_in_the_recording_and_documented_settings(workshop, recording):
    frames = workshop.table("frames").query("variant == 'bright'")
    assert list(frames["stage"].unique()) == ["brightness", "post"]
    assert frames["ERR"].max() < 0.05
    mask = recording.layer("bright", "brightness", FRAMES - 1)
    np.testing.assert_array_equal(mask, frame(FRAMES - 1)[1] == 255)
    assert "# Greatest distance of a road pixel" in workshop.done("config")
    assert "tolerance = 50" in workshop.done("config")


def test_the_metric_is_a_column_of_frames_and_in_the_recording(recording, workshop):
    frames = workshop.table("frames")
    np.testing.assert_allclose(frames["BACC"], (frames["TPR"] + frames["TNR"]) / 2)
    series = recording.scalars("/metrics/bright/post/BACC")
    np.testing.assert_allclose(series, frames.query("variant == 'bright' and stage == 'post'").BACC)
    assert "BACC" in recording.frames


def test_the_metric_is_on_the_screen_of_replay(workshop):
    # It fits beside the others, as "pooled ERR" takes two lines.
    (titles,) = re.findall(r"\nvariant +stage +(.*)", workshop.done("replay"))
    assert titles.split() == ["frames", "ERR", "FPR", "FNR", "ACC", "BACC", "ERR", "IoU"]
    # Commands to copy are never broken.
    tables = workshop.done("replay").partition("\nnext ")[0]
    assert max(map(len, tables.splitlines())) <= 80
    assert re.search(r"\ndifference, points .* BACC\n", workshop.done("replay"))


def test_the_metric_is_compared_by_its_direction(workshop):
    compared = json.loads(workshop.done("compared"))
    final = [change for change in compared["changes"] if change["final"]]
    assert final
    assert all("BACC" in change["difference"] for change in final)
    assert "Change of BACC, points" in words_of(workshop.folder / "compared.pdf")
    code, _, said = workshop.runs["fail"]
    assert code == 4, said


def test_the_region_is_counted_and_in_the_report_by_its_title(workshop, report):
    regions = workshop.table("regions").query("region == 'ahead' and stage == 'post'")
    assert set(regions["variant"]) == {"filtered", "unfiltered", "bright", "blind"}
    assert set(regions[["TP", "TN", "FP", "FN"]].sum(axis=1)) == {48 * 22}
    assert report.count("ahead of the vehicle") == 1


def test_the_encoding_is_described_and_read(workshop, recording):
    topics = json.loads(workshop.done("info"))["topics"]
    assert {each["name"]: each["count"] for each in topics} == {"/camera": FRAMES, "/truth": FRAMES}
    image, truth = frame(FRAMES - 1)
    assert recording.image(FRAMES - 1).shape == image.shape
    np.testing.assert_array_equal(recording.truth(FRAMES - 1), truth == 255)


def test_the_label_format_gives_the_same_truth(workshop):
    code, _, err = workshop.runs["labels"]
    assert code == 3
    assert f"lost: frame {FRAMES - 1}: polygons/street_000021.png.json: cannot be" in err
    whole = workshop.table("frames").query("variant == 'filtered'")
    drawn = pd.read_csv(workshop.folder / "drawn" / "frames.csv").query("variant == 'filtered'")
    there = whole[whole["frame"] < FRAMES - 1].reset_index(drop=True)
    pd.testing.assert_frame_equal(drawn.reset_index(drop=True), there)


def test_the_figure_is_in_the_report(report):
    assert "Accuracy by windows." in report
    assert report.count("ACC: accuracy, %") == 1


def test_the_disturbance_makes_more_errors(workshop):
    hazy = workshop.table("disturbances").query("variant == 'bright' and disturbance == 'haze-0_4'")
    undisturbed = workshop.table("frames").query("variant == 'bright' and stage == 'post'")
    assert set(hazy["frame"]) == set(undisturbed["frame"])
    assert hazy["FP"].sum() > undisturbed["FP"].sum()


def test_the_command_runs(workshop):
    number = int(workshop.done("worst"))
    final = workshop.table("frames").query("variant == 'filtered' and stage == 'post'")
    assert final.set_index("frame")["ERR"][number] == final["ERR"].max()
    assert "worst" in workshop.done("help")

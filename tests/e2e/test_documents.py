"""What README.md and the pages of the site say, done as a reader would, with small drives."""

import json
import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path

import cv2
import numpy as np
import pytest
import typer.main
import yaml

import roadeval
from roadeval.cli.app import app
from tests.e2e.commands import DEMO, ROADEVAL, Replayed
from tests.fixtures.drives import FRAMES, labels, scene, stamp
from tests.fixtures.logged import write_drive
from tests.fixtures.make import make
from tests.networks.making import by_ultralytics, red_network
from tests.results.fleet.making import fleet_of

ROOT = Path(__file__).resolve().parents[2]
PAGES = ["README.md", *sorted(str(path.relative_to(ROOT)) for path in ROOT.glob("docs/**/*.md"))]
BLOCK = re.compile(r"^```(?P<language>\w+)\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE)
FILE = re.compile(r"# ([\w./-]+\.(?:csv|py|toml|yml))\n")
SERVICE = re.compile(r"^import (mlflow|wandb)$", re.MULTILINE)
"""Clients of services, whose recipes are run where they are installed."""
BY_CI = "python3 -m venv .venv"
"""Begins the two commands of README.md, which `.ci/run` runs."""


def write_scenes(
    path: Path, first: int = 0, cameras: Sequence[str] = ("front",), truth: str = "road_mask"
) -> None:
    """Write a drive from this scene on, whose truth, if it has a name, explains itself."""

    def messages(number):
        shown = {name: number + 7 * place for place, name in enumerate(cameras)}
        images = {f"/{name}/image": scene(shown[name])[0] for name in cameras}
        masks = {f"/{name}/{truth}": labels(shown[name], 255, 0, 128) for name in cameras if truth}
        return images | masks

    write_drive(path, ((stamp(n), messages(n)) for n in range(first, first + FRAMES)))


def encoded(pixels: np.ndarray) -> bytes:
    return cv2.imencode(".png", pixels)[1].tobytes()


def write_coco(path: Path) -> None:
    """Write the labels of a drive as COCO has them."""
    road, car = (4, 29, 12, 12, 35, 12, 44, 29), (20, 20, 28, 20, 28, 26, 20, 26)
    found = [
        {"image_id": number, "category_id": kind, "segmentation": [ring]}
        for number in range(FRAMES)
        for kind, ring in ((1, road), (2, car))
    ]
    height, width = scene(0)[1].shape
    images = [
        {"id": number, "file_name": f"frame_{number:04}.jpg", "width": width, "height": height}
        for number in range(FRAMES)
    ]
    names = [{"id": 1, "name": "road"}, {"id": 2, "name": "car"}]
    coco = {"images": images, "annotations": found, "categories": names}
    path.write_text(json.dumps(coco))


def write_images(folder: Path) -> None:
    """Write the pictures of a drive, their labels, and two methods' masks, a file a frame."""
    for name in ("images", "labels", "masks", "confidences"):
        (folder / name).mkdir()
    for number in range(FRAMES):
        image, road = scene(number)
        moved = np.roll(road, number % 5, axis=1) * np.uint8(255)
        soft = cv2.blur(moved, (9, 9))
        files = {"images": image[..., ::-1], "labels": road * np.uint8(255), "masks": moved}
        for name, pixels in (files | {"confidences": soft}).items():
            (folder / name / f"{number:04}.png").write_bytes(encoded(pixels))


def write_segformer(folder: Path) -> None:
    """Write a network as Hugging Face's tools export one."""
    folder.mkdir()
    red_network(folder / "model.onnx")
    (folder / "config.json").write_text('{"id2label": {"0": "road"}}')
    size = '{"do_normalize": false, "size": {"height": 24, "width": 32}}'
    (folder / "preprocessor_config.json").write_text(size)


def write_kitti(folder: Path) -> None:
    """Write two images of each category of KITTI's road benchmark, and a method's results."""
    training = folder / "kitti" / "training"
    for path in (*map(training.joinpath, ("image_2", "gt_image_2", "calib")), folder / "results"):
        path.mkdir(parents=True)
    for number in range(6):
        image, road = scene(number)
        kind, height = ("um", "umm", "uu")[number % 3], image.shape[0]
        truth = np.dstack([255 * road, 0 * road, 0 * road + 255]).astype(np.uint8)
        (training / f"image_2/{kind}_{number:06}.png").write_bytes(encoded(image[..., ::-1]))
        (training / f"gt_image_2/{kind}_road_{number:06}.png").write_bytes(encoded(truth))
        (training / f"calib/{kind}_{number:06}.txt").write_text(
            f"P2: {height} 0 {height} 0 0 {height} {height / 2} 0 0 0 1 0\n"
            "R0_rect: 1 0 0 0 1 0 0 0 1\nTr_cam_to_road: 1 0 0 0 0 1 0 -1.6 0 0 1 0\n"
        )
        moved = encoded(np.roll(road, 2, axis=1) * np.uint8(255))
        (folder / f"results/{kind}_road_{number:06}.png").write_bytes(moved)


@pytest.fixture(scope="module")
def world(tmp_path_factory) -> Path:
    """What the pages speak of: drives, pictures, masks, a network, and results."""
    folder = tmp_path_factory.mktemp("world")
    for seed, name in enumerate(("last_week", "monday")):
        fleet_of(folder / name, 30, seed, frames=5)
    names = ("drive", "monday", "tuesday", "wednesday", "logs/a", "logs/b", "monday/a")
    for i, name in enumerate(names):
        write_scenes(folder / f"{name}.mcap", first=FRAMES * i)
    make("drives/street.mcap", folder)
    (folder / "drives" / "street.mcap").rename(folder / "street.mcap")
    (folder / "tuesday").mkdir()
    shutil.copy(folder / "street.mcap", folder / "tuesday")
    write_images(folder)
    write_kitti(folder)
    write_scenes(folder / "bare.mcap", truth="")
    write_coco(folder / "coco.json")
    write_scenes(folder / "rig.mcap", cameras=("front", "left"), truth="labels")
    red_network(folder / "road.onnx")
    by_ultralytics(red_network(folder / "yolo26n-sem.onnx"), {0: "road"}, imgsz=[24, 32])
    write_segformer(folder / "segformer")
    reports = folder / "reports" / "drive"
    roadeval.replay(folder / "drive.mcap", save=folder / "out.rrd", reports=reports)
    for name in ("old", "new"):
        shutil.copy(folder / "out.rrd", folder / f"{name}.rrd")
    return folder


def results_of_the_demo(folder: Path, done: Replayed) -> None:
    """Put what the first of README.md's two commands leaves, and what its others read."""
    shutil.copy(done.recording, folder / "out.rrd")
    shutil.copytree(done.reports, folder / "reports" / "demo")
    (folder / "masks").mkdir()
    (folder / "labels").mkdir()
    demo = roadeval.Recording(folder / "out.rrd")
    roads = {number: demo.truth(number) == 1 for number in demo.frame_numbers}
    for number, road in roads.items():
        mask = encoded(np.roll(road, 12, axis=1) * np.uint8(255))
        (folder / "masks" / f"{number:04}.png").write_bytes(mask)
        if number < FRAMES:
            label = encoded(road * np.uint8(255))
            (folder / "labels" / f"{number:04}.png").write_bytes(label)
    images = (demo.image(number) for number in range(FRAMES))
    write_drive(folder / "drive.mcap", ((stamp(n), {"/camera": i}) for n, i in enumerate(images)))


@pytest.fixture
def here(page, request, tmp_path) -> Path:
    """A folder to follow a page in."""
    if page in ("README.md", "docs/tutorial.md"):
        (tmp_path / "recordings").mkdir()
        shutil.copy(DEMO, tmp_path / "recordings")
        if page == "README.md":
            results_of_the_demo(tmp_path, request.getfixturevalue("demo"))
        return tmp_path
    world = request.getfixturevalue("world")
    return Path(shutil.copytree(world, tmp_path / "world", copy_function=os.link))


@pytest.mark.timeout(600)  # a page of many commands, on a machine that is busy
@pytest.mark.site  # all pages take two minutes; `.ci/run` asks for them by their mark
@pytest.mark.parametrize("page", PAGES)
def test_a_page_does_what_it_says(page, here, pytestconfig):
    text, said, end = (ROOT / page).read_text(), None, 0
    written = text
    for block in BLOCK.finditer(text):
        language, content = block["language"], block["text"]
        follows = said is not None and not text[end : block.start()].strip()
        end = block.end()
        if file := FILE.match(content):
            (here / file[1]).unlink(missing_ok=True)
            (here / file[1]).parent.mkdir(parents=True, exist_ok=True)
            (here / file[1]).write_text(content)
            for line in lines_of(content) if language == "yaml" else ():
                run(here, "bash", "-e", "-c", line, GITHUB_STEP_SUMMARY="summary.md")
        elif language == "sh" and not content.startswith(BY_CI):
            said = run(here, "bash", "-eu", "-c", content)
            continue
        elif language == "python":
            if all(map(find_spec, SERVICE.findall(content))):
                run(here, "python", "-c", content)
        elif language == "text" and follows:
            if pytestconfig.getoption("write_golden"):
                written = written.replace(f"```text\n{content}```", f"```text\n{said}```", 1)
            else:
                assert content == said
        said = None
    if written != text:
        (ROOT / page).write_text(written)


def lines_of(workflow: str) -> Iterator[str]:
    """The commands of a workflow of GitHub or GitLab, but those that need either."""
    content = yaml.safe_load(workflow)
    jobs = content.get("jobs", content)
    lines = [line for job in jobs.values() for line in job.get("script", ())]
    lines += [s["run"] for job in jobs.values() for s in job.get("steps", ()) if "run" in s]
    assert lines
    yield from (line for line in lines if not line.startswith(("pip install", "gh pr")))


def run(folder: Path, *command: str, code: int = 0, **more: str) -> str:
    """Run a command where everything lies; return what it prints."""
    plain = {"COLUMNS": "80", "NO_COLOR": "1", "TERM": "dumb", "MPLBACKEND": "agg"}
    path = f"{ROADEVAL.parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        command,
        cwd=folder,
        env={**os.environ, **plain, **more, "PATH": path},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == code, f"{command[-1]}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.mark.parametrize("page", PAGES)
def test_the_commands_that_are_not_run_have_these_options(page):
    group = typer.main.get_command(app)
    for block in BLOCK.finditer((ROOT / page).read_text()):
        if block["language"] != "console":
            continue
        for line in re.findall(r"^\$ roadeval (.*)$", block["text"], re.MULTILINE):
            name, *words = shlex.split(line, comments=True)
            group.commands[name].make_context(name, words)


def test_every_page_of_the_site_begins_with_an_example():
    others = {"docs/index.md", "docs/architecture.md", "docs/explanation/presets.md"}
    for page in {*PAGES} - {"README.md", *others}:
        text = (ROOT / page).read_text()
        if "The site shows [this file]" not in text:
            before = text.partition("```")[0]
            assert text.count("```") >= 2, page
            assert len(before.split()) < 60, page


def test_the_readme_is_short():
    text = (ROOT / "README.md").read_text()
    assert len(text.encode()) <= 8192
    first = re.sub(r"`[^`]*`|\]\([^)]*\)|[*\[|]", " ", text.partition("## Two commands")[0])
    for sentence in re.split(r"(?<=[.:?!])\s|\n\n", first):
        assert len(sentence.split()) <= 25, sentence

"""Names from a log, a file or a command line reach no output as they are.

They hold what terminals, Typst, Markdown, Matplotlib, spreadsheets and TOML act upon, and are long,
empty, or not UTF-8. Documents and input that are bad are refused in one line, at once.
"""

import hashlib
import json
import os
import re
import shutil
import time
import tomllib
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet
from pypdf import PdfReader

from roadeval import Recording
from roadeval.results.facts import digest_of
from roadeval.runtime.text import as_markdown, visible
from tests.e2e.commands import here
from tests.fixtures.figures import drawn
from tests.fixtures.logged import write_drive
from tests.jobs.making import NS, write_log
from tests.results.fleet.making import fleet_of
from tests.training.making import frame

ESCAPES = "\x1b[2J\x1b]0;owned\x07\r\nroadeval: error: fake\x9b31m\N{RIGHT-TO-LEFT OVERRIDE}"
SCRIPT = "<script>alert(1)</script>"
MARKUP = f'$x_{{1$ #panic() [red]b[/] **c** `d.e` =cmd() <b> | "\\u0041" @team ../../f {SCRIPT}'
CAMERA = f"/cam {ESCAPES}{MARKUP}{'y' * 10_000}"
TRUTH = f"/truth/road {ESCAPES}{MARKUP}"
MASKS = f"/net/road_mask {ESCAPES}"
DRIVE = f"a {ESCAPES}".replace("/", "") + "$x_{1$ #panic() [red] =cmd() caf\udce9"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a log full of such names, under such a name."""
    folder = tmp_path_factory.mktemp("hostile")

    def messages(number):
        image, truth = (made := frame(number)).image, made.truth
        return {
            CAMERA: image,
            "": image,
            TRUTH: truth * 255,
            MASKS: np.roll(truth, number, 1) * 255,
        }

    write_drive(folder / "plain.mcap", (((n + 1) * NS, messages(n)) for n in range(14)))
    (folder / "plain.mcap").rename(folder / f"{DRIVE}.mcap")
    return folder


@pytest.fixture(scope="module")
def told(folder):
    """What every command says on stdout and stderr, by its words."""
    topics = ("--image-topic", CAMERA, "--mask-topic", f"net={MASKS}")
    name = visible(DRIVE)
    commands = {
        "info": ("info", f"{DRIVE}.mcap", *topics),
        "which": ("info", f"{DRIVE}.mcap"),
        "no topic": ("replay", f"{DRIVE}.mcap", "--image-topic", f"/none{ESCAPES}"),
        "info --json": ("info", f"{DRIVE}.mcap", *topics, "--json"),
        "replay": ("replay", f"{DRIVE}.mcap", *topics, "--train-frames", 2),
        "inspect": ("inspect", f"recordings/{name}.rrd", "--list"),
        "inspect --json": ("inspect", f"reports/{name}", "--list", "--json"),
        "report": ("report", f"reports/{name}"),
        "page": ("report", f"recordings/{name}.rrd", "-o", "page.html"),
        "compare": (
            *("compare", f"recordings/{name}.rrd", f"reports/{name}"),
            *("-o", "two.md", "-o", "two.pdf", "-o", "two.json", "-o", "two.html"),
        ),
        "config": ("config", *topics),
        "config of a run": ("config", "--config", f"reports/{name}/run.toml"),
        "none": ("inspect", f"none{ESCAPES}.rrd"),
        "usage": ("inspect", f"none{ESCAPES}", f"more{ESCAPES}"),
    }
    with drawn():
        return {name: here(*words, cwd=folder) for name, words in commands.items()}


def test_every_command_does_what_it_does_for_other_names(told):
    codes = {name: done.returncode for name, done in told.items() if done.returncode}
    assert codes == {"no topic": 1, "none": 1, "usage": 2}


def test_what_they_say_is_lines_of_visible_text(told):
    for done in told.values():
        for line in (done.stdout + done.stderr).split("\n"):
            assert line == visible(line)
    assert "\nroadeval: error: fake" not in "".join(d.stdout + d.stderr for d in told.values())


def test_json_holds_the_names_themselves(told, folder):
    found = json.loads(told["info --json"].stdout)
    assert {topic["name"] for topic in found["topics"]} == {"", CAMERA, TRUTH, MASKS}
    summary = json.loads((folder / "reports" / visible(DRIVE) / "summary.json").read_text())
    assert summary["run"]["topics"]["image"] == CAMERA
    assert summary["log"]["path"] == f"{DRIVE}.mcap"


def test_the_results_are_files_of_visible_text_in_the_folders_they_belong_to(told, folder):
    made = [path.relative_to(folder) for path in folder.rglob("*")]
    assert {path.parts[0] for path in made} == {
        *("recordings", "reports", f"{DRIVE}.mcap", "two.md", "two.pdf", "two.json"),
        *("page.html", "two.html"),
    }
    texts = [path for path in made if path.suffix in (".csv", ".json", ".toml", ".md")]
    assert len(texts) >= 8
    for path in texts:
        for line in (folder / path).read_text(encoding="utf-8").rstrip("\n").split("\n"):
            assert line == visible(line)


def test_the_configuration_of_the_run_is_read_back(told, folder):
    text = (folder / "reports" / visible(DRIVE) / "run.toml").read_text(encoding="utf-8")
    assert tomllib.loads(text)["topics"]["image"] == CAMERA
    assert tomllib.loads(told["config"].stdout)["topics"]["masks"] == {"net": MASKS}


def test_figures_and_reports_show_the_drive_escaped(told, folder):
    for name in ("fig3a_error_rate.pdf", "report.pdf"):
        page = PdfReader(folder / "reports" / visible(DRIVE) / name).pages[0].extract_text()
        assert visible(DRIVE).replace(" ", "") in re.sub(r"\s|\u200b", "", page)


def test_markdown_shows_the_names_and_no_markup(told, folder):
    label = f"recordings/{visible(DRIVE)}.rrd"
    assert as_markdown(f" exactly as good as {label} ") in (folder / "two.md").read_text(
        encoding="utf-8"
    )


def test_the_viewers_texts_show_them_too(told, folder):
    recording = Recording(folder / "recordings" / f"{visible(DRIVE)}.rrd")
    assert recording.result("guide").startswith(f"### {as_markdown(visible(DRIVE))}\n")
    assert f"mask in {as_markdown(MASKS)}" in recording.result("guide/net")


@pytest.mark.parametrize(
    "name",
    ["@cmd()", "../../x", "-1+1", "@x", "a b", "a\nb", "\x1b[2J", "n" * 10_000, "größe", "$x$"],
)
def test_a_variant_cannot_have_such_a_name(name, tmp_path):
    done = here("config", "--mask-topic", f"{name}=/net")
    assert done.returncode == 2
    assert "a name is made of letters" in done.stderr
    assert len(done.stderr) < 400


def test_a_page_shows_them_as_text(folder, told, watched):
    for name in ("page.html", "two.html"):
        seen = watched((folder / name).as_uri())
        assert not re.search(r"[\x00-\x09\x0b-\x1f\x9b\u202e]", (folder / name).read_text())
        assert seen.tab.locator("script").count() == 1
        assert seen.tab.locator("main img[src=x], main a[href^=javascript]").count() == 0
        assert seen.complaints == []
    tab = watched((folder / "page.html").as_uri()).tab
    assert tab.locator("h1").inner_text() == visible(DRIVE)
    assert SCRIPT in tab.locator("main").text_content()


LINE = "word " * 20


@pytest.fixture
def results(street, tmp_path):
    """A drive's results, to be changed."""
    return shutil.copytree(street.reports, tmp_path / "r")


def changed(path, **parts):
    """Write other parts into a document, and the digest that then fits."""
    content = json.loads(path.read_text()) | parts
    content["digest"] = digest_of(content, content["digest"]["parts"])
    path.write_text(json.dumps(content))


def refused(*words):
    """What is said of a result that is refused at once."""
    begun = time.process_time()
    done = here(*words)
    assert done.returncode == 1, done.stdout
    assert done.stderr.count("\n") == 1
    assert "defect" not in done.stderr
    assert time.process_time() - begun < 5
    return done.stderr


@pytest.mark.parametrize(
    ("part", "value", "reason"),
    [
        ("verdict", "x" * 1_000_000, "a text of 1,000,000 letters, and at most 12,000 are read"),
        ("warnings", [LINE] * 20_000, "a list in it has more than 1,000,000 letters"),
        ("warnings", ["x" * 12_000] * 50, "its long texts have more than 500,000 letters"),
        ("totals", {f"v{n}": {"post": {}} for n in range(150_000)}, "more than 200,000 values"),
    ],
)
def test_a_summary_that_holds_too_much_is_refused(results, part, value, reason):
    changed(results / "summary.json", **{part: value})
    words = {"report": ("-o", results / "r.pdf"), "compare": (results,), "inspect": ("--list",)}
    for command, more in words.items():
        assert reason in refused(command, results, *more)


def test_a_table_of_thousands_of_variants_is_refused(results):
    lines = (results / "frames.csv").read_text().splitlines()
    rows = [line.replace("filtered", f"v{n}") for n in range(2_000) for line in lines[1:2]]
    (results / "frames.csv").write_text("\n".join([lines[0], *rows, ""]))
    summary = json.loads((results / "summary.json").read_text())
    tables = {name: each for name, each in summary["tables"].items() if name != "frames"}
    content = (results / "frames.csv").read_bytes()
    stated = {"rows": content.count(b"\n") - 1, "sha256": hashlib.sha256(content).hexdigest()}
    changed(results / "summary.json", tables=tables | {"frames": stated})
    assert "column variant holds 2,000 different words" in refused("report", results)


@pytest.fixture(scope="module")
def week(tmp_path_factory):
    return fleet_of(tmp_path_factory.mktemp("week") / "week", 2)


@pytest.fixture
def fleet(week, tmp_path):
    """A fleet, to be changed."""
    return shutil.copytree(week, tmp_path / "week")


@pytest.mark.parametrize(
    ("column", "value", "rows", "reason"),
    [
        ("name", "x" * 1_000_000, 1, "a text of 1,000,000 letters"),
        ("name", "x" * 11_000, 5_000, "its long texts have more than 500,000 letters"),
        ("evaluated", 1, 3_000_000, "rows and"),
        ("warnings", LINE * 5, 9_000, None),
    ],
)
def test_a_fleets_table_that_unpacks_to_too_much_is_refused(fleet, column, value, rows, reason):
    path = fleet / "drives.parquet"
    table = parquet.read_table(path).slice(0, 1)
    if rows > 10_000:
        table = table.select(["drive", column])
    many = table.take(pa.array(np.zeros(rows, np.int64)))
    place = many.schema.get_field_index(column)
    cells = pa.array([value], many.schema.field(place).type).take(pa.array([0] * rows))
    parquet.write_table(many.set_column(place, column, cells), path, compression="zstd")
    assert path.stat().st_size < 1 << 20
    if reason:
        assert reason in refused("report", fleet)
    else:
        from roadeval.results.tables import read_parquet

        assert len(read_parquet([path], "drives")) == rows


POINTER = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a2146\nsize 12345\n"
NESTED = "a = " + "[" * 1_000 + "]" * 1_000


@pytest.fixture
def turned_away(tmp_path, monkeypatch):
    """Run a command beside a sound log; returns the one line. Nothing may be left behind."""
    monkeypatch.chdir(tmp_path)
    write_log(tmp_path / "drive.mcap")

    def turned_away(words):
        before = {*tmp_path.rglob("*")}
        done = here(*words.split(), cwd=tmp_path)
        assert (done.returncode, done.stdout) == (1, "")
        assert done.stderr.startswith("roadeval: error: ")
        assert done.stderr.count("\n") == 1
        assert {*tmp_path.rglob("*")} == before
        return done.stderr

    return turned_away


@pytest.mark.timeout(20)
@pytest.mark.parametrize(
    "words",
    [
        *("replay pipe", "info pipe", "train pipe -o m.model", "replay drive.mcap --model pipe"),
        *("replay drive.mcap --config pipe", "replay drive.mcap --variant other=pipe"),
        *("config --config pipe", "report pipe -o out.pdf", "report folder -o out.pdf"),
        *("inspect pipe --list", "compare pipe pipe", "pack images -o new.mcap"),
    ],
)
def test_a_pipe_is_refused_and_never_waited_for(words, turned_away):
    for folder in ("folder", "images"):
        Path(folder).mkdir()
    for pipe in ("pipe", "folder/summary.json", "images/0.png"):
        os.mkfifo(pipe)
    assert "is a pipe, not a file" in turned_away(words)


def test_a_device_is_refused_before_it_is_read(turned_away):
    line = turned_away("replay drive.mcap --config /dev/null")
    assert "/dev/null: cannot be read: is a device" in line


@pytest.mark.parametrize(
    "words",
    [
        *("config --config it.toml", "config --variant v=it.toml", "config --net n=it.toml"),
        *("config --masks m=it.toml", "fleet it.toml -o f"),
    ],
)
def test_toml_that_nests_too_deep_is_one_line(words, turned_away):
    Path("it.toml").write_text(NESTED)
    assert "it.toml: cannot be read as TOML: " in turned_away(words)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("a.mcap", "replay a.mcap"),
        ("labels/0000.png", "replay drive.mcap --truth labels"),
        ("labels/0000.txt", "replay drive.mcap --truth labels --road-label road"),
        ("coco.json", "replay drive.mcap --truth coco.json --road-label road"),
        ("cvat.xml", "replay drive.mcap --truth cvat.xml --road-label road"),
        ("masks/0000.png", "replay drive.mcap --masks mine=masks"),
        ("masks/0000.npy", "replay drive.mcap --masks mine=masks"),
        ("net.onnx", "replay drive.mcap --net mine=net.onnx"),
        ("net.toml", "replay drive.mcap --net mine=net.toml"),
        ("run.toml", "replay drive.mcap --config run.toml"),
        ("camera.toml", "replay drive.mcap --camera camera.toml"),
        ("city.model", "replay drive.mcap --model city.model"),
        ("fleet.toml", "fleet fleet.toml -o out"),
        ("out.rrd", "report out.rrd"),
        ("results/summary.json", "report results"),
        ("images/0000.jpg", "pack images -o new.mcap"),
    ],
)
def test_a_pointer_of_git_lfs_is_told_with_the_command_that_fetches_its_file(
    name, words, turned_away
):
    Path(name).parent.mkdir(exist_ok=True)
    Path(name).write_text(POINTER)
    line = turned_away(words)
    assert f"{Path(name).name}: " in line
    assert "a pointer to a file in Git LFS: git lfs pull" in line

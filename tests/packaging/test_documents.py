"""What documents name is there, what pages and tables say is what code and measurements say."""

import re
import runpy
import tomllib
from importlib import import_module
from pathlib import Path

import duckdb
import pytest

import roadeval
from benchmarks.tables import __main__ as script
from benchmarks.tables import overlap
from benchmarks.tables.drives import DRIVES
from benchmarks.tables.measure import REPLAYS, SEEDS
from benchmarks.tables.text import DOCUMENTS as MEASURED
from benchmarks.tables.text import between_marks, faults, load, loose_numbers
from roadeval import RunConfig
from roadeval.cli.exit_codes import ExitCode
from roadeval.cli.options import OPTIONS
from roadeval.evaluation.settings import DEGRADED_ERR, DEGRADED_MARGIN, FAILED_ERR, FAILED_FNR
from roadeval.fleet.drives import read_manifest
from roadeval.pipeline import paper
from roadeval.results.schema import TABLES
from tests.results.fleet.making import fleet_of

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = Path(roadeval.__file__).parent
DOCUMENTS = [
    "README.md",
    "CONTRIBUTING.md",
    *(str(path.relative_to(ROOT)) for path in ROOT.glob("docs/**/*.md")),
]
LINK = re.compile(r"\]\((?!https?:|#)([^)#\s]+)[^)]*\)")
QUOTED = re.compile(r"`((?:[\w.-]+/)+[\w.-]*)`")
"""A path in backticks: it has a slash."""
COMPUTED = re.compile(r"\]\(([\w./]+\.py)\)((?:,? `\w+`)+)")
"""A link to a file, and names that it defines."""
HEALTH = ("failed", "degraded")
MADE = re.compile(r"^`(\S+)`$", re.MULTILINE)
"""The head of a file that CONTRIBUTING.md adds."""
ROOMS = {path.name for path in PACKAGE.iterdir() if path.is_dir()}
ELSEWHERE = (
    *(".venv/", "reports/", "recordings/", "build/", "masks/", "images/", "../shared/"),
    *("to_label/", "to_check/", "labels/", "proposals/"),
)
"""Where runs write, and what users bring."""


def exists(path: str, document: Path) -> bool:
    """Whether a path is there: beside the document, in the checkout, or in the package.

    Tests may run where the package is installed and the checkout has none.
    """
    path = re.sub(r"^(\.\./)*roadeval/", "", path)
    if any((place / path).exists() for place in (document.parent, ROOT, PACKAGE)):
        return True
    # A folder may be named alone where its room is clear.
    return path.count("/") == 1 and any(PACKAGE.glob(f"*/{path}"))


@pytest.mark.parametrize("name", DOCUMENTS)
def test_every_path_exists(name):
    document = ROOT / name
    text = document.read_text()
    paths = {*LINK.findall(text), *QUOTED.findall(text)} - {*MADE.findall(text)}
    missing = [
        path
        for path in sorted(paths)
        if not path.startswith(ELSEWHERE) and not exists(path, document)
    ]
    assert paths or name.startswith("docs/")
    assert not missing


def test_every_function_of_the_method_is_defined_in_the_file_it_follows():
    page = ROOT / "docs" / "explanation" / "paper.md"
    named = COMPUTED.findall(page.read_text())
    assert len(named) > 10
    for path, names in named:
        text = (PACKAGE / re.sub(r"^(\.\./)*roadeval/", "", path)).read_text()
        for name in re.findall(r"\w+", names):
            assert re.search(rf"^(def {name}\(|{name}\b.*=)", text, re.MULTILINE), f"{path}: {name}"


def test_the_steps_of_the_method_name_every_layer_of_the_recording():
    text = (ROOT / "docs" / "explanation" / "paper.md").read_text()
    layers = {spec.name for spec in RunConfig().pipelines()["filtered"].layers()}
    assert {*re.findall(r"`/filtered/(\w+)`", text)} == layers


def test_failed_and_degraded_are_explained_by_their_thresholds():
    text = (ROOT / "docs" / "reference" / "results.md").read_text()
    failed, degraded = (re.search(rf"^\| {word} \|.*", text, re.MULTILINE)[0] for word in HEALTH)
    assert re.findall(r"(\d+) ", failed) == [f"{100 * x:.0f}" for x in (FAILED_ERR, FAILED_FNR)]
    assert re.findall(r"(\d+) ", degraded) == [
        f"{100 * x:.0f}" for x in (DEGRADED_ERR, DEGRADED_MARGIN)
    ]


def test_every_room_is_in_the_architecture():
    text = (ROOT / "docs" / "architecture.md").read_text()
    missing = [room for room in sorted(ROOMS - {"__pycache__"}) if f"`{room}/`" not in text]
    assert not missing


def test_the_version_is_the_same_everywhere():
    changes = (ROOT / "CHANGELOG.md").read_text()
    citation = (ROOT / "CITATION.cff").read_text()
    assert f"\n## [{roadeval.__version__}] - " in changes
    assert f"\nversion: {roadeval.__version__}\n" in citation


DOCS = Path(__file__).resolve().parents[2] / "docs"
GENERATED = runpy.run_path(str(DOCS / "generated.py"))
PAGES = {path: path.read_text() for path in DOCS.rglob("*.md")}
FROM_CODE = {
    str(path.relative_to(DOCS)): text for path, text in PAGES.items() if "<!-- gen" in text
}


def test_every_text_from_the_code_has_its_page():
    names = [name for text in FROM_CODE.values() for name in GENERATED["BLOCK"].findall(text)]
    assert sorted(names) == sorted(GENERATED["GENERATED"])


@pytest.mark.parametrize("page", FROM_CODE)
def test_a_page_says_what_the_code_says(page):
    text = FROM_CODE[page]
    assert text == GENERATED["written"](text), "out of date: run python docs/generated.py"
    old = text.replace("<!-- end -->", "left over\n<!-- end -->")
    assert GENERATED["written"](old) == text


def test_no_other_name_is_public():
    with pytest.raises(AttributeError, match="module 'roadeval' has no attribute 'nothing'"):
        roadeval.nothing  # noqa: B018


def test_the_site_links_every_public_name_to_its_api_page():
    text = GENERATED["page"]("reference/python", FROM_CODE["reference/python.md"])
    assert re.findall(r'"../api/roadeval.html#(\w+)"', text) == [*roadeval.__all__]


def test_every_option_and_every_setting_is_there():
    commands, settings = GENERATED["commands"](), GENERATED["settings"]()
    for option in OPTIONS:
        assert f"{option.flags[-1]} " in commands or f"{option.flags[-1]}`" in commands
        table, _, key = option.setting.partition(".")
        if key and not key.startswith("masks"):
            assert f"[{table}" in settings
            assert re.search(rf"^(# )?{key} =", settings, re.MULTILINE), option.setting


def test_the_settings_can_be_copied():
    blocks = re.findall(r"```toml\n(.*?)```", GENERATED["settings"](), re.DOTALL)
    assert len(blocks) > 15
    tables = [tomllib.loads(block) for block in blocks]
    paper = tomllib.loads(roadeval.config_toml())
    assert {"shadow": paper["shadow"]} in tables


def test_every_table_exit_code_and_public_name_is_there():
    tables = GENERATED["tables_of_a_drive"]() + GENERATED["tables_of_a_fleet"]()
    assert {*re.findall(r"### (\w+)\.", tables)} == {*TABLES}
    codes = re.findall(r"^\| (\d+) \|", GENERATED["exit_codes"](), re.MULTILINE)
    assert [*map(int, codes)] == [*ExitCode]
    names = re.findall(r"^\| `(\w+)` \|", GENERATED["python"](), re.MULTILINE)
    assert names == [*roadeval.__all__]


@pytest.mark.parametrize("name", GENERATED["COPIES"])
def test_a_page_that_is_a_file_elsewhere_leads_to_pages_of_the_site_alone(name):
    text = GENERATED["page"](name, "")
    folder = (DOCS / name).parent
    for _, _, target, _ in GENERATED["LINK"].findall(text):
        assert (folder / target).resolve() in PAGES, target


TEXTS = [path.read_text() for path in MEASURED]


@pytest.fixture
def arguments(monkeypatch):
    """Call the script with some arguments."""

    def call(*given):
        monkeypatch.setattr("sys.argv", ["tables", *given])
        return script.main()

    return call


def test_all_texts_say_what_was_measured(arguments, capsys):
    assert arguments() == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("text", TEXTS, ids=[path.name for path in MEASURED])
def test_a_changed_number_in_any_table_is_found(text):
    numbers = load()
    names = re.findall(r"^<!-- table (\w+)", text, re.MULTILINE)
    assert names
    for name in names:
        block = between_marks(name, numbers)
        digit = max(re.finditer(r"\d", block.rpartition("\nMade by")[0]), key=lambda m: m.start())
        other = str((int(digit[0]) + 1) % 10)
        wrong = block[: digit.start()] + other + block[digit.end() :]
        (fault,) = faults(text.replace(block, wrong), numbers)
        assert fault.startswith(f"table {name}: not what numbers.json gives")


def test_the_numbers_follow_the_measurement(arguments, capsys, tmp_path, monkeypatch):
    numbers = load()
    numbers["idd"]["blind"]["ERR"] += 0.01
    monkeypatch.setattr(script, "load", lambda: numbers)
    assert arguments() == 1
    told = capsys.readouterr().err
    assert "presets.md: table drives: not what numbers.json gives; run with --write" in told
    assert "README.md: table findings: not what numbers.json gives; run with --write" in told
    assert "PRESETS.md: table idd: not what numbers.json gives; run with --write" in told


@pytest.mark.parametrize(
    "number", ["5.3 %", "+10.7 pp", "12 ms", "4 points", "565 MiB", "1.35", "-0.6"]
)
def test_a_measured_number_in_a_sentence_is_found(number):
    assert loose_numbers(f"ERR is {number} there.")
    (fault,) = faults(f"ERR is {number} there.", load())
    assert "a measured number outside a table" in fault


def test_every_drive_has_every_replay_with_every_seed():
    numbers = load()
    assert numbers["seeds"] == SEEDS
    for key, replay in REPLAYS.items():
        for name in replay.drives:
            found = numbers["drives"][name][key]
            assert found["seeds"] == [*range(replay.seeds)], (name, key)
            assert all(len(each["ERR"]) == replay.seeds for each in found["variants"].values())
    assert {*numbers["drives"]} == {*DRIVES}


@pytest.fixture(scope="module")
def demo():
    """Numbers of two frames and their pixels; some trees are enough to be counted."""
    few = {"frames": {"max_frames": 5}, "training": {"frames": 3}}
    return overlap.replay_demo(**few, trees={"trees": 15})


def test_libraries_of_others_compute_the_overlap_numbers_that_are_printed(demo):
    """`compare_libraries` refuses two values that are not equal."""
    found = overlap.compare_libraries(*demo)
    assert found["evaluated"] == 2
    assert {*found["values"]} == {*load()["overlap"]["values"]}


def test_a_library_that_computes_another_number_is_told(demo, monkeypatch):
    wrong = overlap.NUMBERS[0]._replace(again=lambda _: 0.5)
    monkeypatch.setattr(overlap, "NUMBERS", (wrong,))
    with pytest.raises(overlap.DifferentNumberError, match=r"0\.5 by a library"):
        overlap.compare_libraries(*demo)


ROWS = re.findall(r"^\| ([\d-]+) \|.*\| (.*`.*) \|$", paper.__doc__, re.MULTILINE)
CASES = [(numbers, name) for numbers, names in ROWS for name in re.findall(r"`(\w+\.\w+)`", names)]


def equations(text):
    """The numbers of all equations that a text names."""
    numbers = set()
    for first, last in re.findall(r"Eq\. (\d+)(?:-(\d+))?", text):
        numbers |= set(range(int(first), int(last or first) + 1))
    return numbers


def test_the_table_has_all_equations_of_the_pipeline():
    listed = {n for numbers, _ in ROWS for n in equations(f"Eq. {numbers}")}
    # Number 19 is printed nowhere.
    assert listed == set(range(2, 24)) - {19}


@pytest.mark.parametrize(("numbers", "name"), CASES)
def test_a_function_of_the_table_names_its_equation(numbers, name):
    module, function = name.split(".")
    home = import_module(f"{paper.__name__}.{module}")
    assert equations(getattr(home, function).__doc__) & equations(f"Eq. {numbers}")


DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "fleet.md"
TEXT = DOCUMENT.read_text()


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)


(WEATHER,) = blocks("sql")


def final(fleet):
    return fleet.scores.query("variant == 'filtered' and final and region == 'all'")


@pytest.fixture(scope="module")
def fleets(tmp_path_factory):
    """A folder with a fleet."""
    folder = tmp_path_factory.mktemp("fleets")
    fleet_of(folder / "monday", 12, frames=5)
    return folder


@pytest.fixture
def asked(fleets, monkeypatch):
    """Ask DuckDB, where the fleets are."""
    monkeypatch.chdir(fleets)
    with duckdb.connect() as database:
        yield lambda query: database.execute(query).df()


def test_err_by_weather_in_duckdb_and_in_pandas(asked, fleets):
    fleet = roadeval.Result(fleets / "monday")
    rows = final(fleet).merge(fleet.drives, on="drive")
    found = asked(WEATHER).set_index("weather")
    assert {*found.index} == {"sun", "rain", "fog"}
    names = {}
    exec(blocks("python")[-1], names)
    for weather, own in rows.groupby("tag_weather"):
        row = found.loc[weather]
        assert row.drives == len(own) == names["weather"].loc[weather, "count"]
        assert row.mean_ERR == pytest.approx(own.ERR.mean())
        assert row.mean_ERR == pytest.approx(names["weather"].loc[weather, "mean"])
        assert row.pooled_ERR == pytest.approx((own.FP + own.FN).sum() / own.N.sum())


def test_the_manifest_can_be_read(tmp_path):
    (toml,) = blocks("toml")
    for name in ("monday/a", "monday/b", "tuesday/street"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / f"{name}.mcap").touch()
    (tmp_path / "m.toml").write_text(toml)
    *monday, tuesday = read_manifest(tmp_path / "m.toml")
    assert [each.group for each in monday] == ["2026-11-16"] * 2
    assert (tuesday.group, tuesday.tags) == (None, {"weather": "sun"})
    assert tuesday.settings["labels"]["road"] == [3]

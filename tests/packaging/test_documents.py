"""What the documents name is there: paths, anchors of the version, and the licence."""

import re
from pathlib import Path

import pytest

import roadeval
from roadeval import RunConfig
from roadeval.evaluation.settings import DEGRADED_ERR, DEGRADED_MARGIN, FAILED_ERR, FAILED_FNR

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
NAMED = re.compile(r"`([\w/]+\.py)`, `(\w+)`")
"""A file, and a name that it defines."""
COMPUTED = re.compile(r"\]\(([\w./]+\.py)\)((?:,? `\w+`)+)")
"""A link to a file, and names that it defines."""
HEALTH = ("failed", "degraded")
MADE = re.compile(r"^`(\S+)`$", re.MULTILINE)
"""The head of a file that CONTRIBUTING.md adds."""
ROOMS = {path.name for path in PACKAGE.iterdir() if path.is_dir()}
ELSEWHERE = (
    *(".venv/", "reports/", "recordings/", "build/", "masks/", "images/", "../shared/"),
    *("to_label/", "labels/", "proposals/"),
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


def test_every_name_is_defined_in_the_file_it_follows():
    named = NAMED.findall((ROOT / "docs" / "architecture.md").read_text())
    assert named
    for path, name in named:
        defined = rf"^(def|class) {name}\b|^{name}\b.*="
        assert re.search(defined, (PACKAGE / path).read_text(), re.MULTILINE), f"{path}: {name}"


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

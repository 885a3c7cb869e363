"""``roadeval compare``: what changed, and a guard that fails when it should."""

import json
import subprocess
import sys
from xml.etree import ElementTree

import pytest

from tests.e2e.commands import DEMO, Replayed, here, replay, roadeval
from tests.results.fleet.making import fleet_of

LIMIT = ("--fail-if", "post.filtered.ERR > +0.5pp")


@pytest.fixture(scope="module")
def worse(tmp_path_factory) -> Replayed:
    """The demo's first frames with a classifier that is known to fail."""
    folder = tmp_path_factory.mktemp("worse")
    (folder / "worse.toml").write_text('[svm]\nkernel = "linear"\n[post]\nfill = false\n')
    words = ("--config", folder / "worse.toml", "--max-frames", 20, "--record", "none")
    return replay(folder, DEMO, *words)


@pytest.mark.parametrize("words", [("compare", "R", "R"), ("inspect", "--list", "R")])
def test_a_recording_is_compared_and_listed_without_heavy_libraries(words, demo):
    heavy = {"cv2", "matplotlib", "rerun", "sklearn"}
    code = (
        "import sys; from roadeval.cli.app import main; assert main(sys.argv[1:]) == 0; "
        f"sys.exit(str({heavy} & {{*sys.modules}} or ''))"
    )
    typed = [str(demo.recording) if word == "R" else word for word in words]
    done = subprocess.run(
        [sys.executable, "-c", code, *typed], capture_output=True, text=True, check=False
    )
    assert not done.stderr.strip()


def test_a_recording_against_itself_differs_by_nothing(demo):
    run = roadeval("compare", demo.recording, demo.recording, *LIMIT, "--json")
    assert run.returncode == 0, run.stderr
    content = json.loads(run.stdout)
    for change in content["changes"]:
        assert change["base"] == change["new"]
        assert {told["mean"] for told in change["difference"].values()} == {0}


def test_ci_gets_a_case_a_condition_as_junit(demo, worse, tmp_path):
    kept = ("--fail-if", "svm.filtered.ERR > 99%")
    words = (*LIMIT, *kept, "--junit", tmp_path / "compare.xml", "-q")
    run = here("compare", demo.recording, worse.reports, *words)
    assert run.returncode == 4
    suite = ElementTree.parse(tmp_path / "compare.xml").getroot()
    counts = {name: suite.get(name) for name in ("tests", "failures", "errors")}
    assert counts == {"tests": "3", "failures": "1", "errors": "0"}
    assert "frames that out evaluated are left out" in run.stderr
    first, exceeded, limited = suite
    assert first.find("system-out").text.startswith("Changed settings: ")
    assert exceeded.get("classname") == LIMIT[1]
    message = exceeded.find("failure").get("message")
    assert message in run.stderr
    assert "(limit: post.filtered.ERR > +0.5pp)" in message
    assert limited.find("system-out").text.endswith("> 99%)")


def test_a_limit_that_cannot_be_judged_is_an_error_in_every_file(demo, worse, tmp_path):
    files = ("-o", tmp_path / "c.md", "--junit", tmp_path / "c.xml", "-q")
    words = ("--fail-if", "post.filterd.ERR > +0.5pp", "--fail-if", "post.filtered.ERR > 99%")
    run = here("compare", demo.recording, worse.reports, *words, *files)
    (line,) = (each for each in run.stderr.splitlines() if "warning" not in each)
    why = line.removeprefix("roadeval: error: ")
    assert (run.returncode, why.partition(";")[0]) == (
        1,
        "post.filterd.ERR > +0.5pp: not judged in reports, because nothing compared is called "
        "post.filterd",
    )
    suite = ElementTree.parse(tmp_path / "c.xml").getroot()
    assert (suite.get("errors"), suite.get("failures")) == ("1", "0")
    assert suite.find("testcase/error").get("message") == why
    title, _, heading, _, reason, *_ = (tmp_path / "c.md").read_text().splitlines()
    assert title == "# roadeval: failed, 1 of 2 limits not judged"
    assert heading == "**Not judged**"
    assert why.partition(":")[0].replace(">", "\\>") in reason


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["--fail-if", "ERR > 1"], 2, "is not a condition"),
        (["--fail-if", "post.filtered.ERR > 101%"], 2, "101 is not from 0 to 100: no ERR is"),
        (["--fail-if", "post.filtered.ERR < -101pp"], 2, "-101 is not from -100 to 100: no ERR"),
        (["-o", "change.docx"], 2, "the name must end in .pdf, .html, .md, .json or .svg"),
        (["--fail-if", "post.net.ERR > 1pp"], 1, "nothing compared is called post.net"),
        (["--variant", "net"], 1, "no variant net"),
    ],
)
def test_what_cannot_be_done_is_one_line(words, code, said, demo):
    run = here("compare", demo.recording, demo.reports, *words)
    assert run.returncode == code
    assert said in run.stderr
    assert len(run.stderr.splitlines()) == 1


# --- Fleets ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def fleets(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleets")
    return fleet_of(folder / "base", 10), fleet_of(folder / "new", 10, change=0.03)


def test_a_worse_fleet_ends_with_4_and_the_sentence_that_says_why(fleets):
    run = here("compare", *fleets, *LIMIT)
    assert run.returncode == 4
    assert "new against base: 8 drives in common" in run.stdout
    told = " ".join(run.stdout.split())
    assert "filtered of new: ERR surely changed on 3 of 8 drives (worse on 3, better on 0" in told
    assert "drive_0003" in run.stdout
    assert max(map(len, run.stdout.splitlines())) <= 80
    assert "post.filtered.ERR of new changed by" in run.stderr
    assert "warning: 2 drives are left out of base" in run.stderr

"""``roadeval compare``: what changed, and a guard that fails when it should."""

import json
import shutil
import subprocess
import sys

import pytest

from tests.e2e.commands import DEMO, Replayed, here, replay, roadeval
from tests.report.making import text

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
    heavy = {"cv2", "matplotlib", "pandas", "pyarrow.compute", "rerun"}
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
    assert content["same_drive"]
    for change in content["changes"]:
        assert change["base"] == change["new"]
        assert {told["mean"] for told in change["difference"].values()} == {0}


def test_a_recording_against_its_own_results_folder_differs_by_nothing_to_the_last_digit(demo):
    run = here("compare", demo.recording, demo.reports, "--json")
    means = [
        told["mean"]
        for change in json.loads(run.stdout)["changes"]
        for told in change["difference"].values()
    ]
    assert set(means) == {0}


def test_a_worse_configuration_ends_with_4_and_the_sentence_that_says_why(demo, worse):
    run = here("compare", demo.recording, worse.reports, *LIMIT)
    assert run.returncode == 4
    (why,) = (line for line in run.stderr.splitlines() if "post.filtered.ERR" in line)
    assert "post.filtered.ERR > +0.5pp holds" in why
    assert "frames that out evaluated are left out" in run.stderr


def test_a_limit_that_is_kept_ends_with_0(demo, worse):
    kept = ("--fail-if", "post.filtered.ERR < -50pp", "--fail-if", "post.filtered.ERR > 99%")
    assert here("compare", demo.recording, worse.reports, *kept).returncode == 0


def test_the_files_are_written_by_their_endings(demo, worse, tmp_path):
    names = [tmp_path / f"change.{ending}" for ending in ("pdf", "md", "json")]
    words = [word for name in names for word in ("-o", name)]
    run = here("compare", demo.recording, worse.reports, *words, *LIMIT, "-q")
    assert run.returncode == 4
    assert run.stdout == ""
    document, markdown, content = (name.read_bytes() for name in names)
    final = next(
        change
        for change in json.loads(content)["changes"]
        if (change["variant"], change["stage"]) == ("filtered", "post")
    )
    told = f"{100 * final['base']['ERR']:.2f} | {100 * final['new']['ERR']:.2f}"
    assert told in markdown.decode()
    assert told.replace(" | ", " ") in text(document)


def test_the_variants_of_one_recording_are_compared_with_each_other(demo):
    run = here("compare", demo.recording, "--json")
    assert run.returncode == 0, run.stderr
    content = json.loads(run.stdout)
    assert [each["label"] for each in content["results"]] == ["unfiltered", "filtered"]
    final = next(change for change in content["changes"] if change["final"])
    difference = demo.summary["difference"]["post"]["ERR"]["mean"]
    assert final["difference"]["ERR"]["mean"] == pytest.approx(difference)


@pytest.mark.parametrize("kept", [0, 0.5])
@pytest.mark.parametrize("command", ["compare", "report"])
def test_a_damaged_table_is_named_in_one_line(command, kept, worse, tmp_path):
    folder = shutil.copytree(worse.reports, tmp_path / "reports")
    whole = (folder / "frames.csv").read_bytes()
    (folder / "frames.csv").write_bytes(whole[: int(kept * len(whole))])
    outputs = ("-o", tmp_path / "out.pdf") if command == "report" else ()
    run = here(command, folder, *outputs)
    assert run.returncode == 1
    assert f"{folder / 'frames.csv'}: does not agree with its summary" in run.stderr
    assert len(run.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["--fail-if", "ERR > 1"], 2, "is no condition"),
        (["-o", "change.docx"], 2, "end it in .pdf, .html, .md or .json"),
        (["--fail-if", "post.net.ERR > 1pp"], 1, "nothing compared is called post.net"),
        (["--variant", "net"], 1, "no variant net"),
    ],
)
def test_what_cannot_be_done_is_one_line(words, code, said, demo):
    run = here("compare", demo.recording, demo.reports, *words)
    assert run.returncode == code
    assert said in run.stderr
    assert len(run.stderr.splitlines()) == 1


def test_where_err_is_undefined_on_every_frame_it_is_said(ignored, tmp_path):
    names = [tmp_path / f"change.{ending}" for ending in ("pdf", "md", "json")]
    words = [word for name in names for word in ("-o", name)]
    run = here("compare", ignored.reports, *words)
    assert run.returncode == 0, run.stderr
    assert "filtered: ERR is undefined on every frame\n" in run.stdout
    assert "no interval" not in run.stdout
    assert "filtered: ERR is undefined on every frame" in text(names[0].read_bytes())

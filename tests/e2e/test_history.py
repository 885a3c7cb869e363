"""``roadeval history`` of thirty nights of a small drive, the last nine with a bad commit."""

import json
import shutil
from pathlib import Path

import pytest

from tests.e2e.commands import here, replay
from tests.fixtures.make import make

DAY_NS = 86_400 * 10**9
GOOD, BAD = "a" * 40, "bad" * 13 + "b"


def made_at(folder: Path, night: int, commit: str) -> None:
    """Say of results when, and of which commit, they were made."""
    path = folder / "summary.json"
    summary = json.loads(path.read_text())
    summary["origin"] |= {"made_ns": 1_790_000_000 * 10**9 + night * DAY_NS, "commit": commit}
    path.write_text(json.dumps(summary))


@pytest.fixture(scope="module")
def nights(street, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("nights") / "nightly"
    setting = folder.with_name("bad.toml")
    setting.write_text((street.reports / "run.toml").read_text().replace("c = 1.0", "c = 0.001"))
    drive = make("drives/street.mcap", folder.with_name("drives"))
    bad = replay(folder.with_name("bad"), drive, "--record", "none", "--config", setting)
    assert bad.run.returncode == 0, bad.run.stderr
    for night in range(30):
        source = bad.reports if night > 20 else street.reports
        shutil.copytree(source, folder / f"{night:02}", ignore=shutil.ignore_patterns("fig*"))
        made_at(folder / f"{night:02}", night, BAD if night > 20 else GOOD)
    return folder


@pytest.mark.sweep
def test_the_bad_commit_is_named_on_terminal_page_and_in_json(nights, tmp_path):
    outputs = [tmp_path / f"history.{end}" for end in ("html", "pdf", "md", "json")]
    run = here("history", nights, *(word for path in outputs for word in ("-o", path)))
    assert run.returncode == 0, run.stderr
    *_, verdict = run.stdout.strip().split("\n\n")
    assert "(badbadba)" in verdict.replace("\n", " ")
    page, _, markdown, facts = (path.read_bytes() for path in outputs)
    content = json.loads(facts)
    (event,) = content["events"]
    assert event["run"] == 21
    assert any(reason.startswith("svm.c 1 to 0.001") for reason in event["reasons"])
    assert len(event["frames"]) == 5
    assert content["last_good"] == [str(nights / "20")]
    assert b"badbadba" in page
    assert b"badbadba" in markdown


@pytest.mark.sweep
def test_the_last_run_is_guarded_and_the_last_good_one_is_a_base(nights, tmp_path):
    folder = tmp_path / "nightly"
    for night in ("18", "19", "20", "21"):
        shutil.copytree(nights / night, folder / night)
    worse = ("--fail-if", "post.filtered.ERR > +0.1pp")
    run = here("history", folder, "--last", "2", *worse, "-q")
    assert run.returncode == 4, run.stderr
    assert "limit exceeded" in run.stderr
    run = here("compare", folder, nights / "29")
    assert run.returncode == 0, run.stderr
    assert "against 20" in run.stdout
    (folder / "19" / "frames.csv").write_text("cut")
    run = here("history", folder, "--json")
    assert run.returncode == 3, run.stderr
    assert "19" in run.stderr
    frames = [night["frames"] for night in json.loads(run.stdout)["runs"]]
    assert frames == [frames[0], 0, frames[0], frames[0]]


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("{empty}",), 1, "holds no results"),
        (("{nights}/03",), 1, "a history needs two runs"),
        (("{nights}", "--by", "build"), 1, "has no label build"),
        (("{nights}", "--fail-if", "ERR"), 2, "is not a condition"),
        (("{nights}", "-o", "x.txt"), 2, "the name must end in"),
        (("{nights}", "-o", "{nights}/03/summary.json"), 1, "is an input"),
    ],
)
def test_a_wrong_command_is_told_in_a_line(words, code, message, nights, tmp_path):
    run = here("history", *(word.format(empty=tmp_path, nights=nights) for word in words))
    assert run.returncode == code, run.stderr
    assert message in run.stderr

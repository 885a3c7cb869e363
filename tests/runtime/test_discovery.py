"""What other installed packages add by their entry points."""

import re
import subprocess
import sys
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

import pytest

from roadeval import RoadevalError
from roadeval.evaluation import regions
from roadeval.evaluation.region import Region
from roadeval.runtime import discovery
from roadeval.runtime.repository import current_commit


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Install a package of one module, and one entry point; return a function that does."""
    caches = (discovery._all_points, discovery.points_of)

    def install(kind, code, value="things:THING"):
        (tmp_path / "things.py").write_text(
            f"from roadeval.evaluation.region import Region\n{code}"
        )
        about = tmp_path / "more_things-1.5.dist-info"
        about.mkdir()
        (about / "METADATA").write_text("Metadata-Version: 2.1\nName: more-things\nVersion: 1.5\n")
        (about / "entry_points.txt").write_text(f"[roadeval.{kind}]\nthing = {value}\n")
        monkeypatch.syspath_prepend(tmp_path)
        monkeypatch.delitem(sys.modules, "things", raising=False)
        for cached in caches:
            cached.cache_clear()

    yield install
    for cached in caches:
        cached.cache_clear()


REGION = 'THING = Region({"left": "left"}, order=1, find=lambda frame: frame["left"])'


def test_an_entry_point_adds_one_thing_or_several(package):
    package("regions", REGION + "\nALL = [THING, THING]", "things:ALL")
    added = discovery.installed("regions", Region, RoadevalError)
    assert [region.titles for region in added] == [{"left": "left"}] * 2
    assert discovery.installed("metrics", Region, RoadevalError) == []
    assert (
        discovery.versions_of_additions()
        == {"more-things": "1.5"}
        == {"more-things": version("more-things")}
    )


@pytest.mark.parametrize(
    ("code", "problem"),
    [
        ("import nowhere", "No module named 'nowhere'"),
        ("THING = 3", "things:THING is not a Region"),
        ("class Named(Region):\n    name = 'mine'\nTHING = Named({}, 1, None)", "'mine' is taken"),
    ],
)
def test_a_package_that_cannot_be_used_is_named(package, code, problem):
    package("regions", code)
    with pytest.raises(RoadevalError, match=re.escape(problem)) as caught:
        discovery.installed("regions", Region, RoadevalError, ["mine"])
    assert caught.value.where == "the package more-things"


def test_an_error_in_a_package_is_its_own(package):
    package("regions", REGION)
    (region,) = discovery.installed("regions", Region, RoadevalError)
    with pytest.raises(KeyError) as caught:
        region.find({})
    assert discovery.failed_package(caught.value) == "more-things"
    with pytest.raises(ImportError) as caught:
        import_module("nowhere")
    assert discovery.failed_package(caught.value) == ""


def test_two_regions_of_one_name_are_an_error(monkeypatch):
    left = Region({"left": "left"}, order=1, find=lambda _: {"left": 1})
    monkeypatch.setattr(regions, "regions", lambda: (left,))
    assert regions.of_frame(None) == {"left": 1}
    monkeypatch.setattr(regions, "regions", lambda: (left, left))
    with pytest.raises(RoadevalError, match="two regions have the same name"):
        regions.of_frame(None)


# --- What git says of the folder that a command runs in, if there is git and a repository ---------


NOTHING = "", False


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The current folder, outside any repository."""
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    for name, value in (("GLOBAL", "/dev/null"), ("NOSYSTEM", "1")):
        monkeypatch.setenv(f"GIT_CONFIG_{name}", value)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def git(*words):
    done = subprocess.run(["git", *words], check=True, capture_output=True, text=True)
    return done.stdout.strip()


@pytest.fixture
def commit(folder):
    """A commit of a file, in which ``below`` is another folder."""
    git("init", "-q")
    Path("below").mkdir()
    Path("below", "road.toml").write_text("every = 1\n")
    git("add", ".")
    git("-c", "user.name=me", "-c", "user.email=me@localhost", "commit", "-q", "-m", "first")
    return git("rev-parse", "HEAD")


def test_a_commit_is_named_and_changes_of_tracked_files_alone_count(commit, folder, monkeypatch):
    monkeypatch.chdir(folder / "below")
    assert current_commit() == (commit, False)
    Path("reports.csv").touch()
    assert current_commit() == (commit, False)
    Path("road.toml").write_text("every = 22\n")
    assert current_commit() == (commit, True)
    git("add", ".")
    assert current_commit() == (commit, True)


def test_without_a_commit_a_repository_or_git_there_is_nothing(folder, monkeypatch):
    assert current_commit() == NOTHING
    git("init", "-q")
    assert current_commit() == NOTHING
    Path(".git", "HEAD").write_bytes(b"\xff" * 5000)
    assert current_commit() == NOTHING
    monkeypatch.setenv("PATH", str(folder))
    assert current_commit() == NOTHING


def test_a_git_that_does_not_answer_and_a_folder_that_has_gone_are_nothing(folder, monkeypatch):
    stuck = folder / "git"
    stuck.write_text("#!/bin/sh\nexec /bin/sleep 60\n")
    stuck.chmod(0o755)
    monkeypatch.setenv("PATH", str(folder))
    assert current_commit(patience_s=0.05) == NOTHING
    stuck.unlink()
    folder.rmdir()
    assert current_commit() == NOTHING


def test_a_program_that_a_repository_names_is_not_started(commit, folder):
    program = folder / "watch"
    program.write_text("#!/bin/sh\ntouch started\n")
    program.chmod(0o755)
    git("config", "core.fsmonitor", str(program))
    assert current_commit()[0] == commit
    assert not (folder / "started").exists()

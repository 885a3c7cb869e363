"""What git says of the folder that a command runs in, if there is git and a repository."""

import subprocess
from pathlib import Path

import pytest

from roadeval.runtime.repository import current_commit

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

"""Help and version answer at once, because they import nothing heavy."""

import subprocess
import sys

import pytest

from roadeval.cli.app import app, main
from roadeval.version import VERSION

COMMANDS = [command.callback.__name__ for command in app.registered_commands if command.callback]
HEAVY = ["cv2", "matplotlib", "mcap", "numpy", "pandas", "pyarrow", "rerun", "sklearn"]


def test_the_list_of_commands_tells_each_in_a_line(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    main(["--help"])
    listed = capsys.readouterr().out.split("Commands:\n")[1].splitlines()
    assert [line.split()[0] for line in listed] == COMMANDS
    assert all(line.endswith(".") and not line.endswith("...") for line in listed)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_of_80_columns(command, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert main([command, "--help"]) == 0
    shown = capsys.readouterr()
    assert f"Usage: roadeval {command}" in shown.out
    assert max(len(line) for line in shown.out.splitlines()) <= 80
    assert shown.err == ""


def test_no_command_at_all_shows_the_help_as_wrong_usage(capsys):
    assert main([]) == 2
    shown = capsys.readouterr()
    assert "Commands:" in shown.err
    assert shown.out == ""


def test_version_goes_to_stdout(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"roadeval {VERSION}\n"


def test_an_environments_python_runs_the_command_too():
    words = [sys.executable, "-m", "roadeval", "--version"]
    run = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout) == (0, f"roadeval {VERSION}\n")
    words[-1] = "--nonsense"
    assert subprocess.run(words, capture_output=True, check=False).returncode == 2


def test_help_imports_nothing_heavy():
    words = [["--help"], ["--version"], *([command, "--help"] for command in COMMANDS)]
    program = (
        "import sys; from roadeval.cli.app import main\n"
        f"for words in {words}: main(words)\n"
        f"sys.exit(str([name for name in {HEAVY} if name in sys.modules]))"
    )
    run = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert run.stderr.strip() == "[]"

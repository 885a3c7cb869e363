"""Wrong usage, which no file can change: exit code 2; help and version at once."""

import os
import shlex
import subprocess
import sys

import pytest
import typer

from roadeval.cli.app import app, main
from roadeval.cli.options import FIRST, FLAGS
from roadeval.version import VERSION

WRONG = {
    "no drive": [],
    "two drives": ["a.mcap", "b.mcap"],
    "no frames": ["a.mcap", "--max-frames", "0"],
    "a number that is none": ["a.mcap", "--jobs", "many"],
    "an unknown preset": ["a.mcap", "--preset", "modern"],
    "an unknown selection": ["a.mcap", "--record", "some"],
    "a selection of none": ["a.mcap", "--record", "worst:0"],
    "a variant of an empty file name": ["a.mcap", "--variant", "mine="],
    "a preset as a variant twice": ["a.mcap", "--variant", "hsi", "--variant", "hsi"],
    "a variant twice": ["a.mcap", "--variant", "mine=a.toml", "--variant", "mine=b.toml"],
    "a variant of a default's name": ["a.mcap", "--variant", "filtered=a.toml"],
    "a variant of a reserved name": ["a.mcap", "--variant", "camera=a.toml"],
    "a network of an empty file name": ["a.mcap", "--net", "mine="],
    "two networks of one name": ["a.mcap", "--net", "mine=a.onnx", "--net", "mine=b.onnx"],
    "a network of a variant's name": ["a.mcap", "--variant", "hsi", "--net", "hsi=a.onnx"],
    "a time that is none": ["a.mcap", "--start", "noon"],
    "a label that is two things": ["a.mcap", "--road-label", "3", "--ignore-label", "3"],
    "a label without a value": ["a.mcap", "--label", "main"],
    "a label of nothing": ["a.mcap", "--label", "branch="],
    "a label of two lines": ["a.mcap", "--label", "branch=a\nb"],
    "a label that is too long": ["a.mcap", "--label", f"branch={'a' * 501}"],
    "a label of no name": ["a.mcap", "--label", "my branch=main"],
    "a label twice": ["a.mcap", "--label", "branch=a", "--label", "branch=b"],
    "a scale of nothing": ["a.mcap", "--scale", "0"],
    "a scale that enlarges": ["a.mcap", "--scale", "1.5"],
    "a scale that is no number": ["a.mcap", "--scale", "nan"],
    "reduced masks beside the log": ["a.mcap", "--scale", "0.5", "--mcap", "b.mcap"],
}


@pytest.mark.parametrize("words", WRONG.values(), ids=WRONG)
def test_wrong_usage_is_one_line_and_exit_code_2(words, capsys):
    assert main(["replay", *words]) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.startswith("roadeval: error: ")
    assert shown.err.count("\n") == 1


def test_a_width_without_a_unit_is_wrong_usage(capsys):
    assert main(["report", "a.rrd", "--figures", "f", "--width", "8.5"]) == 2
    assert "8.5 is no width of a figure; write it as 8.5cm" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        ("rplay", "Did you mean 'replay'? see"),
        ("--hlep", "did you mean --help? see"),
        ("replay a.mcap --out b", "did you mean --output? see"),
        ("replay a.mcap --trian-frames 3", "did you mean --train-frames? see"),
        ("replay a.mcap --preset robst", "did you mean robust? choose"),
        ("replay a.mcap --only unfilterd", "did you mean unfiltered? choose"),
        ("replay a.mcap --xyzzy", "No such option: --xyzzy; see"),
    ],
)
def test_what_is_mistyped_is_guessed_by_likeness(words, meant, capsys):
    assert main(words.split()) == 2
    assert meant in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["inspect", "a.rrd", "--frame", "1", "--worst", "2"], "give --frame or --worst, not both"),
        (
            ["inspect", "a.rrd", "--list", "--frame", "1"],
            "--list opens nothing; give it without --frame and --screenshot",
        ),
        (
            ["replay", "a.mcap", "--ignore-label", "3"],
            "--ignore-label: needs --road-label; name the values that mean road",
        ),
        (
            ["replay", "a.mcap", "--variant", "mine"],
            "--variant mine names no file: preset: there is no 'mine'; choose gated, hsi, paper, "
            "printed, printed_order, robust",
        ),
    ],
)
def test_options_that_do_not_go_together_are_told_without_calling_a_value_invalid(
    words, message, capsys
):
    assert main(words) == 2
    line = f"roadeval: error: {message}; see 'roadeval {words[0]} --help'\n"
    assert capsys.readouterr().err == line


UNREADABLE = {
    "info": ["{}"],
    "replay": ["{}"],
    "report": ["{}"],
    "inspect": ["{}"],
    "compare": ["{}", "{}"],
    "train": ["{}", "-o", "a.model"],
    "pack": ["{}", "-o", "a.mcap"],
    "config": ["--config", "{}"],
}


@pytest.mark.parametrize("command", UNREADABLE)
def test_a_file_that_may_not_be_read_is_no_wrong_usage(command, tmp_path, monkeypatch, capsys):
    file = tmp_path / "locked.mcap"
    file.write_bytes(b"nothing that any command can use")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("os.access", lambda path, mode, **how: mode != os.R_OK)
    assert main([command, *(word.format(file) for word in UNREADABLE[command])]) == 1
    assert capsys.readouterr().err.startswith("roadeval: error: ")


COMMANDS = [command.callback.__name__ for command in app.registered_commands if command.callback]
HEAVY = ["cv2", "matplotlib", "mcap", "numpy", "pandas", "pyarrow", "rerun", "sklearn"]


def test_the_list_of_commands_tells_each_in_a_line(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    main(["--help"])
    listed = capsys.readouterr().out.split("Commands:\n")[1].split("\n\n")[0].splitlines()
    assert [line.split()[0] for line in listed] == COMMANDS
    assert all(line.endswith(".") and not line.endswith("...") for line in listed)


def help_lines(command, capsys):
    assert main([command, "--help"]) == 0
    return capsys.readouterr().out.splitlines()


@pytest.mark.parametrize("command", COMMANDS)
def test_every_help_of_80_columns_begins_with_an_example_and_ends_with_exit_codes(
    command, capsys, monkeypatch
):
    monkeypatch.setenv("COLUMNS", "80")
    lines = help_lines(command, capsys)
    assert lines[0].startswith(f"Usage: roadeval {command} [OPTIONS]")
    assert lines[4].startswith(f"  roadeval {command} ")
    assert lines[-2].startswith("  Exit codes: 0 done;")
    assert max(map(len, lines)) <= 80


@pytest.mark.parametrize("command", COMMANDS)
def test_the_options_of_an_example_exist(command):
    of_command = typer.main.get_command(app).commands[command]
    for example in of_command.help.split("\n\n")[1].splitlines():
        _, _, *words = shlex.split(example.partition(" > ")[0] if command == "config" else example)
        of_command.make_context(command, words)


def test_the_first_screen_of_a_replays_help_has_what_most_people_need(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    screen = "\n".join(help_lines("replay", capsys)[:24])
    assert all(f"  {FLAGS[setting]}"[-9:] in screen for setting in FIRST)


def test_help_has_the_width_of_the_terminal(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "160")
    assert 140 < max(map(len, help_lines("replay", capsys))) <= 160
    monkeypatch.delenv("COLUMNS")
    monkeypatch.setattr("sys.__stdout__", None)
    assert max(map(len, help_lines("replay", capsys))) <= 80


def test_no_command_at_all_shows_on_one_screen_what_to_type_first_as_wrong_usage(
    capsys, monkeypatch
):
    monkeypatch.setenv("COLUMNS", "80")
    assert main([]) == 2
    shown = capsys.readouterr()
    lines = shown.err.splitlines()
    assert shown.out == ""
    assert len(lines) <= 23
    assert max(map(len, lines)) <= 80
    assert [line.split()[1] for line in lines[1:4]] == ["demo", "replay", "report"]
    assert lines[-2].startswith("Exit codes: ")


@pytest.mark.parametrize(
    ("words", "completed"),
    [
        ("roadeval rep", ["replay", "report"]),
        ("roadeval replay --labe", ["--label", "--labelled"]),
        ("roadeval replay --preset r", ["robust"]),
        ("roadeval replay ./d", []),
    ],
)
def test_a_shell_completes_commands_options_and_presets(words, completed, capsys, monkeypatch):
    monkeypatch.setenv("_ROADEVAL_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(len(words.split()) - 1))
    assert main([]) == 0
    assert capsys.readouterr().out.split() == completed


def test_completion_is_installed_for_the_current_shell(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr("shellingham.detect_shell", lambda: ("fish", "/bin/fish"))
    assert main(["--install-completion"]) == 0
    file = tmp_path / ".config/fish/completions/roadeval.fish"
    assert "_ROADEVAL_COMPLETE=complete_fish" in file.read_text()
    assert str(file) in capsys.readouterr().out


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

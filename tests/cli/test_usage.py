"""Wrong usage, which no file can change: exit code 2; help and version at once."""

import errno
import json
import os
import shlex
import signal
import subprocess
import sys
from threading import Timer
from unittest.mock import Mock

import pytest
import typer

from roadeval import RoadevalError
from roadeval.cli import signals
from roadeval.cli.app import THREADS, app, explain, main
from roadeval.cli.exit_codes import ExitCode
from roadeval.cli.options import FIRST, FLAGS
from roadeval.cli.signals import Stopped
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
    "a scale that is not a number": ["a.mcap", "--scale", "nan"],
    "reduced masks beside the log": ["a.mcap", "--scale", "0.5", "--mcap", "b.mcap"],
}


@pytest.mark.parametrize("words", WRONG.values(), ids=WRONG)
def test_wrong_usage_is_one_line_and_exit_code_2(words, capsys):
    assert main(["replay", *words]) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.startswith("roadeval: error: ")
    assert shown.err.count("\n") == 1


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
        (
            "report a.rrd --figures f --width 8.5",
            "8.5 is not a width of a figure; write it as 8.5cm",
        ),
    ],
)
def test_what_is_mistyped_is_guessed_or_told_in_its_right_form(words, meant, capsys):
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
            ["report", "a.rrd", "--width", "8.5cm"],
            "--width and --title are of --figures: give them with it",
        ),
        (
            ["report", "a.rrd", "--title", "none"],
            "--width and --title are of --figures: give them with it",
        ),
        (
            ["report", "a.rrd", "--figures", "f", "--audit", "a"],
            "--audit is of a report: give --output, too",
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
    monkeypatch.setattr("os.get_terminal_size", Mock(side_effect=OSError))
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


def test_version_goes_to_stdout_of_the_command_and_of_an_environments_python(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"roadeval {VERSION}\n"
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


# --- However a command ends: a line on stderr, its exit code; signals, and streams that are closed


def lines(capsys):
    return capsys.readouterr().err.splitlines()


@pytest.mark.parametrize(
    ("code", "name"), [(ExitCode.INTERRUPTED, "SIGINT"), (ExitCode.TERMINATED, "SIGTERM")]
)
def test_a_signal_has_its_own_exit_code_and_tells_what_is_left(code, name, capsys):
    error = Stopped(code)
    error.add_note("the partial recording is out.partial.rrd")
    assert explain(error) == 128 + getattr(signal, name)
    assert lines(capsys) == [
        "roadeval: interrupted: stopped before the end; the partial recording is out.partial.rrd"
    ]


def test_wrong_usage_points_to_the_help(capsys):
    assert explain(typer.BadParameter("'x' is not a number.")) == 2
    assert lines(capsys) == ["roadeval: error: 'x' is not a number"]
    assert main(["replay", "--no-such-option"]) == 2
    assert lines(capsys) == [
        "roadeval: error: No such option: --no-such-option; see 'roadeval replay --help'"
    ]


LITTLE = "not enough memory: take fewer --jobs, a smaller --scale, or a larger machine"
DRAFT = RoadevalError("lacks a size")
DRAFT.draft = 'file = "n.onnx"\nsize = [?, ?]'


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (
            OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "out.rrd"),
            ["No space left on device: out.rrd"],
        ),
        (MemoryError("std::bad_alloc"), [LITTLE]),
        (ImportError("failed to map segment"), [LITTLE]),
        # The draft of a file that mends an error stands below it.
        (DRAFT, ["lacks a size", "", 'file = "n.onnx"', "size = [?, ?]"]),
    ],
)
def test_what_the_system_or_a_file_lacks_is_a_known_problem(error, told, capsys):
    assert explain(error) == 1
    first, *others = lines(capsys)
    assert [first.removeprefix("roadeval: error: "), *others] == told


def test_a_defect_keeps_its_traceback_to_itself_but_for_who_asks(capsys, monkeypatch):
    assert explain(KeyError("ndi")) == 70
    (line,) = lines(capsys)
    assert line.startswith("roadeval: error: KeyError: 'ndi' (a defect of roadeval")
    assert "ROADEVAL_DEBUG=1" in line
    monkeypatch.setenv("ROADEVAL_DEBUG", "1")
    try:
        raise KeyError("ndi")
    except KeyError as error:
        explain(error)
    assert lines(capsys)[0] == "Traceback (most recent call last):"


@pytest.mark.parametrize("length", [1, 1_000_000], ids=["buffered", "written"])
def test_a_reader_of_stdout_who_has_gone_is_no_error(length, monkeypatch):
    program = (
        "import sys; from roadeval.cli import app, console\n"
        f"def talk(**_): console.emit('x' * {length})\n"
        "app.app = talk\n"
        "sys.exit(app.main([]))"
    )
    monkeypatch.delenv("PYTHONUNBUFFERED", raising=False)
    with subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as run:
        run.stdout.close()
        assert run.stderr.read() == b""
    assert run.returncode == ExitCode.BROKEN_PIPE


@pytest.mark.parametrize(("call", "ours"), [("main()", True), ("main(['--version'])", False)])
def test_cycles_are_searched_rarely_in_a_process_of_its_own_alone(call, ours):
    code = (
        "import gc, sys; sys.argv = ['roadeval', '--version']; from roadeval.cli.app import main; "
        f"before = gc.get_threshold(); {call}; "
        "print(gc.get_threshold() != before, gc.get_freeze_count() > 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == f"{ours} {ours}"


@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize(
    ("number", "code"),
    [(signal.SIGINT, ExitCode.INTERRUPTED), (signal.SIGTERM, ExitCode.TERMINATED)],
)
def test_signals_at_once_are_raised_as_one_exception_that_runs_clean_up(number, code, times):
    tidied = []

    def work():
        try:
            os.kill(os.getpid(), number)
        finally:
            tidied.append("closed")

    for place in range(1, times):
        Timer(place * signals.GRACE_S / 2, os.kill, (os.getpid(), number)).start()
    with pytest.raises(signals.Stopped) as stopped, signals.as_exceptions():
        work()
    assert stopped.value.exit_code == code
    assert tidied == ["closed"]


def test_a_later_signal_would_end_the_process_at_once():
    handlers = []

    def work():
        try:
            os.kill(os.getpid(), signal.SIGTERM)
        finally:
            handlers.extend(map(signal.getsignal, (signal.SIGINT, signal.SIGTERM)))

    with pytest.raises(signals.Stopped), signals.as_exceptions():
        work()
    assert handlers == [signal.SIG_DFL, signal.SIG_DFL]


WHILE_IT_LOADS = """
import os, signal, sys

class Interrupt:
    def find_spec(name, path, target=None):
        if name == "roadeval.cli":
            os.kill(os.getpid(), signal.SIGINT)

signal.signal(signal.SIGINT, getattr(signal, sys.argv[1]))
sys.meta_path.insert(0, Interrupt)
sys.argv[1:] = ["--version"]
from roadeval.__main__ import main
sys.exit(main())
"""


@pytest.mark.skipif(sys.platform == "win32", reason="os.kill sends no SIGINT there")
@pytest.mark.parametrize(("handler", "code"), [("default_int_handler", -2), ("SIG_IGN", 0)])
def test_an_interrupt_while_the_program_loads_shows_no_traceback(handler, code):
    done = subprocess.run(
        [sys.executable, "-c", WHILE_IT_LOADS, handler], capture_output=True, check=False
    )
    assert (done.returncode, done.stderr) == (code, b"")


SAYS = "console.emit('gr\\xf6\\xdfe \\udce9 \\x1b[2J'); messages.warning('beware')"
OTHERS = (
    "os.write(2, b'libpng error\\n'); logging.warning('cache'); warnings.warn('font', stacklevel=1)"
)


def run(talk, redirected="", **environment):
    """Run a command that only talks, in a process whose shell redirects its streams."""
    program = (
        "import json, logging, os, sys, warnings\n"
        "from roadeval.cli import app, console, messages\n"
        f"def talk(**_): {talk}\n"
        "app.app = talk\n"
        "sys.exit(app.main())"
    )
    shell = f'"$0" "$@" {redirected}'
    variables = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    return subprocess.run(
        ["/bin/sh", "-c", shell, sys.executable, "-c", program],
        env=variables | {"PYTHONPATH": os.pathsep.join(sys.path)} | environment,
        capture_output=True,
        timeout=60,
        check=False,
    )


@pytest.mark.parametrize(
    ("redirected", "reason"),
    [(">&-", "Bad file descriptor"), (">/dev/full", "No space left on device")],
)
def test_a_stdout_that_takes_nothing_is_one_line(redirected, reason):
    done = run(SAYS, redirected)
    assert done.returncode == ExitCode.FAILED
    assert done.stderr.decode().splitlines()[-1] == (
        f"roadeval: error: standard output cannot be written: {reason}"
    )


def test_what_nobody_hears_on_stderr_is_no_error_and_no_file_takes_a_closed_stream_s_place():
    for redirected in ("2>&-", "2>/dev/full"):
        done = run(SAYS, redirected)
        assert (done.returncode, done.stdout.count(b"\n")) == (0, 1)
    held = "assert os.open('/dev/null', os.O_RDONLY) > 2"
    assert run(held, "<&- >&- 2>&-").returncode == 0


def test_what_libraries_say_is_not_shown_unless_asked_for():
    assert run(OTHERS).stderr == b""
    loud = run(OTHERS, ROADEVAL_DEBUG="1").stderr
    assert all(word in loud for word in (b"libpng error", b"cache", b"font"))


def test_what_ends_the_process_is():
    crashed = run("os.abort()")
    assert crashed.returncode == 128 + signal.SIGABRT
    assert b"Abort" in crashed.stderr


def test_text_is_escaped_in_every_encoding_of_the_streams():
    assert run(SAYS).stdout.decode() == "größe \\udce9 \\u001b[2J\n"
    plain = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    done = run(SAYS, **plain)
    assert (done.returncode, done.stdout) == (0, b"gr\\u00f6\\u00dfe \\udce9 \\u001b[2J\n")
    done = run("console.emit(json.dumps('gr\\xf6\\xdfe', ensure_ascii=False))", **plain)
    assert json.loads(done.stdout) == "größe"


@pytest.mark.parametrize(
    ("environment", "threads"),
    [({}, 1), ({"OPENBLAS_NUM_THREADS": "2"}, 2), ({"OMP_NUM_THREADS": "2"}, 2)],
)
@pytest.mark.skipif(
    sys.platform != "linux" or len(os.sched_getaffinity(0)) < 2,
    reason="BLAS takes as many threads as there are cores, and Linux counts them",
)
def test_blas_starts_threads_only_where_the_user_asks_for_them(environment, threads, monkeypatch):
    for name in THREADS:
        monkeypatch.delenv(name, raising=False)
    counted = "import numpy; console.emit(str(len(os.listdir('/proc/self/task'))))"
    assert int(run(counted, **environment).stdout) == threads

"""The package declares what it imports, and nothing at import needs POSIX."""

import ast
import re
import runpy
import subprocess
import sys
import tomllib
from importlib import import_module
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

import roadeval
from tests.jobs.making import write_log
from tests.networks.making import red_network

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
DECLARED = [*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["remote"]]


def plain(name: str) -> str:
    """A distribution's name as the package index compares it."""
    return re.sub(r"[-_.]+", "-", re.match(r"[\w.-]+", name)[0]).lower()


def imported(path: Path) -> set[str]:
    """The packages that a module imports, wherever in it."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            names.add(node.module)
    return {name.partition(".")[0] for name in names}


def test_every_import_is_of_a_declared_dependency():
    distributions = packages_distributions()
    modules = set().union(*map(imported, Path(roadeval.__file__).parent.rglob("*.py")))
    others = modules - sys.stdlib_module_names - {"roadeval"}
    declared = {plain(each) for each in DECLARED}
    assert {"numpy", "rerun"} <= others
    undeclared = {
        module
        for module in others
        if not declared & {plain(each) for each in distributions.get(module, ())}
    }
    assert not undeclared


# --- The benchmarks follow the package: nothing but a person runs most of them --------------------

MODULES = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for path in sorted((ROOT / "benchmarks").rglob("*.py"))
]


@pytest.mark.parametrize("module", MODULES)
def test_a_benchmark_finds_what_it_imports(module):
    import_module(module.removesuffix(".__init__"))


@pytest.mark.sweep
def test_the_loop_is_held_against_the_floor(monkeypatch, capsys):
    words = ["--drive", str(ROOT / "recordings/demo.mcap"), "--parts", "replay", "stages"]
    words += ["--sizes", "96x72", "--frames", "12", "--repeat", "1", "--jobs", "1"]
    monkeypatch.setattr(sys, "argv", ["benchmarks", *words])
    benchmarks = import_module("benchmarks.__main__")
    monkeypatch.setattr(benchmarks, "TURNS", 1)
    benchmarks.main()
    assert "loop / floor" in capsys.readouterr().out


IMPORTS = """
import builtins, os, signal, sys
from importlib import import_module
from importlib.util import find_spec
from pkgutil import walk_packages

import roadeval

def import_all():
    for module in walk_packages(roadeval.__path__, "roadeval."):
        if module.name not in left_out:
            import_module(module.name)

left_out = set()
if find_spec("roadeval.kernels._loops") is None:
    left_out.add("roadeval.kernels.compiled")

# Other packages are made for the system that they are installed on: they come first, as they are.
import_all()
for name in [name for name in sys.modules if name.split(".")[0] == "roadeval"]:
    del sys.modules[name]

POSIX = {"fcntl", "grp", "posix", "pty", "pwd", "readline", "resource", "syslog", "termios", "tty"}
MISSING = {
    os: "fork forkpty getuid geteuid getgid getsid getpgid killpg setsid chown mkfifo nice wait "
        "waitid wait3 wait4 posix_spawn sched_getaffinity sysconf uname getloadavg WNOHANG statvfs",
    signal: "SIGALRM SIGCHLD SIGHUP SIGKILL SIGPIPE SIGQUIT SIGSTOP SIGTSTP SIGUSR1 SIGUSR2 "
        "alarm pause setitimer sigwait pthread_sigmask pthread_kill siginterrupt",
}
for module, names in MISSING.items():
    for name in names.split():
        delattr(module, name)
ordinary = builtins.__import__

def without_posix(name, scope=None, *rest):
    importer = (scope or {}).get("__name__", "")
    if name in POSIX and importer.split(".")[0] == "roadeval":
        raise ModuleNotFoundError(f"{importer} imports {name}")
    return ordinary(name, scope, *rest)

builtins.__import__ = without_posix
import roadeval
import_all()
print(sum(name.startswith("roadeval.") for name in sys.modules))
"""


def test_no_module_needs_posix_to_be_imported():
    run = subprocess.run(
        [sys.executable, "-c", IMPORTS], capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    assert int(run.stdout) > 100


@pytest.mark.sweep
def test_a_gate_needs_the_packages_of_its_list_alone(tmp_path):
    listed = (ROOT / "docs" / "gate.txt").read_text()
    generated = runpy.run_path(str(ROOT / "docs" / "generated.py"))
    assert listed == generated["gate"](), "out of date: run python docs/generated.py"
    absent = [name.removesuffix("-sdk") for name in generated["NOT_OF_A_GATE"]]
    write_log(tmp_path / "drive.mcap", numbers=range(14))
    (tmp_path / "gate.toml").write_text('output.record = "none"\noutput.figures = false\n')
    red_network(tmp_path / "road.onnx")
    script = f"""
import sys
sys.modules.update(dict.fromkeys({absent}))
from roadeval.cli.app import main
assert main(["replay", "drive.mcap", "--config", "gate.toml", "--train-frames", "2",
             "--net", "mine=road.onnx", "--reports", "new", "-q"]) == 0
assert main(["compare", "new", "new", "--fail-if", "post.mine.ERR > +1pp", "--junit", "j.xml",
             "-o", "new.md", "-q"]) == 0
assert main(["replay", "drive.mcap", "--save", "out.rrd", "-q"]) == 1
"""
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "rerun is not installed: install roadeval with all" in done.stderr


def test_a_second_run_on_an_output_needs_nothing_of_posix(monkeypatch, tmp_path):
    def run():
        config = roadeval.configure({"output": {"record": "none"}})
        return roadeval.replay(drive, config, reports=tmp_path / "reports").files

    def no_library(*_, **__):
        raise TypeError("bad argument type for built-in operation")

    drive = write_log(tmp_path / "drive.mcap", numbers=range(12))
    first = run()
    (tmp_path / "reports" / "mine.txt").write_text("stays")
    monkeypatch.delattr("os.chown")
    monkeypatch.setattr("ctypes.CDLL", no_library)
    monkeypatch.setattr("sys.platform", "win32")
    monkeypatch.setitem(sys.modules, "fcntl", None)
    assert run() == first
    assert all(path.is_file() for path in first)
    assert (tmp_path / "reports" / "mine.txt").read_text() == "stays"

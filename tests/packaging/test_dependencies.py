"""The package declares what it imports."""

import ast
import re
import sys
import tomllib
from importlib import import_module
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

import roadeval

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


def test_the_loop_is_held_against_the_floor(monkeypatch, capsys):
    words = ["--drive", str(ROOT / "recordings/demo.mcap"), "--parts", "replay", "stages"]
    words += ["--sizes", "96x72", "--frames", "12", "--repeat", "1", "--jobs", "1"]
    monkeypatch.setattr(sys, "argv", ["benchmarks", *words])
    benchmarks = import_module("benchmarks.__main__")
    monkeypatch.setattr(benchmarks, "TURNS", 1)
    benchmarks.main()
    assert "loop / floor" in capsys.readouterr().out

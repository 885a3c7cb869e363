"""Mutations of a part of the package, and which of them its tests notice.

``python -m benchmarks.mutation roadeval/geometry tests/geometry`` changes one comparison, constant,
``not`` or operator at a time, in the memory of a process that runs the tests.
"""

import argparse
import ast
import random
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from subprocess import run

SWAPPED = {ast.Lt: ast.LtE, ast.Gt: ast.GtE, ast.Eq: ast.NotEq, ast.Add: ast.Sub, ast.Mult: ast.Div}
SWAPPED |= {there: here for here, there in SWAPPED.items()}
RUN = """
import importlib.util, sys, pytest
mutated, *tests = sys.argv[1:]
text, loader = sys.stdin.buffer.read(), type(importlib.util.find_spec("ast").loader)
usual, cached = loader.get_data, importlib.util.cache_from_source(mutated)
def get_data(self, path):
    return text if path == mutated else usual(self, path if path != cached else "")
loader.get_data = get_data
sys.exit(pytest.main(["-x", "-q", "-n", "0", "-p", "no:cacheprovider", *tests]))
"""


def mutations(text: str) -> Iterator[tuple[str, str]]:
    """Yield the place of each mutation, and the mutated text."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        place = f"{getattr(node, 'lineno', 0)}: {ast.unparse(node)[:80]}"
        match node:
            case ast.Compare(ops=[operator, *others]) if type(operator) in SWAPPED:
                node.ops = [SWAPPED[type(operator)](), *others]
                yield place, ast.unparse(tree)
                node.ops = [operator, *others]
            case ast.BinOp(op=operator) if type(operator) in SWAPPED:
                node.op = SWAPPED[type(operator)]()
                yield place, ast.unparse(tree)
                node.op = operator
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                node.operand = ast.UnaryOp(ast.Not(), operand)
                yield place, ast.unparse(tree)
                node.operand = operand
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                node.value = value + 1
                yield place, ast.unparse(tree)
                node.value = value


def is_noticed(path: Path, text: str, tests: list[str]) -> bool:
    """Return whether a test fails with a mutated file; one without end fails by its time limit."""
    words = [sys.executable, "-B", "-c", RUN, str(path.resolve()), *tests]
    return bool(run(words, input=text.encode(), capture_output=True, check=False).returncode)


def main() -> None:
    """Print each mutation that no test notices, and the score."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("part", type=Path, help="a file or a folder of the package")
    parser.add_argument("tests", nargs="+", help="the tests that should notice")
    parser.add_argument("--most", type=int, default=60, help="mutations, drawn at random")
    words = parser.parse_args()
    files = sorted(words.part.rglob("*.py")) if words.part.is_dir() else [words.part]
    every = [(path, *mutation) for path in files for mutation in mutations(path.read_text())]
    assert not is_noticed(files[0], files[0].read_text(), words.tests), "they fail without any"
    drawn = random.Random(0).sample(every, min(words.most, len(every)))
    with ThreadPoolExecutor(2) as pool:
        noticed = list(pool.map(lambda it: is_noticed(it[0], it[2], words.tests), drawn))
    for (path, place, _), is_seen in zip(drawn, noticed, strict=True):
        if not is_seen:
            print(f"no test notices {path}:{place}")
    print(f"{words.part}: {sum(noticed)} of {len(drawn)} mutations noticed ({len(every)} in all)")


if __name__ == "__main__":
    main()

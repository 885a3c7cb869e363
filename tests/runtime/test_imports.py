"""Imports on demand, parts of libraries without the whole: each case in a process of its own."""

import subprocess
import sys
from importlib import import_module

import pytest

from roadeval.runtime.imports import _homes, special

LIBSVM = """
import sys
from roadeval.runtime.imports import extension
def libsvm():
    return extension(
        "sklearn.svm._libsvm", "sklearn", "sklearn.svm", "sklearn.utils", "scipy.linalg"
    )
"""
LIBRARY = """
import sklearn, sklearn.linear_model, scipy.linalg, scipy.special
assert sklearn.svm._libsvm is module, sklearn.svm._libsvm
assert sklearn.__version__ and sklearn.svm.SVC().fit([[0], [1]], [0, 1]).predict([[1]]) == [1]
assert scipy.linalg.cython_blas and scipy.linalg.inv([[2]]) == 0.5
"""
"""The whole of the library, with the module in its place."""
LEFT = "[name for name in list(sys.modules) if name.startswith(('sklearn', 'scipy.linalg'))]"


def run(code: str) -> str:
    """Return what a process of its own prints."""
    words = [sys.executable, "-c", code]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert not done.returncode, done.stderr
    return done.stdout.strip()


def test_nothing_else_remains_and_who_imports_the_library_later_gets_all_of_it():
    run(f"{LIBSVM}\nmodule = libsvm()\nassert not {LEFT}, {LEFT}\n{LIBRARY}")


def test_a_library_that_was_there_before_stays_as_it_was():
    run(
        f"import sklearn.svm, sklearn\nbefore = sklearn\n{LIBSVM}\nmodule = libsvm()\n{LIBRARY}"
        "assert before is sys.modules['sklearn']"
    )


NEEDS_MORE = """
import importlib.abc
class OnlyAfter(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == "sklearn.svm._libsvm" and "sklearn.base" not in sys.modules:
            raise ImportError("this version of it needs the rest")
sys.meta_path.insert(0, OnlyAfter())
"""


def test_where_the_module_cannot_be_had_alone_the_library_is_imported_with_it():
    run(f"{LIBSVM}{NEEDS_MORE}\nmodule = libsvm()\n{LIBRARY}")


@pytest.mark.parametrize("name", ["chdtri", "stdtr", "stdtrit"])
def test_special_functions_are_scipys_own(name):
    import scipy.special

    assert special(name) is getattr(scipy.special, name)


TOGETHER = """
import importlib.abc, threading, time
begun = threading.Event()
class Slow(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == "sklearn.svm._libsvm":
            begun.set()
            time.sleep(0.2)
sys.meta_path.insert(0, Slow())
alone = threading.Thread(target=libsvm)
alone.start()
begun.wait()
"""


def test_who_needs_all_of_the_library_waits_until_the_module_is_loaded():
    run(
        f"{LIBSVM}{TOGETHER}\nfrom roadeval.runtime.imports import whole\n"
        f"assert whole('sklearn.svm').SVC\nalone.join()\nmodule = libsvm()\n{LIBRARY}"
    )


PACKAGES = (
    "roadeval",
    *(f"roadeval.{room}" for room in ("config", "logs", "recording", "training")),
)


@pytest.mark.parametrize("name", PACKAGES)
def test_every_public_name_is_there_and_no_other(name):
    package = import_module(name)
    for each in _homes(name):
        assert getattr(package, each) is not None
    with pytest.raises(AttributeError, match=f"module '{name}' has no attribute 'nothing'"):
        package.nothing  # noqa: B018


LEFT_OUT = "import sys; from roadeval.runtime.imports import leave_out_pandas; leave_out_pandas()\n"


def test_arrays_and_recordings_import_no_pandas_which_later_converts_both_ways(tmp_path):
    code = f"""
import numpy as np, pyarrow as pa, rerun as rr
pa.array(np.arange(3)), pa.array(["a", None]), pa.scalar(1.5), pa.table({{"a": [1]}})
recording = rr.RecordingStream("test")
recording.save({str(tmp_path / "a.rrd")!r})
recording.log("a", rr.Scalars(1.0))
recording.log("b", rr.AnyValues(c="d", e=2))
print("pandas" in sys.modules)
import pandas as pd
frame = pd.DataFrame({{"a": [1.5, None], "b": ["x", None]}})
frame.to_parquet({str(tmp_path / "a.parquet")!r})
print(pd.read_parquet({str(tmp_path / "a.parquet")!r}).equals(frame))
print(pa.Table.from_pandas(frame).to_pandas().equals(frame))
"""
    assert run(LEFT_OUT + code).split() == ["False", "True", "True"]

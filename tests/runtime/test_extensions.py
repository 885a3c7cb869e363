"""Compiled modules of a library without the library: each case in a process of its own."""

import subprocess
import sys

import pytest

from roadeval.runtime.extensions import extension, special

LIBSVM = """
import sys
from roadeval.runtime.extensions import extension
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
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert not done.returncode, done.stderr
    return done.stdout.strip()


def test_neither_the_library_nor_the_empty_packages_remain():
    assert run(f"{LIBSVM}\nprint(libsvm().fit.__name__, {LEFT})") == "fit []"


def test_who_imports_the_library_later_gets_all_of_it():
    run(f"{LIBSVM}\nmodule = libsvm()\n{LIBRARY}")


def test_a_library_that_was_there_before_stays_as_it_was():
    run(
        f"import sklearn.svm, sklearn\nbefore = sklearn\n{LIBSVM}\nmodule = libsvm()\n{LIBRARY}"
        "assert before is sys.modules['sklearn']"
    )


def test_a_part_of_the_library_that_was_there_before_stays_as_it_was():
    run(
        f"import scipy.linalg as before\n{LIBSVM}\nmodule = libsvm()\n{LIBRARY}"
        "assert before is sys.modules['scipy.linalg']"
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


MEANWHILE = """
class Name(str):
    def startswith(self, _):
        sys.modules["imported_meanwhile"] = sys
        return False
sys.modules[Name("of_another_thread")] = sys
"""


def test_another_thread_may_import_something_else_meanwhile():
    assert run(f"{LIBSVM}{MEANWHILE}\nprint(libsvm().fit.__name__, {LEFT})") == "fit []"


def test_what_is_not_there_is_told():
    with pytest.raises(ModuleNotFoundError, match="no_such"):
        extension("sklearn.svm.no_such", "sklearn", "sklearn.svm")


@pytest.mark.parametrize("name", ["chdtri", "stdtr", "stdtrit"])
def test_special_functions_are_scipys_own(name):
    import scipy.special

    assert special(name) is getattr(scipy.special, name)


def test_a_special_function_that_is_not_compiled_is_found_too():
    import scipy.special

    assert special("logsumexp") is scipy.special.logsumexp


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
        f"{LIBSVM}{TOGETHER}\nfrom roadeval.runtime.extensions import whole\n"
        f"assert whole('sklearn.svm').SVC\nalone.join()\nmodule = libsvm()\n{LIBRARY}"
    )


def test_two_threads_that_need_the_module_both_get_all_of_it():
    run(f"{LIBSVM}{TOGETHER}\nassert libsvm().fit\nalone.join()")

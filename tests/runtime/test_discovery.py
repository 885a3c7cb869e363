"""Things found by the folder in which they lie, and the code of modules."""

import importlib
from collections import namedtuple
from importlib import metadata
from types import SimpleNamespace

import pytest

from roadeval.pipeline import paper
from roadeval.runtime.discovery import by_name, code_of, found_in

Thing = namedtuple("Thing", "name size")


def test_modules_without_the_name_are_passed_over():
    assert [stage.name for stage in found_in(paper, "STAGE")] == [
        *("post", "shadow", "similarity", "svm")
    ]


def test_two_of_one_name_are_refused():
    assert by_name([Thing("b", 1), Thing("a", 2)]) == {"b": Thing("b", 1), "a": Thing("a", 2)}
    with pytest.raises(ValueError, match="two files define 'a'"):
        by_name([Thing("a", 1), Thing("a", 2)])


@pytest.fixture
def modules(tmp_path, monkeypatch):
    """Returns the code of a module after some files were written where Python finds modules."""
    monkeypatch.syspath_prepend(tmp_path)

    def of(name, **files):
        for file, text in files.items():
            path = tmp_path / file.replace("__", "/").replace("_py", ".py")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        importlib.invalidate_caches()
        return code_of([name])

    return of


def test_the_code_of_a_module_is_its_file_and_those_beside_it_that_it_imports(modules):
    code = modules(
        "mine",
        mine_py="import json, helper as h\ndef road():\n    from late.deep import x\n",
        helper_py="try: import_module('named')\nexcept ImportError: import missing\n",
        named_py="",
        late__deep_py="",
        late__weights="1",
        other_py="",
    )
    assert code.files == ("helper.py", "late/deep.py", "late/weights", "mine.py", "named.py")


@pytest.mark.parametrize("file", ["mine__road_py", "mine__net__weights", "beside_py"])
def test_a_change_of_any_of_its_files_is_another_code(file, modules):
    files = {"mine__road_py": "import beside", "mine__net__weights": "1", "beside_py": "2"}
    before = modules("mine.road", **files)
    assert modules("mine.road", **files) == before
    assert modules("mine.road", **{file: "import beside # 3"}).digest != before.digest


def test_of_an_installed_package_the_version_counts(modules, monkeypatch):
    before = modules("mine", mine_py="import numpy")
    assert (before.files, before.packages) == (("mine.py",), {"numpy": metadata.version("numpy")})
    found = metadata.distribution("numpy")
    changed = SimpleNamespace(version="9", read_text=found.read_text, locate_file=found.locate_file)
    monkeypatch.setattr(metadata, "distribution", lambda name: changed)
    assert modules("mine").digest != before.digest


def test_a_module_that_is_no_file_has_no_code(modules):
    assert modules("nowhere").digest == ""

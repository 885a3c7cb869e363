"""What other installed packages add by their entry points."""

import re
import sys
from importlib import import_module
from importlib.metadata import version

import pytest

from roadeval import RoadevalError
from roadeval.evaluation import regions
from roadeval.evaluation.region import Region
from roadeval.runtime import discovery


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Install a package of one module, and one entry point; return a function that does."""
    caches = (discovery._all_points, discovery.points_of)

    def install(kind, code, value="things:THING"):
        (tmp_path / "things.py").write_text(
            f"from roadeval.evaluation.region import Region\n{code}"
        )
        about = tmp_path / "more_things-1.5.dist-info"
        about.mkdir()
        (about / "METADATA").write_text("Metadata-Version: 2.1\nName: more-things\nVersion: 1.5\n")
        (about / "entry_points.txt").write_text(f"[roadeval.{kind}]\nthing = {value}\n")
        monkeypatch.syspath_prepend(tmp_path)
        monkeypatch.delitem(sys.modules, "things", raising=False)
        for cached in caches:
            cached.cache_clear()

    yield install
    for cached in caches:
        cached.cache_clear()


REGION = 'THING = Region({"left": "left"}, order=1, find=lambda frame: frame["left"])'


def test_an_entry_point_adds_one_thing_or_several(package):
    package("regions", REGION + "\nALL = [THING, THING]", "things:ALL")
    added = discovery.installed("regions", Region, RoadevalError)
    assert [region.titles for region in added] == [{"left": "left"}] * 2
    assert discovery.installed("metrics", Region, RoadevalError) == []
    assert (
        discovery.versions_of_additions()
        == {"more-things": "1.5"}
        == {"more-things": version("more-things")}
    )


@pytest.mark.parametrize(
    ("code", "problem"),
    [
        ("import nowhere", "No module named 'nowhere'"),
        ("THING = 3", "things:THING is no Region"),
        ("class Named(Region):\n    name = 'mine'\nTHING = Named({}, 1, None)", "'mine' is taken"),
    ],
)
def test_a_package_that_cannot_be_used_is_named(package, code, problem):
    package("regions", code)
    with pytest.raises(RoadevalError, match=re.escape(problem)) as caught:
        discovery.installed("regions", Region, RoadevalError, ["mine"])
    assert caught.value.where == "the package more-things"


def test_an_error_in_a_package_is_its_own(package):
    package("regions", REGION)
    (region,) = discovery.installed("regions", Region, RoadevalError)
    with pytest.raises(KeyError) as caught:
        region.find({})
    assert discovery.failed_package(caught.value) == "more-things"
    with pytest.raises(ImportError) as caught:
        import_module("nowhere")
    assert discovery.failed_package(caught.value) == ""


def test_two_regions_of_one_name_are_an_error(monkeypatch):
    left = Region({"left": "left"}, order=1, find=lambda _: {"left": 1})
    monkeypatch.setattr(regions, "regions", lambda: (left,))
    assert regions.of_frame(None) == {"left": 1}
    monkeypatch.setattr(regions, "regions", lambda: (left, left))
    with pytest.raises(RoadevalError, match="two regions have the same name"):
        regions.of_frame(None)

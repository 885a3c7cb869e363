"""Settings and versions: what all variants share is told once."""

from roadeval.report.blocks import Details, Table
from roadeval.report.sections.provenance import flattened, section, settings_rows
from tests.report.making import plain_rows, some_findings, the


def test_settings_are_told_once_where_variants_agree_and_apart_where_they_differ():
    settings = {
        "filtered": {"preset": "paper", "svm": {"c": 1.0}, "shadow": {"threshold": "otsu"}},
        "unfiltered": {
            "preset": "paper",
            "svm": {"c": 2.0, "gamma": None},
            "chain": ["svm", "post"],
        },
    }
    assert settings_rows(settings) == [
        ["preset", "paper"],
        ["svm.c", "filtered: 1.0; unfiltered: 2.0"],
        ["shadow.threshold", "otsu (filtered only)"],
        ["svm.gamma", "none (unfiltered only)"],
        ["chain", "svm, post (unfiltered only)"],
    ]


def test_a_list_of_tables_is_told_setting_by_setting():
    told = dict(
        flattened({"nets": [{"name": "a", "size": [4, 3]}, {"name": "b"}], "seeds": [1, 2]})
    )
    assert told == {"nets.0.name": "a", "nets.0.size": "4, 3", "nets.1.name": "b", "seeds": "1, 2"}


def test_seconds_are_told_in_milliseconds_beside_the_versions():
    seconds = {"filtered": {"svm": 0.0123}}
    hidden = the(Details, section(some_findings(versions={"numpy": "2.0"}, seconds=seconds)))
    assert not hidden.on_paper
    versions, milliseconds = (block for block in hidden.blocks if isinstance(block, Table))
    assert plain_rows(versions) == [["numpy", "2.0"]]
    assert plain_rows(milliseconds) == [["filtered", "svm", "12.30"]]

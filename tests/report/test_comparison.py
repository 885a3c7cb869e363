"""A comparison for people: Markdown for a pull request, and a document."""

import pandas as pd
import pytest

from roadeval.report.blocks import BulletList, Table
from roadeval.report.comparison import document, headline, markdown
from roadeval.report.pdf.typeset import pdf
from roadeval.report.words import MINUS
from tests.report.making import text


def told(mean, low=None, high=None):
    return {"mean": mean, "low": low, "high": high, "reason": "12 frames, and it needs 40"}


def a_content(**changes):
    rates = {"ERR": 0.10, "FPR": 0.20, "FNR": 0.30, "IoU": 0.8}
    change = {
        "result": "new|er",
        "variant": "filtered",
        "stage": "post",
        "final": True,
        "frames": 12,
        "base": rates,
        "new": rates | {"ERR": 0.112, "FPR": 0.21, "FNR": 0.28},
        "difference": {rate: told(0.012, 0.005, 0.02) for rate in ("ERR", "FPR", "FNR")},
    }
    moved = {"frame": 7, "stamp_ns": 0, "base": 0.1, "new": 0.4, "change": 0.3}
    plain = {
        "same_drive": True,
        "results": [
            {"label": label, "drive": "street", "sha256": "d", "frames": 12}
            for label in ("base", "new|er")
        ],
        "changes": [change],
        "moved": [{"result": "new|er", "variant": "filtered", **moved}],
        "warnings": ["mind the <gap>"],
        "conditions": [
            {"text": "c", "holds": True, "sentence": "ERR rose too much"},
            {"text": "d", "holds": False, "sentence": "FPR kept its limit"},
        ],
    }
    return plain | changes


def windows():
    rates = {"ERR": 0.1, "FPR": 0.1, "FNR": 0.1}
    place = {"window": 0, "first_frame": 0, "last_frame": 9, "frames": 10, "stage": "post"}
    return pd.DataFrame([{**place, "variant": name, **rates} for name in ("base", "new|er")])


def test_the_headline_says_how_much_and_how_sure():
    assert headline(a_content()) == "Against base: new|er, filtered: ERR +1.20 pp (+0.50 to +2.00)."


@pytest.mark.parametrize(
    ("difference", "ending"),
    [
        (told(0.012), "ERR +1.20 pp (no interval)."),
        (told(0.0, 0.0, 0.0), "ERR the same on every frame."),
        (told(None), "ERR undefined."),
    ],
)
def test_the_headline_admits_what_is_not_known(difference, ending):
    content = a_content()
    content["changes"][0]["difference"]["ERR"] = difference
    assert headline(content).endswith(ending)


def test_markdown_tells_failures_first_and_keeps_names_from_breaking_the_table():
    lines = markdown(a_content()).splitlines()
    assert "- **FAIL**: ERR rose too much" in lines
    assert (
        "| new\\|er | filtered | post | 10.00 | 11.20 | +1.20 | +0.50 to +2.00 | +1.00 "
        f"| {MINUS}2.00 |"
    ) in lines
    assert "| new\\|er | filtered | 7 | 0.000 s | 10.00 | 40.00 | +30.00 |" in lines
    assert "| --- | --- | ---: | --- | ---: | ---: | ---: |" in lines
    assert "- mind the \\<gap\\>" in lines


def test_the_document_has_the_numbers_and_the_frames():
    words = text(pdf(document(a_content(), windows())))
    for wanted in ("Limits exceeded", "ERR rose too much", "+1.20", "mind the <gap>", "new|er"):
        assert wanted in words


def test_limits_that_are_exceeded_and_kept_are_told_apart():
    lists = [b for b in document(a_content(), windows()).blocks if isinstance(b, BulletList)]
    assert [(each.title, list(each.items)) for each in lists[:2]] == [
        ("Limits exceeded", ["ERR rose too much"]),
        ("Limits kept", ["FPR kept its limit"]),
    ]


def test_a_rule_stands_where_another_result_begins_and_its_name_only_where_it_is_needed():
    content = a_content()
    (change,) = content["changes"]
    content["changes"] = [change, change | {"stage": "svm"}, change | {"result": "newest"}]
    table = next(b for b in document(content, windows()).blocks if isinstance(b, Table))
    assert table.breaks == [2]
    assert table.columns[:3] == ["result", "variant", "stage"]
    content["changes"] = [change | {"result": "filtered"}]
    table = next(b for b in document(content, windows()).blocks if isinstance(b, Table))
    assert table.columns[:2] == ["variant", "stage"]


def test_different_drives_are_laid_side_by_side():
    content = a_content(same_drive=False, moved=[], conditions=[])
    content["changes"][0] |= {"base": {}, "difference": {}}
    words = text(pdf(document(content, pd.DataFrame())))
    assert "Different drives, side by side: no difference is given." in words
    assert "11.20" in words

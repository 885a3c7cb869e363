"""JSON and TOML from anybody: what would take minutes or gigabytes is refused in a sentence."""

import json
import time

import pytest

from roadeval.runtime.documents import LONGEST, read_bounded, read_json, read_toml, read_yaml

BIG = "x" * (LONGEST + 1)
MANY = "y" * 1_001


@pytest.mark.parametrize(
    ("document", "reason"),
    [
        ({"verdict": BIG}, "a text of 12,001 letters, and at most 12,000 are read"),
        ({"a": [{BIG: 1}]}, "a text of 12,001 letters"),
        ({str(n): MANY for n in range(500)}, "its long texts have more than 500,000 letters"),
        ([0] * 101, "more than 100 values"),
        ([[[0] * 40] * 2] * 2, "more than 100 values"),
    ],
)
def test_json_that_holds_too_much_is_refused(document, reason):
    with pytest.raises(ValueError, match=reason):
        read_json(json.dumps(document), 100 if "values" in reason else 10_000)


@pytest.mark.parametrize(
    "deep", ["[" * 100_000, "[" * 40 + "]" * 40, '{"a":' * 40 + "1" + "}" * 40]
)
def test_json_that_nests_too_deep_is_refused(deep):
    with pytest.raises(ValueError, match="nests more than 32"):
        read_json(deep)


def test_what_is_written_is_read():
    document = {"a": "x" * LONGEST, "b": ["w" * 1_000] * 900, "c": [1.5, None, True], "d\n": {}}
    assert read_json(json.dumps(document)) == document
    assert read_json(json.dumps(document).encode()) == document


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("a = " + "[" * 1_000 + "]" * 1_000, "nests more than 32"),
        ("a = " + "[" * 40 + "]" * 40, "nests more than 32"),
        ("a = " + "{b = " * 400 + "1" + "}" * 400, "nests more than 32"),
        (".".join("a" * 50) + " = 1", "nests more than 32"),
        ("x." * 20_000 + "y = 1", "a name in it has more than 2,000 parts"),
        ("[" + "x." * 1_500 + "y]\n" + "[" + "x." * 1_500 + "z]", "or several have so many"),
        ("a = " + "9" * 5_000, "thousands of digits"),
        ("# " + "x" * (1 << 20), "bytes, and at most 1,048,576 are read"),
        ("a = [1", "Unclosed array"),
        (f"a = '{BIG}'", "a text of 12,001 letters"),
    ],
)
def test_toml_that_holds_too_much_is_refused_at_once(text, reason):
    begun = time.process_time()
    with pytest.raises(ValueError, match=reason):
        read_toml(text)
    assert time.process_time() - begun < 2


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("9" * 5_000, "a number in it has thousands of digits"),
        ('{"a": [1,', r"it is no JSON, or ends early \(line 1, column 10\)"),
        (b'"\xff"', "it is not in UTF-8"),
    ],
)
def test_json_that_is_damaged_is_told_in_plain_words(text, reason):
    with pytest.raises(ValueError, match=f"^{reason}$"):
        read_json(text)


def test_a_document_is_a_file_that_ends(tmp_path):
    (tmp_path / "large").write_bytes(bytes(65 << 20))
    with pytest.raises(ValueError, match="at most 67,108,864 are read"):
        read_bounded(tmp_path / "large")
    with pytest.raises(OSError, match="is a folder"):
        read_bounded(tmp_path)


@pytest.mark.parametrize("text", ["!!timestamp noon", '!!int ""', "!!bool maybe", "a: [1"])
def test_yaml_whose_values_are_not_of_their_tags_is_damaged(tmp_path, text):
    (tmp_path / "camera.yaml").write_text(text)
    with pytest.raises(ValueError, match="it is damaged"):
        read_yaml(tmp_path / "camera.yaml")

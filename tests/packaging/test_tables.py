"""The numbers in the documents are those that were measured."""

import re

import pytest

from benchmarks.tables import __main__ as script
from benchmarks.tables import overlap
from benchmarks.tables.drives import DRIVES
from benchmarks.tables.measure import REPLAYS, SEEDS
from benchmarks.tables.text import DOCUMENTS, between_marks, faults, load, loose

TEXTS = [path.read_text() for path in DOCUMENTS]


@pytest.fixture
def arguments(monkeypatch):
    """Call the script with some arguments."""

    def call(*given):
        monkeypatch.setattr("sys.argv", ["tables", *given])
        return script.main()

    return call


def test_all_texts_say_what_was_measured(arguments, capsys):
    assert arguments() == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("text", TEXTS, ids=[path.name for path in DOCUMENTS])
def test_a_changed_number_in_any_table_is_found(text):
    numbers = load()
    names = re.findall(r"^<!-- table (\w+)", text, re.MULTILINE)
    assert names
    for name in names:
        block = between_marks(name, numbers)
        digit = max(re.finditer(r"\d", block.rpartition("\nMade by")[0]), key=lambda m: m.start())
        other = str((int(digit[0]) + 1) % 10)
        wrong = block[: digit.start()] + other + block[digit.end() :]
        (fault,) = faults(text.replace(block, wrong), numbers)
        assert fault.startswith(f"table {name}: not what numbers.json gives")


def test_the_numbers_follow_the_measurement(arguments, capsys, tmp_path, monkeypatch):
    numbers = load()
    numbers["idd"]["blind"]["ERR"] += 0.01
    monkeypatch.setattr(script, "load", lambda: numbers)
    assert arguments() == 1
    told = capsys.readouterr().err
    assert "presets.md: table drives: not what numbers.json gives; run with --write" in told
    assert "README.md: table findings: not what numbers.json gives; run with --write" in told
    assert "PRESETS.md: table idd: not what numbers.json gives; run with --write" in told


@pytest.mark.parametrize(
    "number", ["5.3 %", "+10.7 pp", "12 ms", "4 points", "565 MiB", "1.35", "-0.6"]
)
def test_a_measured_number_in_a_sentence_is_found(number):
    assert loose(f"ERR is {number} there.")
    (fault,) = faults(f"ERR is {number} there.", load())
    assert "a measured number outside a table" in fault


def test_every_drive_has_every_replay_with_every_seed():
    numbers = load()
    assert numbers["seeds"] == SEEDS
    for key, replay in REPLAYS.items():
        for name in replay.drives:
            found = numbers["drives"][name][key]
            assert found["seeds"] == [*range(replay.seeds)], (name, key)
            assert all(len(each["ERR"]) == replay.seeds for each in found["variants"].values())
    assert {*numbers["drives"]} == {*DRIVES}


@pytest.fixture(scope="module")
def demo():
    """Numbers of two frames and their pixels; some trees are enough to be counted."""
    few = {"frames": {"max_frames": 5}, "training": {"frames": 3}}
    return overlap.replay_demo(**few, trees={"trees": 15})


def test_libraries_of_others_compute_the_overlap_numbers_that_are_printed(demo):
    """`compare_libraries` refuses two values that are not equal."""
    found = overlap.compare_libraries(*demo)
    assert found["evaluated"] == 2
    assert {*found["values"]} == {*load()["overlap"]["values"]}


def test_a_library_that_computes_another_number_is_told(demo, monkeypatch):
    wrong = overlap.NUMBERS[0]._replace(again=lambda _: 0.5)
    monkeypatch.setattr(overlap, "NUMBERS", (wrong,))
    with pytest.raises(overlap.DifferentNumberError, match=r"0\.5 by a library"):
        overlap.compare_libraries(*demo)

"""The numbers in the documents are those that were measured."""

import re

import cv2
import numpy as np
import pytest

import roadeval
from benchmarks.tables import idd
from benchmarks.tables.__main__ import main
from benchmarks.tables.drives import DRIVES, Sources, packed
from benchmarks.tables.measure import REPLAYS, SEEDS, kept, rounded
from benchmarks.tables.text import DOCUMENTS, END, between_marks, faults, load, loose, written

TEXTS = [path.read_text() for path in DOCUMENTS]
MARK = "<!-- table order: the command -->"
UNLABELLED = [0, 0, 0, 0, 0, 0]
BLIND = np.array([[5, 3, 1, 1, 4, 2], [2, 2, 3, 3, 4, 2], UNLABELLED])
UNFILTERED = np.array([[5, 3, 2, 0, 4, 1], [4, 4, 1, 1, 4, 1], UNLABELLED])


@pytest.fixture
def arguments(monkeypatch):
    """Call the script with some arguments."""

    def call(*given):
        monkeypatch.setattr("sys.argv", ["tables", *given])
        return main()

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
    monkeypatch.setattr("benchmarks.tables.__main__.load", lambda: numbers)
    assert arguments() == 1
    told = capsys.readouterr().err
    assert "presets.md: table drives: not what numbers.json gives; run with --write" in told
    assert "README.md: table findings: not what numbers.json gives; run with --write" in told
    assert "PRESETS.md: table idd: not what numbers.json gives; run with --write" in told


def test_another_version_of_roadeval_alone_changes_nothing():
    numbers = load() | {"roadeval": "99.0"}
    assert [fault for text in TEXTS for fault in faults(text, numbers)] == []


def test_a_table_is_written_with_its_command():
    text = written(f"before\n{MARK}\nold\n{END}\nafter\n", load())
    assert [*faults(text, load())] == []
    assert "old" not in text
    assert text.startswith("before\n<!-- table order: roadeval replay DRIVE --variant printed_")
    assert "\nMade by `roadeval replay DRIVE --variant printed_" in text
    assert text.endswith(f"\n{END}\nafter\n")


def test_a_table_without_an_end_or_of_an_unknown_name_is_told():
    (fault,) = faults(f"{MARK}\n| 1 |\n", load())
    assert fault == f"1 tables begin, and 0 are whole: each ends with a line {END}"
    (fault,) = faults(f"<!-- table nothing: x -->\n| 1 |\n{END}\n", load())
    assert fault.startswith("table nothing: unknown, one of findings, ")


@pytest.mark.parametrize(
    "number", ["5.3 %", "+10.7 pp", "12 ms", "4 points", "565 MiB", "1.35", "-0.6"]
)
def test_a_measured_number_in_a_sentence_is_found(number):
    assert loose(f"ERR is {number} there.")
    (fault,) = faults(f"ERR is {number} there.", load())
    assert "a measured number outside a table" in fault


@pytest.mark.parametrize(
    "text", ["0 road, 255 ignored", "`--scale 0.5`", "```sh\nx > 20%\n```\n", "Python 3.11"]
)
def test_what_is_no_measured_number_is_left_alone(text):
    assert loose(text) == []


def test_a_journey_is_packed_from_all_parts_between_both_ends(tmp_path):
    for part, numbers in (("train", [10, 40]), ("val", [20]), ("test", [30])):
        for folder in (part, f"{part}annot"):
            (tmp_path / folder).mkdir()
            for number in numbers:
                name = tmp_path / folder / f"Seq05VD_f{number:05}.png"
                cv2.imwrite(str(name), np.full((4, 4), 3, np.uint8))
    sources = Sources(tmp_path, None, tmp_path, None)
    log = packed("Seq05VD", 20, 30)(sources, "some")
    assert [topic.count for topic in roadeval.info(log).topics] == [2, 2]


def test_a_folder_that_was_not_named_is_asked_for(arguments):
    with pytest.raises(SystemExit, match=r"idd: name .* \(--idd\)"):
        arguments("--measure", "idd")
    with pytest.raises(SystemExit, match=r"0001TP: name .* \(--camvid\)"):
        arguments("--measure", "camvid_0001TP", "--replays", "paper")


def test_every_drive_has_every_replay_with_every_seed():
    numbers = load()
    assert numbers["seeds"] == SEEDS
    for key, replay in REPLAYS.items():
        for name in replay.drives:
            found = numbers["drives"][name][key]
            assert found["seeds"] == [*range(replay.seeds)], (name, key)
            assert all(len(each["ERR"]) == replay.seeds for each in found["variants"].values())
    assert {*numbers["drives"]} == {*DRIVES}


def test_of_a_summary_the_final_masks_are_kept():
    change = {"mean": 0.1, "low": 0.0, "high": 0.2, "p": 0.04, "p_holm": 0.08, "comparisons": 2}
    changes = {rate: change | {"units": 20} for rate in ("ERR", "FPR", "FNR")}
    errs = {rate: [0.3, 0.4] for rate in ("ERR", "FPR", "FNR")}
    wrong = {"post": dict.fromkeys(("ERR", "FPR", "FNR"), 0.2)}
    found = kept(
        {
            "frames": {"evaluated": 20},
            "seeds": {
                "seeds": [0, 1],
                "totals": {"filtered": {"svm": {}, "post": errs}},
                "difference": {"post": errs},
            },
            "totals": {"blind": wrong},
            "beyond": {"filtered": {"flicker": 0.011111111, "truth_flicker": 0.02}},
            "against_blind": {"filtered": changes},
            "difference": {"post": changes},
            "claims": {"filter_ERR": {"held": 1}},
        }
    )
    assert found["variants"]["filtered"] == errs | {"flicker": 0.0111111}
    assert found["filter"]["ERR"]["seeds"] == [0.3, 0.4]
    assert found["against_blind"]["filtered"]["p_holm"] == 0.08
    assert found["blind"]["ERR"] == 0.2
    assert found["truth_flicker"] == 0.02


def test_kept_numbers_have_six_digits():
    assert rounded({"a": [1 / 3, 7, None]}) == {"a": [0.333333, 7, None]}


def test_a_drive_of_idd_without_a_defined_err_does_not_count():
    with np.errstate(all="raise"):
        assert idd.not_below(UNFILTERED, BLIND) == 1


def test_rates_of_idd_are_of_all_pixels_together():
    blind, base = BLIND[:2], [UNFILTERED[:2]]
    found = idd.told([blind], blind, {"unfiltered": base})
    assert found["ERR"] == [0.4]
    assert found["dark_missed"] == [0.5]
    assert found["against_blind"]["mean"] == 0
    assert found["against_unfiltered"]["seeds"] == pytest.approx([0.2])
    assert "against_unfiltered" not in idd.told(base, blind, {"unfiltered": base})

"""A comparison of two fleets on one screen."""

import io

from rich.console import Console

from roadeval.cli.screens.compare_fleets import NAMED, show


def a_change(variant, stage, *, final, p_holm=None):
    told = {"mean": 0.012, "low": 0.01, "high": 0.02, "confidence": 0.95}
    rates = {"ERR": 0.1, "FPR": 0.2, "FNR": 0.3}
    new = {name: value + 0.012 for name, value in rates.items()}
    names = {"variant": variant, "stage": stage, "final": final, "p_holm": p_holm}
    difference = dict.fromkeys(rates, told)
    comparisons = 1 if p_holm else None
    return {**names, "comparisons": comparisons, "base": rates, "new": new} | {
        "difference": difference
    }


def a_drive(place, q=0.0001):
    interval = {"mean": -0.01, "low": -0.02, "high": -0.005}
    about = {"name": f"drive {place}", "variant": "filtered", "base": 0.2, "new": 0.19}
    return {**about, **interval, "q": q, "changed": q < 0.05}


def shown(changes=(), drives=(), width=80):
    out = Console(file=io.StringIO(), width=width)
    content = {
        "fleets": [{"label": "old"}, {"label": "new"}],
        "drives": 7,
        "changes": changes,
        "drive_changes": drives,
        "false_discovery_rate": 0.05,
        "verdict": "It is worse.",
        "conditions": [{"holds": False, "sentence": "kept"}, {"holds": True, "sentence": "held"}],
    }
    show(content, out)
    return out.file.getvalue().splitlines()


def test_final_masks_have_all_rates_and_other_stages_err_alone():
    changes = [a_change("filtered", "svm", final=False), a_change("filtered", "post", final=True)]
    rows = [line.split() for line in shown(changes) if " 11.20 " in line or "ERR" in line]
    assert rows[0][:4] == ["filtered", "svm", "ERR", "10.00"]
    assert rows[1][:5] == ["post", "ERR", "10.00", "11.20", "+1.20"]
    assert sum("svm" in line for line in shown(changes)) == 1
    assert any(line.split()[:2] == ["FNR", "30.00"] for line in shown(changes))


def test_only_err_is_marked_and_the_mark_explained():
    lines = shown([a_change("filtered", "post", final=True, p_holm=0.01)])
    assert sum(line.rstrip().endswith("*") for line in lines) == 1
    assert any("leaves out 0; it is the only one" in line for line in lines)


def test_the_first_drives_that_changed_are_named_and_the_others_counted():
    drives = [a_drive(place) for place in range(NAMED + 2)] + [a_drive(99, q=0.4)]
    text = "\n".join(shown(drives=drives))
    assert f"changed on {NAMED + 2} of {NAMED + 3} drives (worse on 0" in text
    assert "<0.001" in text
    assert f"drive {NAMED - 1} " in text
    assert f"drive {NAMED} " not in text
    assert "and 2 more" in text


def test_conditions_that_are_kept_are_told_and_those_that_hold_are_left_to_the_errors():
    lines = shown()
    assert "kept" in lines
    assert "held" not in lines
    assert lines[0] == "new against old: 7 drives scored in both"

"""A comparison on one screen."""

import io

from rich.console import Console

from roadeval.cli.screens import compare as changes


def row(result, variant):
    """A final mask's change, without an interval."""
    unsure = {
        "mean": 0.01,
        "low": None,
        "high": None,
        "frames": 4,
        "confidence": 0.95,
        "p_holm": None,
    }
    rates = {"ERR": 0.1, "FPR": 0.1, "FNR": 0.1}
    names = {"result": result, "variant": variant, "stage": "post", "final": True, "frames": 4}
    return {**names, "base": rates, "new": rates, "difference": dict.fromkeys(rates, unsure)}


def shown(rows):
    out = Console(file=io.StringIO(), width=80)
    results = [{"label": "base"}]
    content = {"results": results, "changes": rows, "same_drive": True, "conditions": []}
    content["where"] = ["new by region: worse in shadow"]
    content["verdict"] = "Against base: it is worse."
    changes.show(content, out)
    return out.file.getvalue()


def test_each_result_has_a_table_even_where_one_is_called_like_a_variant():
    told = shown([row("filtered", "filtered"), row("new", "filtered")])
    assert "filtered against base" in told
    assert "new against base" in told


def test_the_variants_of_a_single_result_stand_together():
    told = shown([row("filtered", "filtered"), row("wide", "wide")])
    assert told.count("against base") == 1
    assert told.count("no interval: 4 frames are too few") == 2


def test_the_screen_ends_with_the_verdict_and_where_it_holds():
    told = shown([row("new", "filtered")])
    assert told.endswith("\n\nAgainst base: it is worse.\nnew by region: worse in shadow\n")


def test_final_masks_have_every_rate_and_others_err():
    before = row("new", "filtered") | {"stage": "svm", "final": False}
    told = shown([before, row("new", "filtered")])
    lines = [line.split()[:3] for line in told.splitlines() if " 10.00 " in line]
    assert lines == [
        ["filtered", "svm", "ERR"],
        ["post", "ERR", "10.00"],
        ["FPR", "10.00", "10.00"],
        ["FNR", "10.00", "10.00"],
    ]

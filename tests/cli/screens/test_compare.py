"""A comparison on one screen."""

import io

from rich.console import Console

from roadeval.cli.screens import compare as changes


def row(result, variant):
    """A final mask's change, without an interval."""
    unsure = {"mean": 0.01, "low": None, "high": None, "reason": "there are 4 frames"}
    rates = {"ERR": 0.1, "FPR": 0.1, "FNR": 0.1}
    names = {"result": result, "variant": variant, "stage": "post", "final": True, "frames": 4}
    return {**names, "base": rates, "new": rates, "difference": {"ERR": unsure}}


def shown(rows):
    out = Console(file=io.StringIO(), width=80)
    results = [{"label": "base"}]
    content = {"results": results, "changes": rows, "same_drive": True, "conditions": []}
    changes.show(content, out)
    return out.file.getvalue()


def test_each_result_has_a_table_even_where_one_is_called_like_a_variant():
    told = shown([row("filtered", "filtered"), row("new", "filtered")])
    assert "filtered against base" in told
    assert "new against base" in told


def test_the_variants_of_a_single_result_stand_together():
    told = shown([row("filtered", "filtered"), row("wide", "wide")])
    assert told.count("against base") == 1
    assert told.count("no interval, there are 4 frames") == 2

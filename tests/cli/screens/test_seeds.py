"""What other seeds come to, on a screen of 80 columns."""

from tests.cli.screens.test_replay import by_rate, difference, lines, screen, summary


def rates(*errors):
    """A final mask's rates with each seed; all but ERR are undefined."""
    names = ("ACC", "ERR", "FNR", "FPR", "pooled_ERR")
    return {"post": dict.fromkeys(names, [None] * len(errors)) | {"ERR": [*errors]}}


SEEDS = {
    "seeds": [0, 1, 2],
    "totals": {"filtered": rates(0.0912, 0.1, 0.12), "unfiltered": rates(0.0847, 0.08, 0.083)},
    "difference": {"post": {"ERR": [0.0065, 0.02, 0.037]}},
}
SURE = {"post": by_rate(difference(0.0065, 0.001, 0.012, 0.02))}


def test_every_variant_s_final_mask_has_a_row_with_the_middle_and_both_ends():
    shown = screen(summary(seeds=SEEDS))
    assert "Percent, with seeds 0 to 2 of the training: the middle" in shown
    (filtered,) = (line for line in lines(summary(seeds=SEEDS)) if "10.00 (9.12" in line)
    assert filtered.split()[:5] == ["filtered", "10.00", "(9.12", "to", "12.00)"]
    assert "unfiltered 8.30 (8.00 to 8.47)" in " ".join(shown.split())
    assert "filtered - unfiltered, pp +2.00 (+0.65 to +3.70)" in " ".join(shown.split())
    assert "All else is of seed 0." in " ".join(shown.split())
    assert shown.isascii() or not (set(shown) - set("─")) & set("–−")  # noqa: RUF001
    assert max(map(len, shown.partition("\nnext ")[0].splitlines())) <= 80


def test_without_further_seeds_not_a_word_is_said_of_them():
    assert "seed" not in screen(summary(difference=SURE))

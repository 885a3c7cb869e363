"""The paper's claims, on windows written by hand."""

from roadeval.evaluation.score import CLAIMS, Window, evidence
from roadeval.results.sentences import CLAIMED

NAN = float("nan")


def counted(held: int, windows: int, short_held: int, short: int) -> dict[str, int]:
    return {"held": held, "windows": windows, "short_held": short_held, "short": short}


def windows(variant: str, stage: str, errs: list[float], frames: list[int]) -> list[Window]:
    """Windows of a mask: the same value for every rate."""
    return [
        Window(number, 0, 0, count, variant, stage, dict.fromkeys(("ERR", "FPR", "FNR"), err), {})
        for number, (err, count) in enumerate(zip(errs, frames, strict=True))
    ]


def test_full_windows_and_shorter_ones_are_counted_apart() -> None:
    frames = [10, 10, 10, 3]
    found = evidence(
        windows("filtered", "post", [0.1, 0.3, 0.1, 0.1], frames)
        + windows("unfiltered", "post", [0.2, 0.2, 0.2, 0.2], frames),
        size=10,
    )
    assert found["filter_ERR"] == counted(2, 3, 1, 1)


def test_equal_rates_do_not_bear_a_claim_out() -> None:
    with_filter = windows("filtered", "post", [0.2], [10])
    without = windows("unfiltered", "post", [0.2], [10])
    assert evidence(with_filter + without, 10)["filter_FPR"] == counted(0, 1, 0, 0)


def test_a_window_where_a_rate_is_undefined_is_in_no_count() -> None:
    found = evidence(
        windows("filtered", "post", [0.1, NAN], [10, 10])
        + windows("unfiltered", "post", [0.2, 0.2], [10, 10]),
        size=10,
    )
    assert found["filter_FNR"] == counted(1, 1, 0, 0)


def test_stages_are_held_against_those_before_them() -> None:
    found = evidence(
        windows("filtered", "similarity", [0.3], [10])
        + windows("filtered", "svm", [0.2], [10])
        + windows("filtered", "post", [0.25], [10]),
        size=10,
    )
    assert found == {"svm_ERR": counted(1, 1, 0, 0), "post_ERR": counted(0, 1, 0, 0)}


def test_every_claim_has_words() -> None:
    assert [*CLAIMS] == [*CLAIMED]

"""The paper's claims in words, and in how many windows of a drive each is borne out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

WORDS: Final[Mapping[str, str]] = {
    "filter_ERR": "ERR is lower with the filter (section 5, figure 3a)",
    "filter_FPR": "FPR is lower with the filter (section 5, figure 3b)",
    "filter_FNR": "FNR is lower with the filter (section 5, figure 3b)",
    "svm_ERR": "ERR of the SVM is lower than that of the colour distance (section 4.3)",
    "post_ERR": "ERR after post-processing is lower than after the SVM (section 4.4)",
}
"""By the names of `roadeval.evaluation.score.CLAIMS`; the last two are of the filtered variant."""
NO_NUMBERS: Final = (
    "The paper's text gives no number for its figures 3a and 3b, and their curves are lost, so "
    "nothing can be held against it number by number. Its claims can be checked."
)


def claim_rows(claims: Mapping[str, Mapping[str, int]]) -> Iterator[tuple[str, str, str]]:
    """Yield each claim in words, and its full and its shorter windows that bear it out.

    Parameters
    ----------
    claims
        As ``claims`` in ``summary.json``.

    Examples
    --------
    >>> found = {"filter_ERR": {"held": 2, "windows": 9, "short_held": 0, "short": 1}}
    >>> list(claim_rows(found))
    [('ERR is lower with the filter (section 5, figure 3a)', '2 of 9', '0 of 1')]
    """
    for name, words in WORDS.items():
        if found := claims.get(name):
            full = f"{found['held']} of {found['windows']}"
            yield words, full, f"{found['short_held']} of {found['short']}"

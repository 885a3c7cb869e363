"""The presets, as overrides of the settings' own defaults."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

PAPER_CHAIN: Final = ("shadow", "similarity", "svm", "post")

PRESETS: Final[Mapping[str, Mapping[str, Any]]] = {
    "paper": {"chain": PAPER_CHAIN},
    "printed": {
        "chain": PAPER_CHAIN,
        "shadow": {
            "threshold": "printed",
            "inclusive": True,
            "statistic": "printed",
            "colour_space": "hsi",
        },
        "svm": {"kernel": "linear"},
        "post": {"operations": ("close", "open")},
    },
    "printed_order": {"chain": PAPER_CHAIN, "post": {"operations": ("close", "open")}},
    "hsi": {"chain": PAPER_CHAIN, "shadow": {"colour_space": "hsi"}},
    "gated": {"chain": ("gated", "similarity", "svm", "post")},
    "robust": {
        "chain": ("exposure", "trees", "post"),
        "training": {"pixels_per_class": 1000, "max_pixels": 50_000},
        "post": {"region": "all"},
    },
}
"""By name, each in the shape of a TOML file (see `roadeval.config.toml`).

``printed_order`` and ``hsi`` are ``paper`` with one thing as the text has it: the order of
post-processing (section 4.4), and the colour space of the compensation (section 4.2, step 5). They
show beside it, as variants, what that thing does.

``robust`` keeps every region of its mask: vehicles cut a road in pieces.
"""

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
    "gated": {"chain": ("gated", "similarity", "svm", "post")},
    "robust": {
        "chain": ("exposure", "similarity", "context", "post"),
        "training": {"pixels_per_class": 800, "max_pixels": 20_000},
    },
}
"""By name, each in the shape of a TOML file (see `roadeval.config.toml`)."""

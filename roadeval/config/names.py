"""Names of variants: those that results can hold."""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

from roadeval.config.errors import ConfigError
from roadeval.config.override import either
from roadeval.data import RESERVED, is_plain

LONGEST: Final = 64
"""Letters of a variant's name: it is printed in the columns of tables."""


def check_variant_name(name: str, taken: Collection[str]) -> None:
    """Refuse, as a `ConfigError`, a variant's name that results cannot hold, or that is taken.

    A spreadsheet takes a cell that begins with ``-`` for a formula, and Matplotlib leaves what
    begins with ``_`` out of a legend.
    """
    if not is_plain(name) or name[0] in "-_" or len(name) > LONGEST:
        shown = name if len(name) <= LONGEST else f"{name[:LONGEST]}..."
        raise ConfigError(
            f"variant {shown!r}: a name is made of letters, digits, '-' and '_' alone, begins with "
            f"a letter or a digit, and has at most {LONGEST} of them"
        )
    if name in RESERVED:
        raise ConfigError(f"variant {name!r}: the name is reserved ({either(RESERVED)})")
    if name in taken:
        raise ConfigError(f"variant {name!r}: the name is taken; choose another")

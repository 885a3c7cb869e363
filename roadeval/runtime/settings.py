"""Settings: the fields of a dataclass, each with its meaning, its checks and the flag that sets it.

The meaning of a field stands in the docstring of its class, as ``name: text`` with further lines
indented; range, checks and flag are metadata of its type.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

_FIELD: Final = re.compile(r"^(\w+): (.+(?:\n {4}.+)*)", re.MULTILINE)


@dataclass(frozen=True)
class Flag:
    """The flag of the command line that sets a field."""

    names: str
    """Its names, separated by spaces; messages use the last one."""
    metavar: str = ""
    """The placeholder of the value in the help; empty for a switch."""
    group: str = ""
    """Its section of the help, if that differs from the section of its table."""


@dataclass(frozen=True)
class Checked:
    """A function that checks a field's value: it returns the value, or raises a ValueError."""

    function: Callable[[Any], Any]

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Let pydantic, which validates settings, call the function first."""
        from pydantic import BeforeValidator

        return BeforeValidator(self.function).__get_pydantic_core_schema__(source, handler)


def meanings(kind: type) -> Mapping[str, str]:
    """Return the meaning of each field of a class, and of its bases, by their docstrings."""
    texts: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        for name, text in _FIELD.findall(inspect.cleandoc(base.__doc__ or "")):
            if name in vars(base).get("__annotations__", {}):
                texts[name] = " ".join(text.split())
    return texts

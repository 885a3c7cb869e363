"""Settings: the fields of a dataclass, each with its meaning, its checks and the flag that sets it.

The meaning of a field is the string after it; range, checks and flag are metadata of its type.
"""

from __future__ import annotations

import ast
import inspect
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any


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
    """Return the string after each field of a class, and of its bases; none without a source."""
    texts: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        texts |= read_meanings(base.__module__).get(base.__qualname__, {})
    return texts


@cache
def read_meanings(module: str) -> Mapping[str, Mapping[str, str]]:
    """Return the strings after the fields of a module's classes."""
    try:
        source = inspect.getsource(sys.modules[module])
    except (KeyError, OSError, TypeError):
        return {}
    texts: dict[str, dict[str, str]] = {}
    for described in ast.parse(source).body:
        for field, after in pairwise(getattr(described, "body", ())):
            match field, after:
                case (
                    ast.AnnAssign(target=ast.Name(name)),
                    ast.Expr(value=ast.Constant(value=str(text))),
                ) if isinstance(described, ast.ClassDef):
                    texts.setdefault(described.name, {})[name] = inspect.cleandoc(text)
    return texts

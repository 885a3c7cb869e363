"""Build the API pages from the docstrings: ``python docs/api.py [FOLDER]``, build/api by default.

Every warning is an error, `UNRESOLVED` excepted: a name in ``__all__`` that does not exist, an
annotation that cannot be resolved, a module that cannot be imported.
"""

from __future__ import annotations

import re
import sys
import warnings
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType
from typing import Final

import generated
import pdoc
from pdoc import docstrings

import roadeval
from roadeval.results import schema

UNRESOLVED: Final = (
    r".*(array\[int\]|Series\[\w+\]|DataclassInstance|PydanticDataclass|ForwardRef)"
    r"|.* for roadeval\.[\w.]+\.__(init|new)__\."
)
"""Annotations that type checkers understand and Python 3.11 cannot evaluate, and those of
constructors, inherited or of named tuples, which do not know the module that they were written
in."""
SETTING: Final = re.compile(r"^([a-z_]+): ", re.MULTILINE)
"""The name of a setting in the docstring of its class."""


def prepare(package: ModuleType) -> None:
    """Make public names and sub-modules visible to pdoc.

    It sees neither names that the package imports on first use nor modules that are missing in
    ``__all__``.
    """
    names = getattr(package, "__all__", None)
    for name in names or ():
        setattr(package, name, getattr(package, name))
    for module in iter_modules(package.__path__):
        if names is not None and not module.name.startswith("_") and module.name not in names:
            names.append(module.name)
        if module.ispkg:
            prepare(import_module(f"{package.__name__}.{module.name}"))


def in_markdown(convert: Callable[[str], str]) -> Callable[[str], str]:
    """Return a converter that makes a list of settings, and drops the ``::`` before a block."""
    return lambda text: convert(SETTING.sub(r"- **\1**: ", text.replace("::\n", ":\n")))


def main(folder: str = "build/api") -> None:
    """Write the pages into a folder."""
    prepare(roadeval)
    tables = generated.tables_of_a_drive(), generated.tables_of_a_fleet()
    schema.__doc__ = "\n".join((schema.__doc__ or "", *tables))
    docstrings.numpy = in_markdown(docstrings.numpy)
    warnings.simplefilter("error")
    warnings.filterwarnings("ignore", UNRESOLVED, UserWarning)
    footer = f"roadeval {roadeval.__version__}"
    pdoc.render.configure(docformat="numpy", show_source=False, footer_text=footer)
    # By its place: a bare name is ambiguous where the working folder has a `roadeval`, too.
    pdoc.pdoc(Path(roadeval.__file__).parent, output_directory=Path(folder))


if __name__ == "__main__":
    main(*sys.argv[1:])

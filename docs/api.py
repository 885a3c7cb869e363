"""Build the API pages from the docstrings: ``python docs/api.py [FOLDER]``, build/api by default.

Every warning is an error: a name in ``__all__`` that does not exist, an annotation that cannot be
resolved, a module that cannot be imported.
"""

from __future__ import annotations

import sys
import warnings
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType

import pdoc

import roadeval


def prepare(package: ModuleType) -> None:
    """Show pdoc what it does not find by itself: names imported on first use, and sub-modules."""
    names = getattr(package, "__all__", None)
    for name in names or ():
        setattr(package, name, getattr(package, name))
    for module in iter_modules(package.__path__):
        if names is not None and not module.name.startswith("_") and module.name not in names:
            names.append(module.name)
        if module.ispkg:
            prepare(import_module(f"{package.__name__}.{module.name}"))


def main(folder: str = "build/api") -> None:
    """Write the pages into a folder."""
    warnings.simplefilter("error")
    prepare(roadeval)
    pdoc.render.configure(docformat="numpy", footer_text=f"roadeval {roadeval.__version__}")
    pdoc.pdoc("roadeval", output_directory=Path(folder))


if __name__ == "__main__":
    main(*sys.argv[1:])

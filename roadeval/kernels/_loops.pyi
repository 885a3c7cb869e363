"""The loops in ``c``; ``c/module.c`` says what each takes."""

from typing import Any

def __getattr__(name: str) -> Any: ...

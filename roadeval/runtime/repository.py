"""The git repository that a command runs in."""

from __future__ import annotations

import os
import re
import subprocess
from typing import Any, Final

_ASK: Final = "git -c core.fsmonitor=false status --porcelain=v2 -b -uno --ignore-submodules=dirty"


def current_commit(patience_s: float = 3.0) -> tuple[str, bool]:
    """Return the current commit, empty if git does not answer, and whether tracked files differ."""
    quiet = {**os.environ, "GIT_OPTIONAL_LOCKS": "0", "GIT_NO_LAZY_FETCH": "1"}
    how: Any = {"stdin": subprocess.DEVNULL, "capture_output": True, "env": quiet}
    try:
        answer = subprocess.run(_ASK.split(), check=True, timeout=patience_s, **how).stdout
    except (OSError, subprocess.SubprocessError):
        return "", False
    status = re.match(rb"# branch\.oid ([0-9a-f]{40,64})\n(?:#.*\n)*(.?)", answer)
    return (status[1].decode(), bool(status[2])) if status else ("", False)

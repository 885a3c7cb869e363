"""The git repository that a command runs in."""

from __future__ import annotations

import os
import re
import subprocess
from typing import Final

_STATUS: Final = (
    *("git", "-c", "core.fsmonitor=false", "status", "--porcelain=v2", "--branch"),
    *("--untracked-files=no", "--ignore-submodules=dirty"),
)
_PATIENCE_S: Final = 3


def current_commit() -> tuple[str, bool]:
    """Return git's current commit, and whether tracked files differ from it.

    The commit is empty where there is no repository or no git, or git does not answer.
    """
    quiet = {"GIT_OPTIONAL_LOCKS": "0", "GIT_NO_LAZY_FETCH": "1", "GIT_TERMINAL_PROMPT": "0"}
    try:
        answer = subprocess.run(
            _STATUS,
            check=True,
            capture_output=True,
            stdin=subprocess.DEVNULL,
            timeout=_PATIENCE_S,
            env={**os.environ, **quiet},
        ).stdout
    except (OSError, subprocess.SubprocessError):
        return "", False
    commit = re.match(rb"# branch\.oid ([0-9a-f]{40,64})\n", answer)
    if commit is None:
        return "", False
    return commit[1].decode(), re.search(rb"^[^#]", answer, re.MULTILINE) is not None

"""The three standard streams of the process."""

from __future__ import annotations

import faulthandler
import logging
import os
import sys
import warnings
from io import BufferedWriter, FileIO, TextIOWrapper
from typing import Any, Final

from roadeval.runtime.text import UNENCODABLE

MISLEADING: Final = ("MPLBACKEND", "RERUN")
"""Environment variables for programs with windows; here they would stop figures and recording."""


def take_over(*, debug: bool) -> None:
    """Prepare the streams, and drop the messages that libraries write to them.

    The program itself reports all that concerns the user. Libraries may write only the reason of a
    crash; with ``debug`` they may write everything.
    """
    # Closed streams are opened, so that no other file gets their numbers. Stdout is opened for
    # reading, so that writing to it still fails.
    for number, flags in ((0, os.O_RDONLY), (1, os.O_RDONLY), (2, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            opened = os.open(os.devnull, flags)
            if opened != number:
                os.dup2(opened, number)
                os.close(opened)
    if sys.stdout is None:
        sys.stdout = os.fdopen(1, "w", closefd=False)
    encoding = sys.stderr.encoding if sys.stderr else None
    own_file = BufferedWriter(_LossyFile(os.dup(2), "w"))
    sys.stderr = TextIOWrapper(own_file, encoding, errors=UNENCODABLE, line_buffering=True)
    if not debug:
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 2)
        os.close(null)
        faulthandler.enable(sys.stderr, all_threads=False)
        logging.disable()
        if not sys.warnoptions:
            warnings.simplefilter("ignore")
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors=UNENCODABLE)
    for name in MISLEADING:
        os.environ.pop(name, None)


class _LossyFile(FileIO):
    """A file that ignores errors of writing, because a closed stderr must not stop the work."""

    def write(self, content: Any) -> int:
        """Write as much as possible, and report everything as written."""
        try:
            return super().write(content)
        except OSError:
            return len(content)

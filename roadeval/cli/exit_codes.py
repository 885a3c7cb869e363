"""Process exit codes."""

from enum import IntEnum


class ExitCode(IntEnum):
    """Exit codes of every command."""

    DONE = 0
    """Done."""
    FAILED = 1
    """A file cannot be read, used or written; one line on stderr says why."""
    USAGE = 2
    """The command line alone is wrong."""
    LOSS = 3
    """Done, but part of the log was lost; stderr says which."""
    CONDITION_HELD = 4
    """A ``--fail-if`` condition held."""
    DEFECT = 70
    """A mistake of the program itself (``EX_SOFTWARE``); ``ROADEVAL_DEBUG=1`` shows where."""
    INTERRUPTED = 130
    """Stopped by SIGINT, as Ctrl-C sends it."""
    BROKEN_PIPE = 141
    """The reader of stdout has ended, as with ``| head``."""
    TERMINATED = 143
    """Stopped by SIGTERM."""

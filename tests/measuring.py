"""Source for processes of their own that measure themselves."""

from typing import Final

# `resource.getrusage` counts the parent's memory at the birth of a process as its own, and the
# process that runs the tests is large: a child's growth would drown in it.
PEAK: Final = '''
import re
from pathlib import Path


def peak():
    """Greatest resident memory of this process so far, in KiB."""
    return int(re.search(r"VmHWM:\\s*(\\d+) kB", Path("/proc/self/status").read_text())[1])
'''

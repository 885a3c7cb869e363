"""What a golden text leaves out, for it differs between machines, versions or runs; nothing else.

Each rule says what it is and what stands there instead.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from typing import Any, Final

from roadeval.jobs.run.summary import versions

_NAMES: Final = "|".join(versions())

RULES: Final[Mapping[str, tuple[str, str | Callable[[re.Match[str]], str]]]] = {
    # The log's own checksum: its writer's version stands in the file.
    "the SHA-256 of a log": (r"\b[0-9a-f]{64}\b", "<sha256>"),
    "the digest of a run's input, which holds that": (r"(?<=input: )[0-9a-f]{32}\b", "<digest>"),
    "a package's version": (rf"\b({_NAMES}|version:) \d[\w.+]*", r"\1 <version>"),
    # Compression differs between versions of Rerun and of the codecs.
    "the size of a recording": (r"\.rrd \(\d+\.\d [kM]B\)", ".rrd (<size>)"),
    "milliseconds a frame": (
        r"(?<=ms a frame\n)(?:.*\d+\.\d\d\n)+",
        lambda found: re.sub(r"\d+\.\d\d\n", "<ms>\n", found[0]),
    ),
    # How often progress is told depends on the machine's speed; each step's first line stays.
    "progress, later lines": (r"(?m)^(training|replaying): (?!1 of).*\n", ""),
    "progress, the pace": (r", \d+\.\d frames/s(, \d+ s left)?", ""),
    # These belong to no machine, but would hide from the eye what is bold.
    "bold that goes on": (r"\x1b\[0m( *)\x1b\[1m(?=.)", r"\1"),
    "bold": (r"\x1b\[(?:0|1(?:;3\d)?)m", "**"),
    # The leaders of a table of contents: as many dots as a line has room for.
    "leaders": (r"(?: \.){4,}", " ..."),
    "spaces at a line's end": (r"(?m)[ \t]+$", ""),
}


def steady(text: str) -> str:
    """Leave out what differs from run to run."""
    for pattern, instead in RULES.values():
        text = re.sub(pattern, instead, text)
    return text.rstrip("\n") + "\n"


def steady_json(text: str) -> str:
    """Leave the same out of JSON, and the last digits of numbers, which hang on the processor."""
    content = json.loads(text)
    content["versions"] = dict.fromkeys(content["versions"], "<version>")
    content["origin"] |= {"made_ns": "<ns>", "commit": "<commit>", "dirty": "<dirty>"}
    content["seconds"] = {
        variant: dict.fromkeys(stages, "<s>") for variant, stages in content["seconds"].items()
    }
    return steady(json.dumps(_rounded(content), indent=1, ensure_ascii=False))


def _rounded(value: Any) -> Any:
    match value:
        case dict():
            return {name: _rounded(item) for name, item in value.items()}
        case list():
            return [_rounded(item) for item in value]
        case float():
            return float(f"{value:.9g}")
        case _:
            return value

"""Labels of some frames that were corrected, and where all others are: ``audit.json``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

from pydantic import TypeAdapter, ValidationError

from roadeval.logs.errors import LogError
from roadeval.logs.settings import AUDIT, LabelPlace, LabelSettings
from roadeval.runtime.documents import read_bounded, read_json

FORMAT: Final = {"name": "roadeval-audit", "version": 1}


@dataclass(frozen=True)
class AuditedLabels:
    """The labels that were audited, and which of them look wrong."""

    drive: str
    camera: str
    truth: LabelPlace
    topic: str | None
    labels: LabelSettings
    """Where the drive's labels are, and what their values mean."""
    suspects: list[dict[str, Any]]
    """The labels that look wrong, the worst first: the rows of ``audit.csv``."""
    format: dict[str, Any] = field(default_factory=lambda: dict(FORMAT))

    @classmethod
    def of(
        cls, drive: str, camera: str, run: Mapping[str, Any], suspects: list[dict[str, Any]]
    ) -> AuditedLabels:
        """Return the audit of a drive that was read with the tables of settings of a run."""
        topic = run["topics"].get("truth")
        where = {"truth": run["truth"], "topic": topic, "labels": run["labels"]}
        about = {"drive": drive, "camera": camera, "suspects": suspects}
        return TypeAdapter(cls).validate_python({**about, **where})

    def text(self) -> str:
        """Return the document."""
        return json.dumps(asdict(self), indent=1, allow_nan=False) + "\n"

    @classmethod
    def read(cls, folder: str) -> AuditedLabels | None:
        """Read the audit of a folder; None if it has none. A `LogError` if it is damaged."""
        path = Path(folder, AUDIT)
        if not folder or not path.is_file():
            return None
        try:
            audit = TypeAdapter(cls).validate_python(read_json(read_bounded(path)))
            if audit.format != FORMAT or audit.truth.path == folder:
                raise ValueError("not as roadeval audit writes it")
        except (OSError, ValueError, ValidationError) as error:
            reason = str(error).partition("\n")[0]
            remedy = "audit into a new folder"
            raise LogError(f"damaged ({reason})", where=path, remedy=remedy) from error
        return audit

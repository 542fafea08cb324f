"""Record of a run in its kept folder, by which its outputs can be read again."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

from uqpen.models.command.process import ProcessEnd

__all__ = ["RECORD", "RunRecord"]

RECORD = "run.json"


@dataclass(frozen=True)
class RunRecord:
    """Record of the runs of one program; `made_by` is all that decides what a run writes."""

    made_by: str

    def text(self, ending: ProcessEnd) -> str:
        """Return the content of the file of a run that has ended."""
        code = None if ending.is_late else ending.code
        return json.dumps({"made_by": self._sha256, "exit_code": code}) + "\n"

    def read(self, folder: Path) -> ProcessEnd | None:
        """Return how a kept run ended; None if there is none, or this program did not make it.

        A run that was ended for its time has written only a part, so it is not read again.
        """
        try:
            found = json.loads((folder / RECORD).read_text(encoding="utf-8"))
            is_own = found["made_by"] == self._sha256
            code = found["exit_code"]
        except (OSError, ValueError, KeyError, TypeError):
            return None
        return ProcessEnd(code) if is_own and type(code) is int else None

    @property
    def _sha256(self) -> str:
        return hashlib.sha256(self.made_by.encode()).hexdigest()

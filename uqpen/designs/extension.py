"""Extension of a design: which points of an earlier one it keeps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from uqpen.core.errors import toml_text

__all__ = ["Extension"]


@dataclass(frozen=True)
class Extension:
    """Points of an earlier design that are among those of a new one.

    Parameters
    ----------
    kept : int or None
        Number of them; None where it is not known.
    nearest : mapping of str to object
        Settings of the new design, nearest to its own, with which it keeps all. Empty where none
        are known.
    reason : str
        The property by which it does, such as ``"replicates of 20 points"``.
    """

    kept: int | None
    nearest: Mapping[str, object] = field(default_factory=dict)
    reason: str = ""

    def text(self, earlier_runs: int, runs: int) -> str:
        """Return what becomes of earlier runs that are not used; empty if all are.

        Parameters
        ----------
        earlier_runs, runs : int
            Number of runs of the earlier design, and of the new one.
        """
        if self.kept is None:
            return f"it is not known how many of its {earlier_runs} earlier runs it uses"
        if self.kept >= earlier_runs:
            return ""
        text = f"{earlier_runs - self.kept} of its {earlier_runs} earlier runs are not used"
        if self.kept == runs or not self.nearest:
            return text
        settings = ", ".join(f"{name} = {toml_text(value)}" for name, value in self.nearest.items())
        return f"{text}; to use all of them: {settings} ({self.reason})"

"""Stand-in for a user-defined model whose code is not executed."""

from __future__ import annotations

from dataclasses import dataclass

from uqpen.core.arrays import Arrays
from uqpen.core.errors import ModelError
from uqpen.core.model import Input, Model, Output, Results


@dataclass(frozen=True)
class UnloadedModel(Model):
    """Model of an archive whose runs are known, but which cannot be run here."""

    name: str  # the reference that the study names
    inputs: tuple[Input, ...]  # that the archive contains
    outputs: tuple[Output, ...]  # that the archive contains
    # True for an object of another process, False for a class that is not trusted.
    is_absent: bool = False

    def evaluate(self, inputs: Arrays) -> Results:
        raise ModelError(f"{self.name} is not loaded: it is not run without --trust")

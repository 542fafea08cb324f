"""Model whose runs are those of a data file, and no others."""

from __future__ import annotations

from dataclasses import dataclass

from uqpen.core.arrays import Arrays
from uqpen.core.errors import ModelError
from uqpen.core.files import FileSnapshot
from uqpen.core.model import Input, Model, Output, Results

__all__ = ["DataModel"]


@dataclass(frozen=True, eq=False)
class DataModel(Model):
    """Runs of a model that is not here: their points and results.

    Parameters
    ----------
    name : str
        The name of the file.
    inputs, outputs : tuple
        The variables that the file has columns of.
    points : mapping of str to ndarray, shape (run,)
        The inputs in SI units.
    results : Results
        The outputs, and the status of each run.
    file : FileSnapshot
        The file.
    coordinates : mapping of str to ndarray, shape (run,)
        What else the file says of the points: the replicate or the weight of each.
    """

    name: str
    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    points: Arrays
    results: Results
    file: FileSnapshot
    coordinates: Arrays

    @property
    def runs(self) -> int:
        """Number of runs."""
        return len(self.results.status)

    @property
    def uncallable_reason(self) -> str:
        return f"{self.name} has runs of a model that is not here, so no other run can be made"

    def evaluate(self, inputs: Arrays) -> Results:
        raise ModelError(self.uncallable_reason)

    def files(self) -> tuple[FileSnapshot, ...]:
        return (self.file,)

    def identity(self) -> dict[str, str]:
        return {"name": self.name, "data_sha256": self.file.sha256}

"""The inputs of several models that are run at the same points."""

from __future__ import annotations

from dataclasses import dataclass

from uqpen.core.arrays import Arrays
from uqpen.core.model import Input, Model, Results

__all__ = ["ModelsTogether"]


@dataclass(frozen=True, eq=False)
class ModelsTogether(Model):
    """The first model of a study with the inputs that only others take; it cannot be run.

    Parameters
    ----------
    first : Model
        It has all outputs of the study.
    further_inputs : tuple of Input
        Inputs of the others that the first does not have.
    """

    first: Model
    further_inputs: tuple[Input, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", self.first.name)
        object.__setattr__(self, "inputs", (*self.first.inputs, *self.further_inputs))
        object.__setattr__(self, "outputs", self.first.outputs)
        object.__setattr__(self, "alternatives", self.first.alternatives)
        object.__setattr__(self, "derived", self.first.derived)

    def evaluate(self, inputs: Arrays) -> Results:
        """Refuse to run: each model of the study is run by itself."""
        raise NotImplementedError(self.name)

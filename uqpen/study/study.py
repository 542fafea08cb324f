"""What a study is, once everything in its file has been understood."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass

from uqpen.analyses.question import Question
from uqpen.designs.design import Design
from uqpen.inputs.constraints import Constraint
from uqpen.inputs.law import InputLaw
from uqpen.model import Model

__all__ = ["Study"]


@dataclass(frozen=True)
class Study:
    """A model, the law of its inputs, the runs to make and what to ask of its outputs.

    Parameters
    ----------
    name : str
        The study file's name without its ending.
    title : str
        What a person reads.
    seed : int
        Where every random number comes from.
    model : Model
        What is run.
    law : InputLaw
        The inputs.
    constraints : tuple of Constraint
        Where the law ends.
    questions : tuple of Question
        One for each of the model's outputs, in its order.
    designs : mapping of str to Design
        The runs to make, by name.
    text : str
        The study file, verbatim.
    """

    name: str
    title: str
    seed: int
    model: Model
    law: InputLaw
    constraints: tuple[Constraint, ...]
    questions: tuple[Question, ...]
    designs: Mapping[str, Design]
    text: str

    @property
    def sha256(self) -> str:
        """Hash of the study's text."""
        return hashlib.sha256(self.text.encode("utf-8")).hexdigest()

    @property
    def runs(self) -> int:
        """How many runs its designs make in all."""
        return sum(design.size(self.law) for design in self.designs.values())

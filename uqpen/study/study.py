"""What a study is, once everything in its file has been understood."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from uqpen.core.files import FileSnapshot
from uqpen.core.model import Model
from uqpen.designs.design import Design
from uqpen.distributions.constraints import Constraint
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.execution import FailurePolicy
from uqpen.statistics.published import Publication
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.surrogates.surrogate import Surrogate

__all__ = ["ONLY_MODEL", "Study", "Variant"]

# What the model of a study with a single ``[model]`` is called.
ONLY_MODEL = ""


@dataclass(frozen=True)
class Variant:
    """A model as a study uses it.

    Parameters
    ----------
    model : Model
        What is run.
    given : mapping of str to float
        Inputs that it takes in place of the study's own, in SI units.
    """

    model: Model
    given: Mapping[str, float]


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
    models : mapping of str to Variant
        What is run, by name, all at the same points; `ONLY_MODEL` names a single one. The inputs
        and outputs of the first are the study's.
    joint : JointDistribution
        The inputs.
    constraints : tuple of Constraint
        Where the law ends.
    quantities_of_interest : tuple of QuantityOfInterest
        One for each of the first model's outputs, in its order.
    designs : mapping of str to Design
        The runs to make, by name.
    text : str
        The study file, verbatim.
    surrogates : mapping of str to Surrogate
        The cheap models to fit, by name.
    published : mapping of str to Publication
        Figures from elsewhere to stand beside its own.
    folder : Path
        Where it lies, and from where it names files.
    failures : FailurePolicy
        What is done about runs that are lost.
    """

    name: str
    title: str
    seed: int
    models: Mapping[str, Variant]
    joint: JointDistribution
    constraints: tuple[Constraint, ...]
    quantities_of_interest: tuple[QuantityOfInterest, ...]
    designs: Mapping[str, Design]
    text: str
    surrogates: Mapping[str, Surrogate] = field(default_factory=dict)
    published: Mapping[str, Publication] = field(default_factory=dict)
    folder: Path = Path()
    failures: FailurePolicy = FailurePolicy()

    @property
    def model(self) -> Model:
        """The first model, which is the only one as a rule."""
        return next(iter(self.models.values())).model

    @property
    def has_several_models(self) -> bool:
        """Whether its models have names, and so groups of their own."""
        return ONLY_MODEL not in self.models

    def model_quantities(self, model: Model) -> tuple[QuantityOfInterest, ...]:
        """The questions that a model has the outputs for."""
        outputs = {output.name: output for output in model.outputs}
        return tuple(
            replace(quantity, output=outputs[quantity.output.name])
            for quantity in self.quantities_of_interest
            if quantity.output.name in outputs
        )

    def validation_designs(self, surrogate: Surrogate) -> list[str]:
        """The designs whose runs a surrogate is held against, the one that checks it first.

        That is the one it names; else the first sample of the law that it was not fitted to.
        """
        others = [name for name in self.designs if name != surrogate.design]
        samples = [name for name in others if self.designs[name].samples_inputs(self.joint)]
        first = [surrogate.check] if surrogate.check else samples[:1]
        return first + [name for name in samples if name not in first]

    def files(self) -> Iterator[FileSnapshot]:
        """The files that it names, as they stood when they were read.

        What models of the user's own consist of is known only after their runs.
        """
        for variant in self.models.values():
            yield from variant.model.files()
        yield from self.joint.files
        for design in self.designs.values():
            yield from design.files()

    @property
    def sha256(self) -> str:
        """Hash of the study's text."""
        return hashlib.sha256(self.text.encode("utf-8")).hexdigest()

    @property
    def runs(self) -> int:
        """How many runs its designs make in all, with all models."""
        each = sum(design.run_count(self.joint) for design in self.designs.values())
        return each * len(self.models)

"""Study: the content of a study file once it has been read."""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from uqpen.core.files import FileSnapshot
from uqpen.core.labels import FINER_THAN, STANDS_FOR
from uqpen.core.model import Model
from uqpen.core.settings import name, number
from uqpen.designs.design import Design, UnloadedDesign
from uqpen.distributions.constraints import Constraint
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.execution import FailurePolicy
from uqpen.execution.seeds import RunSeeds
from uqpen.measurements.experiments import MeasuredOutputs, ValidationSettings
from uqpen.models.unloaded_model import UnloadedModel
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.joint_event import JointEvent
from uqpen.statistics.published import Publication
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.user_defined_analysis import UserDefinedAnalysis
from uqpen.surrogates.surrogate import Surrogate


@dataclass(frozen=True, kw_only=True)
class StandIn:
    """Model that another one stands for, and the cost of a run in its place."""

    stands_for: str = name()  # the name of that model
    cost: float = number(
        above=0,
        below=1,
        expected="the cost of a run over that of the model it stands for, above 0 and below 1",
    )  # cost of a run, relative to one of that model


def family_costs(first: str, stand_ins: Mapping[str, StandIn]) -> dict[str, float]:
    """Return the cost of a run of a model and of all that stand for it, relative to its own.

    Parameters
    ----------
    stand_ins : mapping of str to StandIn
        The stand-ins of a study by name. Some may stand for other stand-ins, without a circle.
    """
    costs = {first: 1.0}
    left = dict(stand_ins)
    while near := {name: each for name, each in left.items() if each.stands_for in costs}:
        costs |= {name: costs[each.stands_for] * each.cost for name, each in near.items()}
        left = {name: each for name, each in left.items() if name not in near}
    return {name: costs[name] for name in (first, *stand_ins) if name in costs}


# Name of the model of a study with a single ``[model]``.
ONLY_MODEL = ""


@dataclass(frozen=True)
class Variant:
    """A model as a study uses it."""

    model: Model  # the model to run
    given: Mapping[str, float]  # values of inputs that replace the study's own, in SI units
    stand_in: StandIn | None = None  # the model that it stands for, and what a run of it costs
    finer_than: str = ""  # the model that it is with a finer tolerance or grid; empty for none

    @property
    def relation(self) -> dict[str, str]:
        """The model that it is no alternative to, as an attribute; empty for none."""
        if self.stand_in is not None:
            return {STANDS_FOR: self.stand_in.stands_for}
        return {FINER_THAN: self.finer_than} if self.finer_than else {}


class SurrogateOrigin(NamedTuple):
    """Origin of a user-defined surrogate."""

    kind: str  # the reference, the entry point or the object that the study names
    files: tuple[FileSnapshot, ...] = ()  # the files that it was loaded from


@dataclass(frozen=True)
class ValidatedStudy:
    """A model, the joint distribution of its inputs, designs and quantities of interest."""

    name: str  # the study file's name without its suffix
    title: str  # the title to show
    seed: int  # seed of all random numbers
    # The models by name, all run at the same points; `ONLY_MODEL` names a single one. The inputs
    # and outputs of the first are the study's.
    models: Mapping[str, Variant]
    joint: JointDistribution  # the inputs
    constraints: tuple[Constraint, ...]  # conditions that an admissible point meets
    # One for each of the first model's outputs, derived ones too, in its order.
    quantities_of_interest: tuple[QuantityOfInterest, ...]
    designs: Mapping[str, Design]  # the runs to make, by name
    text: str  # the study file, verbatim; with a budget, its plan stands in place of that
    # The cheap models to fit, by name.
    surrogates: Mapping[str, Surrogate] = field(default_factory=dict)
    # Published estimates for comparison with its own.
    published: Mapping[str, Publication] = field(default_factory=dict)
    folder: Path = Path()  # folder of the study file, to which the paths of files are relative
    failures: FailurePolicy = FailurePolicy()  # policy for failed runs
    # User-defined functions that yield statistics of each sample.
    analyses: tuple[UserDefinedAnalysis, ...] = ()
    # The files that a user-defined design was loaded from, by its name.
    design_modules: Mapping[str, tuple[FileSnapshot, ...]] = field(default_factory=dict)
    # The origins of user-defined surrogates, by their names.
    surrogate_origins: Mapping[str, SurrogateOrigin] = field(default_factory=dict)
    confidence_level: float = LEVEL  # confidence level of its intervals
    # Events of several outputs whose probabilities are requested.
    joint_events: tuple[JointEvent, ...] = ()
    plan: tuple[str, ...] = ()  # what was planned from a budget and why, a line each
    # Analyses that it leaves out: ``"sensitivity"``, ``"convergence"``.
    left_out: tuple[str, ...] = ()
    # Experiments that the model is compared with, by name.
    measured: Mapping[str, MeasuredOutputs] = field(default_factory=dict)
    # How far off the model may be there, by the name of these.
    validations: Mapping[str, ValidationSettings] = field(default_factory=dict)
    swept: tuple[str, ...] = ()  # inputs of which each of its models has another value

    @property
    def model(self) -> Model:
        """First model, which is usually the only one."""
        return next(iter(self.models.values())).model

    @property
    def has_several_models(self) -> bool:
        """True if its models have names, and so groups of their own."""
        return ONLY_MODEL not in self.models

    def model_quantities(self, model: Model) -> tuple[QuantityOfInterest, ...]:
        """Return the quantities of interest whose outputs a model has."""
        outputs = {output.name: output for output in model.all_outputs}
        return tuple(
            replace(quantity, output=outputs[quantity.output.name])
            for quantity in self.quantities_of_interest
            if quantity.output.name in outputs
        )

    def reading_again(self) -> ValidatedStudy:
        """Return a study that reads the folders of its runs where they are kept."""
        variants = {
            name: replace(variant, model=variant.model.reading_again())
            for name, variant in self.models.items()
        }
        return replace(self, models=variants)

    def display_units(self) -> dict[str, str]:
        """Return the display unit of each input and output."""
        units = {entry.variable.name: entry.display_unit for entry in self.joint.inputs}
        wanted = {each.output.name: each.display_unit for each in self.quantities_of_interest}
        return units | wanted

    def files(self) -> Iterator[FileSnapshot]:
        """Return the files that it names, with the content that was read.

        The files of user-defined models are known only after their runs.
        """
        for variant in self.models.values():
            yield from variant.model.files()
        yield from self.joint.files
        fitted = (each.fitted for each in self.validations.values() if each.fitted)
        measured = (*self.measured.values(), *fitted)
        yield from (each.file for each in measured if each.file is not None)
        for design in self.designs:
            yield from self.design_files(design)
        for origin in self.surrogate_origins.values():
            yield from origin.files
        for analysis in self.analyses:
            yield from analysis.files()

    def design_files(self, name: str) -> tuple[FileSnapshot, ...]:
        """Return the files of a design: those with its points, and those with its code."""
        return (*self.designs[name].files(), *self.design_modules.get(name, ()))

    @property
    def unloaded_members(self) -> list[str]:
        """Names of its user-defined designs and distributions that are not loaded, each once."""
        designs = [each.name for each in self.designs.values() if isinstance(each, UnloadedDesign)]
        return list(dict.fromkeys([*designs, *self.joint.unloaded.values()]))

    @property
    def unloaded_models(self) -> list[str]:
        """References of its models that are not loaded."""
        models = (variant.model for variant in self.models.values())
        return [model.name for model in models if isinstance(model, UnloadedModel)]

    @cached_property
    def content(self) -> Mapping[str, Any]:
        """The study's text, parsed."""
        return tomllib.loads(self.text)

    @property
    def sha256(self) -> str:
        """Hash of the study's text."""
        return hashlib.sha256(self.text.encode("utf-8")).hexdigest()

    @property
    def runs(self) -> int:
        """Total number of runs of its designs, with all models."""
        return sum(self.design_runs(name) for name in self.designs)

    def design_runs(self, name: str) -> int:
        """Return the number of runs of a design by all models, or the largest possible number."""
        return self.designs[name].total_runs(self.joint, self.run_costs)

    def run_seeds(self, name: str) -> RunSeeds:
        """Return the seeds of the runs of a model in a design, from its first run on."""
        return RunSeeds(self.seed, name, self.models[name].model)

    @property
    def stand_ins(self) -> dict[str, StandIn]:
        """Stand-ins among the models, by name."""
        found = ((name, variant.stand_in) for name, variant in self.models.items())
        return {name: stand_in for name, stand_in in found if stand_in}

    @property
    def run_costs(self) -> dict[str, float]:
        """Cost of a run of each model, relative to the first; 1 where the study states none."""
        return dict.fromkeys(self.models, 1.0) | self.family_costs

    @property
    def family_costs(self) -> dict[str, float]:
        """Cost of a run of the first model, which is 1, and of each of its stand-ins."""
        return family_costs(next(iter(self.models)), self.stand_ins)

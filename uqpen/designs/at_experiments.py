"""Designs at measured experiments: what they have in common, and a sample at all of them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from uqpen.core.errors import Problem
from uqpen.core.files import FileSnapshot
from uqpen.core.labels import DRAW, EXPERIMENT, MEASURED
from uqpen.core.sampling import Sampling
from uqpen.core.settings import count, name, names
from uqpen.core.streams import Stream
from uqpen.designs.design import Design, Rounds
from uqpen.designs.drawn_points import points_in_memory, points_of
from uqpen.designs.stopping.stopping_rule import RequestedOutput
from uqpen.distributions.joint_distribution import JointDistribution, points_dataset
from uqpen.measurements.experiments import Experiments

# Designs that compare their runs with measurements.


@dataclass(frozen=True)
class MeasuredDesign(Design):
    """Design whose points follow from a comparison of its runs with measurements.

    Parameters
    ----------
    measured : tuple of str
        Names of the measurements that the outputs are compared with.
    experiments : Experiments, optional
        The measurements; a study gives them.
    """

    needs_one_model = True

    measured: tuple[str, ...] = names(expected='different sections, as ["name"]: [measured.name]')
    experiments: Experiments = field(default=Experiments(()), compare=False, repr=False)

    @property
    def ends_early(self) -> bool:
        return True

    def files(self) -> tuple[FileSnapshot, ...]:
        return self.experiments.files

    def check_continuous(
        self, joint: JointDistribution, names: Collection[str]
    ) -> Iterator[Problem]:
        """Yield the problems of inputs that have single values, of some names."""
        for entry in joint.random:
            if entry.variable.name in names and entry.distribution.is_discrete:
                found = f"steps of {entry.variable.name}, which has single values"
                expected = 'a continuous distribution; kind = "posterior"; or a study of each value'
                yield Problem((), found, expected)


@dataclass(frozen=True)
class LimitedMeasuredDesign(MeasuredDesign):
    """Design at measurements that goes on until it has what it looks for.

    Parameters
    ----------
    at_most : int
        Largest number of runs; each point has one in every experiment.
    """

    at_most: int = count(minimum=20, default=10_000)

    def run_count(self, joint: JointDistribution) -> int:
        return self.at_most


# A sample of the inputs at all experiments.


@dataclass(frozen=True)
class AtSetting:
    """Setting of a design whose points are a sample."""

    at: str | None = name(default=None)  # the measurements at whose experiments it makes runs


@dataclass(frozen=True)
class DesignAtExperiments(Design):
    """Design with a run of each draw in every experiment.

    Unknown inputs are those of the draw. Inputs that vary, and conditions that are not known
    exactly, are drawn anew for each experiment.
    """

    drawn: Design
    experiments: Experiments = field(compare=False)

    sampling = Sampling.AT_EXPERIMENTS

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        measured = self.experiments
        (drawn,) = self.drawn.rounds(joint, stream)
        points = points_in_memory(points_of(drawn))
        random = [entry.variable.name for entry in joint.random]
        draws = {each: points[each].values for each in measured.unknown}
        size = len(next(iter(draws.values()))) if draws else self.drawn.run_count(joint)
        shape = (size, measured.count)
        varies = {each for section in measured.sections for each in section.varies}
        rng = stream.generator("inputs that vary")
        if varies:
            unit = rng.random((size * measured.count, len(random)))
            values = joint.ppf(joint.conditional_probabilities(unit, {}))
            draws |= {each: values[each].reshape(shape) for each in random if each in varies}
        nominal = joint.nominal()
        for section in measured.sections:
            for each, std in section.condition_std.items():
                known = section.conditions[each]
                draws[each] = known + std * stream.generator("conditions", each).standard_normal(
                    shape
                )
        others = {each: nominal[each] for each in random}
        if not draws:  # nothing is unknown: one run of each experiment is as good as many
            draws = {each: np.full(size, value) for each, value in others.items()}
        coordinates = {
            DRAW: np.repeat(np.arange(size), measured.count),
            EXPERIMENT: np.tile(np.arange(measured.count), size),
        }
        inputs = measured.inputs(draws, others)
        made = points_dataset(joint, inputs, coordinates, runs=size * measured.count)
        yield made.assign_attrs({MEASURED: measured.name})

    def check_settings(self) -> Iterator[Problem]:
        yield from self.drawn.check_settings()

    def check_inputs(self, joint: JointDistribution) -> Iterator[Problem]:
        yield from self.drawn.check_inputs(joint)

    def check_outputs(self, requested: Sequence[RequestedOutput]) -> Iterator[Problem]:
        yield from self.drawn.check_outputs(requested)

    def check_models(
        self, models: Collection[str], costs: Mapping[str, float]
    ) -> Iterator[Problem]:
        yield from self.drawn.check_models(models, costs)

    def run_count(self, joint: JointDistribution) -> int:
        return self.drawn.run_count(joint) * self.experiments.count

    def files(self) -> tuple[FileSnapshot, ...]:
        return (*self.drawn.files(), *self.experiments.files)


def at_problem(design: Design) -> tuple[str, str] | None:
    """Return why a design has no runs at experiments, and what is expected; None if it has."""
    expected = "monte-carlo, latin-hypercube, sobol-sequence or halton with a number of runs"
    if design.results is not None or design.sampling not in (
        Sampling.INDEPENDENT,
        Sampling.STRATIFIED,
    ):
        return "runs at experiments of a design that is no sample to be run", expected
    if design.ends_early:
        return "runs at experiments of a design that decides its own number of runs", expected
    return None

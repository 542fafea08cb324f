"""Runs of a model and of its cheap stand-ins, in the best proportion for a budget."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem, toml_text
from uqpen.core.labels import ROLE, RUN
from uqpen.core.lookup import choices
from uqpen.core.sampling import Sampling
from uqpen.core.settings import count, name
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.core.threads import one_blas_thread
from uqpen.designs.design import Design, ModelRounds
from uqpen.designs.extension import Extension
from uqpen.designs.feedback import Feedback
from uqpen.designs.monte_carlo import independent_points
from uqpen.designs.multifidelity.allocation import Allocation, best_allocation
from uqpen.designs.round import Round
from uqpen.designs.stopping.stopping_rule import RequestedOutput
from uqpen.distributions.joint_distribution import JointDistribution

__all__ = ["Multifidelity"]

# There are 255 groups of eight models, and each step of the allocation looks at all of them.
_MOST_MODELS = 8
# Fewer points tell too little of the covariances.
_FEWEST_PILOT = 20


@dataclass(frozen=True)
class Multifidelity(Design):
    """Multifidelity Monte Carlo: few runs of a model, and many of the models that stand in for it.

    All models run the points of a pilot. The covariances of its outputs give the groups of models
    that spend the rest of the budget best, and each group runs independent points of its own.

    Parameters
    ----------
    budget : int
        Total cost, in runs of the model that the others stand for, pilot included.
    pilot : int
        Number of points that all models run first.
    output : str, optional
        The output whose mean the numbers of runs are best for; by default all numbers that vary in
        a stand-in, too.

    References
    ----------
    Peherstorfer, B., Willcox, K. & Gunzburger, M. (2016). SIAM J. Sci. Comput. 38, A3163-A3194;
    Schaden, D. & Ullmann, E. (2020). SIAM/ASA J. Uncertainty Quantification 8, 601-635.
    """

    sampling = Sampling.INDEPENDENT

    budget: int = count(minimum=_FEWEST_PILOT)
    pilot: int = count(minimum=_FEWEST_PILOT, default=50)
    output: str | None = name(default=None)

    def check_settings(self) -> Iterator[Problem]:
        if self.pilot > self.budget:
            yield Problem(("pilot",), str(self.pilot), f"at most the budget, {self.budget}")

    def check_outputs(self, requested: Sequence[RequestedOutput]) -> Iterator[Problem]:
        numbers = [each.output.name for each in requested if each.output.is_number]
        if self.output is not None and self.output not in numbers:
            found, expected = toml_text(self.output), f"a number; {choices(self.output, numbers)}"
            yield Problem(("output",), found, expected)

    def check_models(
        self, models: Collection[str], costs: Mapping[str, float]
    ) -> Iterator[Problem]:
        if len(costs) < 2:
            found = "a study in which no model stands for another"
            expected = 'a [models.<name>] with stands_for = "…" and cost = …'
            yield Problem(("kind",), found, expected)
        elif others := [model for model in models if model not in costs]:
            found = f"a model that stands for no other: {others[0]}"
            yield Problem(("kind",), found, f"models that stand for {next(iter(costs))}")
        elif len(costs) > _MOST_MODELS:
            yield Problem(("kind",), f"{len(costs)} models", f"at most {_MOST_MODELS}")
        elif (cost := self.pilot * sum(costs.values())) > self.budget:
            found = f"a pilot of {self.pilot} points, which costs {cost:.6g}"
            yield Problem(("budget",), str(self.budget), f"enough for {found}")

    def rounds(self, joint: JointDistribution, stream: Stream) -> ModelRounds:
        feedback = yield independent_points(joint, stream, 0, self.pilot)
        names = tuple(feedback.costs)
        costs = np.array([feedback.costs[each] for each in names])
        allocation = self._allocation(feedback, costs)
        for group, number in zip(allocation.groups, allocation.runs, strict=True):
            runs = int(number + 1e-9)
            chosen = tuple(each for each, has in zip(names, group, strict=True) if has)
            if chosen != names:
                points = independent_points(joint, stream.child(*chosen), 0, runs)
                yield Round(points, chosen)
            elif runs > self.pilot:
                yield independent_points(joint, stream, self.pilot, runs)

    @property
    def ends_early(self) -> bool:
        return True

    def run_count(self, joint: JointDistribution) -> int:
        return self.budget

    def total_runs(self, joint: JointDistribution, costs: Mapping[str, float]) -> int:
        left = self.budget - self.pilot * sum(costs.values())
        return self.pilot * len(costs) + int(left / min(costs.values()))

    def extension(self, earlier: Design, joint: JointDistribution) -> Extension:
        # Points of all groups are the first of their streams, whatever their numbers.
        if isinstance(earlier, Multifidelity) and earlier.pilot == self.pilot:
            return Extension(min(self.budget, earlier.budget))
        return super().extension(earlier, joint)

    def _allocation(self, feedback: Feedback, costs: FloatArray) -> Allocation:
        """Return the best allocation after a pilot; of constant outputs, as if uncorrelated."""
        with one_blas_thread():
            wanted = [self.output] if self.output else _numbers(feedback)
            covariances = list(_covariances(feedback, wanted)) or [np.eye(len(costs))]
            return best_allocation(covariances, costs, self.budget, self.pilot)


def _covariances(feedback: Feedback, outputs: Iterable[str]) -> Iterator[FloatArray]:
    """Yield the covariance matrix of each output that varies in the first model and another."""
    first, *others = (feedback.runs[model] for model in feedback.costs)
    is_ok = feedback.status == Status.OK
    for output in outputs:
        if all(output in each for each in others):
            values = np.array([each[output].values[is_ok] for each in (first, *others)])
            values = values[:, np.isfinite(values).all(axis=0)]
            varies = values.shape[1] > 2 * len(values) and np.ptp(values, axis=1) > 0
            if varies[0] and varies[1:].any():
                yield np.cov(values)


def _numbers(feedback: Feedback) -> Iterator[str]:
    """Yield the outputs of the first model that are one number in each run."""
    for key, variable in feedback.runs[next(iter(feedback.costs))].data_vars.items():
        is_number = variable.dims == (RUN,) and variable.dtype.kind == "f"
        if is_number and variable.attrs.get(ROLE) == "output":
            yield str(key)

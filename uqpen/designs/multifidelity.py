"""Runs of a model and of its cheap stand-ins, in the best proportion for a budget."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.errors import Problem, toml_text
from uqpen.core.labels import ROLE, RUN
from uqpen.core.lookup import choices
from uqpen.core.processors import one_blas_thread
from uqpen.core.sampling import Sampling
from uqpen.core.settings import count, name
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.designs.design import Design, Extension, ModelRounds
from uqpen.designs.drawn_points import Round
from uqpen.designs.feedback import Feedback
from uqpen.designs.monte_carlo import independent_points
from uqpen.designs.stopping.stopping_rule import RequestedOutput
from uqpen.distributions.joint_distribution import JointDistribution

# Best linear unbiased estimator of a mean from independent groups of runs by several models.
#
# A group of runs is made by some of the models at common points. Its mean outputs are unbiased, and
# the best linear combination of those of all groups is that of generalised least squares (Schaden,
# D. & Ullmann, E. (2020). SIAM/ASA J. Uncertainty Quantification 8, 601-635). The model whose mean
# is wanted is the first.

# Part of each variance that is taken to be noise of its own. Without it, outputs that are linear in
# each other, or constant, have no inverse.
_NOISE = 1e-9


@dataclass(frozen=True, eq=False)
class LinearEstimator:
    """Best linear unbiased estimator of the mean output of the first model."""

    covariance: FloatArray  # (model, model): of the models' outputs at a common point
    # (model,): the models of each group. Each model is in one of them.
    groups: Sequence[BoolArray]

    def weights(self, runs: FloatArray) -> FloatArray:
        """Return the weights of the groups' mean outputs.

        Parameters
        ----------
        runs : ndarray, shape (group,)
            Number of points of each group, not necessarily whole.

        Returns
        -------
        ndarray, shape (group, model)
            They add up to 1 for the first model, and to 0 for each other. A model that is not in a
            group has the weight 0 there.
        """
        information = runs[:, np.newaxis, np.newaxis] * self._inverses
        wanted = np.zeros(len(self._scale))
        wanted[0] = 1.0
        # Of a model that has no runs nothing is known, and nothing is needed: its weight is 0.
        direction = np.linalg.lstsq(information.sum(axis=0), wanted, rcond=None)[0]
        return (information @ direction) * self._scale[0] / self._scale

    def group_variances(self, weights: FloatArray) -> FloatArray:
        """Return the variance of the weighted outputs at one point of each group."""
        return ((weights @ self.covariance) * weights).sum(axis=1).clip(min=0.0)

    def variance(self, runs: FloatArray) -> float:
        """Return the variance of the estimator with numbers of points above 0."""
        return float((self.group_variances(self.weights(runs)) / runs).sum())

    @cached_property
    def _scale(self) -> FloatArray:
        """Standard deviation of each output; 1 for a constant one."""
        scale = np.sqrt(np.diag(self.covariance))
        return np.where(scale > 0, scale, 1.0)

    @cached_property
    def _inverses(self) -> FloatArray:
        """Inverse of the correlations within each group; 0 for models outside of it."""
        correlation = self.covariance / np.outer(self._scale, self._scale)
        correlation = correlation + _NOISE * np.eye(len(correlation))
        inverses = np.zeros((len(self.groups), *correlation.shape))
        for inverse, group in zip(inverses, self.groups, strict=True):
            inside = np.ix_(group, group)
            inverse[inside] = np.linalg.inv(correlation[inside])
        return inverses


# Allocation of a budget to groups of models, by the covariances of their outputs.

# Each step lowers the variance. Numbers of runs are rounded, so a millionth is near enough.
_MOST_STEPS, _TOLERANCE = 2000, 1e-6

# A group with a smaller share of the budget, or of fewer points, is left out: its own error would
# not be known.
_SMALLEST_SHARE, _FEWEST_POINTS = 1e-3, 10


@dataclass(frozen=True, eq=False)
class Allocation:
    """Numbers of points by groups of models."""

    groups: tuple[BoolArray, ...]  # (model,): the models of each group; the first has all of them
    runs: FloatArray  # (group,): the number of points that each group runs, not necessarily whole

    def variance(self, covariance: FloatArray) -> float:
        """Return the variance of the best linear unbiased estimator of the first model's mean."""
        return LinearEstimator(covariance, self.groups).variance(self.runs)


def best_allocation(
    covariances: Sequence[FloatArray], costs: FloatArray, budget: float, pilot: int = 0
) -> Allocation:
    """Return the allocation with which the best linear unbiased estimator has least variance.

    For given weights of the groups' means, the best number of points of a group is proportional to
    the root of its variance over its cost. For given numbers, the best weights are known. Steps of
    both in turn lower the variance to the smallest, as it is convex in the numbers (the
    multiplicative algorithm for c-optimal designs: Yu, Y. (2010). Ann. Statist. 38, 1593-1606).

    Parameters
    ----------
    covariances : sequence of ndarray, shape (model, model)
        Of each output. The sum of the variances of their estimators, each over the variance of the
        first model's output, is made smallest.
    costs : ndarray, shape (model,)
        Of a run of each model.
    budget : float
        Total cost.
    pilot : int
        Number of points that all models run at least.
    """
    # Every group of at least one of the models, that of all models first.
    chosen = product((True, False), repeat=len(costs))
    groups = tuple(np.array(group) for group in chosen if any(group))
    while True:
        prices = np.array([costs[group].sum() for group in groups])
        estimators = [LinearEstimator(covariance, groups) for covariance in covariances]
        runs = _allocate(estimators, prices, budget, pilot)
        is_kept = (runs * prices >= _SMALLEST_SHARE * budget) & (runs >= _FEWEST_POINTS)
        is_kept[0] = True
        if is_kept.all():
            return Allocation(groups, runs)
        groups = tuple(group for group, keep in zip(groups, is_kept, strict=True) if keep)


def _allocate(
    estimators: Sequence[LinearEstimator], prices: FloatArray, budget: float, pilot: int
) -> FloatArray:
    """Return the best numbers of points of the groups; the first has those of the pilot."""
    runs = _descend(estimators, prices, budget / len(prices) / prices, free=slice(None))
    if runs[0] >= pilot or len(runs) == 1:
        return runs
    runs[1:] *= (budget - pilot * prices[0]) / (runs[1:] @ prices[1:])
    runs[0] = pilot
    return _descend(estimators, prices, runs, free=slice(1, None))


def _descend(
    estimators: Sequence[LinearEstimator], prices: FloatArray, runs: FloatArray, free: slice
) -> FloatArray:
    """Return better and better numbers of points of the free groups, at the same cost."""
    budget, before = float(runs[free] @ prices[free]), np.inf
    for _ in range(_MOST_STEPS):
        spread = np.zeros(len(runs))
        for each in estimators:
            spread += each.group_variances(each.weights(runs)) / each.covariance[0, 0]
        variance = float((spread / np.maximum(runs, np.finfo(float).tiny)).sum())
        roots = np.sqrt(spread[free] / prices[free])
        if not variance < before * (1 - _TOLERANCE) or not roots.any():
            break
        before, runs = variance, runs.copy()
        runs[free] = budget * roots / (roots @ prices[free])
    return runs


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
        with one_blas_thread():
            wanted = [self.output] if self.output else _numbers(feedback)
            # Constant outputs are taken as uncorrelated.
            covariances = list(_covariances(feedback, wanted)) or [np.eye(len(costs))]
            allocation = best_allocation(covariances, costs, self.budget, self.pilot)
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

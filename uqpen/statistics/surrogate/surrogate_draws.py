"""Draws of a surrogate, in any number, since an evaluation costs almost nothing."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import cast

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.labels import SAMPLING, STATUS
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.designs.quasi_monte_carlo import SobolSequence, sobol_points
from uqpen.designs.rounds import first_round
from uqpen.distributions.constraints import Constraint
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.execution import Evaluator, evaluate
from uqpen.statistics import texts
from uqpen.surrogates.fitted_surrogate import ClosedForms, FittedSurrogate

# Draws from a joint distribution, conditional on some inputs and on being admissible.

# Number of redraws after which a draw that is still inadmissible is left out.
_MOST_REDRAWS = 100

_NO_VALUES: Mapping[str, FloatArray] = MappingProxyType({})


@dataclass(frozen=True, eq=False)
class ConditionalSample:
    """Draws of all inputs."""

    points: FloatArray  # (run, random input): as probabilities
    # (run,): in SI units. Some rows may be inadmissible for want of a better draw.
    inputs: dict[str, FloatArray]


@dataclass(frozen=True)
class ConditionalDraws:
    """Joint distribution to draw from, conditional on some inputs and on being admissible."""

    # A model with the constraints of the joint distribution. It knows what is admissible.
    evaluator: Evaluator
    joint: JointDistribution
    # Values of fixed inputs that replace those of the joint distribution.
    given: Mapping[str, float]
    stream: Stream  # source of the random numbers of redraws

    def draw(
        self,
        unit: FloatArray,
        shared: Mapping[int, FloatArray],
        purpose: str,
        values: Mapping[str, FloatArray] = _NO_VALUES,
    ) -> ConditionalSample:
        """Draw the inputs given some of them.

        An inadmissible draw is drawn again from the distribution conditional on the shared inputs,
        until it is admissible (rejection sampling). The result is a draw conditional on both.

        Parameters
        ----------
        unit : ndarray, shape (run, random input)
            Points of the unit cube; the columns of shared inputs are ignored.
        shared : mapping of int to ndarray, shape (run,)
            Probabilities of the shared inputs, by position.
        purpose : str
            Name of the stream of redraws.
        values : mapping of str to ndarray, shape (run,)
            Values of shared inputs, where these are known to the bit.
        """
        points = self.joint.conditional_probabilities(unit, shared)
        inputs = self._inputs(points) | dict(values)
        is_open = self._is_inadmissible(inputs)
        for number in range(_MOST_REDRAWS):
            rows = np.flatnonzero(is_open)
            if not rows.size:
                break
            fresh = self.stream.generator(purpose, number).random((rows.size, unit.shape[1]))
            some = {i: column[rows] for i, column in shared.items()}
            points[rows] = self.joint.conditional_probabilities(fresh, some)
            again = self._inputs(points[rows])
            again |= {name: column[rows] for name, column in values.items()}
            is_open[rows] = self._is_inadmissible(again)
            for name, column in again.items():
                inputs[name][rows] = column
        return ConditionalSample(points, inputs)

    def probabilities(self, values: Mapping[str, FloatArray], unit: FloatArray) -> FloatArray:
        """Return probabilities of given values of the random inputs, shape (run, random input).

        A value with a probability of its own has any one within its step. Draws that share the
        value, and not the step's part, have their own.

        Parameters
        ----------
        values : mapping of str to ndarray, shape (run,)
        unit : ndarray, shape (run, random input)
            Where in its step each one is, from 0 to 1.
        """
        columns = []
        for entry, part in zip(self.joint.random, unit.T, strict=True):
            value = values[entry.variable.name]
            before, at = map(entry.distribution.cdf, (np.nextafter(value, -np.inf), value))
            columns.append(before + part * (at - before))
        return np.column_stack(columns)

    def _inputs(self, points: FloatArray) -> dict[str, FloatArray]:
        fixed = {entry.variable.name: entry.value for entry in self.joint.fixed} | {**self.given}
        columns = {name: np.full(len(points), value) for name, value in fixed.items()}
        drawn = {name: np.array(each) for name, each in self.joint.ppf(points).items()}
        return self.joint.with_derived(columns | drawn)

    def _is_inadmissible(self, inputs: dict[str, FloatArray]) -> BoolArray:
        found = np.zeros(len(next(iter(inputs.values()))), dtype=np.bool_)
        for violated, _ in self.evaluator.violations(inputs):
            found |= violated
        return found


# Pairs of draws that share some of their inputs, of a cheap model.
#
# For a set J of inputs, Var E[Y | X_J] is the covariance of the output at two draws that share X_J
# and whose other inputs are conditionally independent given X_J. Sobol' indices and Shapley effects
# follow from these variances of all sets of inputs, for independent and for dependent inputs. Where
# some draws are inadmissible, they refer to the distribution conditional on admissible draws.
#
# References
# ----------
# Owen, A. B. (2014). SIAM/ASA J. Uncertain. Quantif. 2, 245-251.
# Song, E., Nelson, B. L. & Staum, J. (2016). SIAM/ASA J. Uncertain. Quantif. 4, 1060-1083.

# Number of pairs for each set of inputs, smaller where there are many sets. They are drawn in
# replicates, whose scatter gives the error.
_MOST_PAIRS = 2**16
_FEWEST_PAIRS = 2**12
_EVALUATIONS = 2**20
_REPLICATES = 16
# With more inputs than this, only sets of one input and of all but one are drawn.
MOST_INPUTS_FOR_ALL_SETS = 10


@dataclass(frozen=True, eq=False)
class VarianceShares:
    """Shares of variances that sets of inputs explain."""

    dimension: int  # number of inputs
    # (...): var E[Y | X_J] / Var Y, by the set J as the bits of a number; of one variable or of
    # several.
    explained: Mapping[int, FloatArray]
    # The same from each part of the pairs, along a first axis.
    replicates: VarianceShares | None = None

    def errors(self, measure: str) -> list[float]:
        """Standard errors of one of the measures below, by the scatter of the replicates."""
        found = getattr(self.replicates, measure)
        return (found.std(axis=0, ddof=1) / math.sqrt(len(found))).tolist()

    @property
    def first_order(self) -> FloatArray:
        """Share that each input explains by itself, shape (..., input)."""
        return np.stack([self.explained[1 << i] for i in range(self.dimension)], axis=-1)

    @property
    def total_order(self) -> FloatArray:
        """Share that all other inputs do not explain, for each input."""
        whole = (1 << self.dimension) - 1
        rest = [1 - self.explained[whole ^ 1 << i] for i in range(self.dimension)]
        return np.stack(rest, axis=-1)

    @property
    def shapley(self) -> FloatArray | None:
        """Each input's part, averaged over the orders in which inputs become known."""
        if len(self.explained) < 1 << self.dimension:
            return None
        parts = []
        for i in range(self.dimension):
            others = [subset for subset in range(1 << self.dimension) if not subset >> i & 1]
            gains = [self.explained[each | 1 << i] - self.explained[each] for each in others]
            weights = [1 / math.comb(self.dimension - 1, each.bit_count()) for each in others]
            parts.append(np.tensordot(weights, gains, axes=1) / self.dimension)
        return np.stack(parts, axis=-1)


@dataclass(frozen=True, eq=False)
class PickFreezePairs:
    """Outputs at pairs of draws."""

    dimension: int  # number of random inputs
    first: Mapping[str, FloatArray]  # (pair,): the outputs at the first draw of each pair
    # (pair,): those at the second, by the set of inputs that the two share; 0 is the set of none.
    second: Mapping[int, Mapping[str, FloatArray]]

    def columns(self, names: Sequence[str], most: int | None = None) -> dict[int, FloatArray]:
        """Return some outputs of the pairs, by the shared set; of the first draws by -1.

        Their shape is (pair, output). Pairs with an output that is not finite are left out; of each
        replicate, at most the first `most` are taken.
        """
        count = len(self.first[names[0]])
        rows = np.arange(count).reshape(_REPLICATES, -1)[:, :most].ravel()
        every = {-1: self.first, **self.second}
        drawn = {
            subset: np.column_stack([found[name][rows] for name in names])
            for subset, found in every.items()
        }
        usable = np.all([np.isfinite(each).all(axis=1) for each in drawn.values()], axis=0)
        return {subset: each[usable] for subset, each in drawn.items()}

    def variance_shares(
        self, output: str, function: Callable[[FloatArray], FloatArray]
    ) -> VarianceShares | None:
        """Variance shares of a function of an output; None where it does not vary."""
        with np.errstate(all="ignore"):
            first = function(self.first[output])
            usable = np.isfinite(first)
            if not usable.any() or np.ptp(first[usable]) == 0:
                return None
            centre, variance = first[usable].mean(), first[usable].var()
            unrelated = function(self.second[0][output])
            parts: dict[int, FloatArray] = {0: np.zeros(_REPLICATES)}
            for subset in sorted(self.second.keys() - {0}):
                second = function(self.second[subset][output])
                # Each is exact on average; the one errs little where little is explained, the
                # other where little is left.
                share = _replicate_means((first - centre) * (second - unrelated)) / variance
                rest = _replicate_means((first - second) ** 2) / (2 * variance)
                parts[subset] = share if share.mean() < rest.mean() else 1 - rest
            parts[(1 << self.dimension) - 1] = np.ones(_REPLICATES)
        explained = {subset: np.asarray(part.mean()) for subset, part in parts.items()}
        return VarianceShares(self.dimension, explained, VarianceShares(self.dimension, parts))

    def explained(
        self, output: str, function: Callable[[FloatArray], FloatArray], subset: int
    ) -> FloatArray:
        """Return Var E[function(Y) | X_J] from each replicate, of a set J as bits."""
        first, second, unrelated = (
            function(each[output]) for each in (self.first, self.second[subset], self.second[0])
        )
        centred = first - np.nanmean(first)
        share = _replicate_means(centred * (second - unrelated))
        rest = _replicate_means(centred**2) - self.left(output, function, subset)
        return share if share.std() < rest.std() else rest

    def left(
        self, output: str, function: Callable[[FloatArray], FloatArray], subset: int
    ) -> FloatArray:
        """Return E Var(function(Y) | X_J) from each replicate."""
        first, second = (function(each[output]) for each in (self.first, self.second[subset]))
        return _replicate_means((first - second) ** 2) / 2


def _replicate_means(values: FloatArray) -> FloatArray:
    """Means over the pairs of each replicate, without those that were left out."""
    return np.nanmean(values.reshape(_REPLICATES, -1), axis=1)


def draw_pick_freeze_pairs(
    evaluator: Evaluator, joint: JointDistribution, given: Mapping[str, float], stream: Stream
) -> PickFreezePairs:
    """Draw pairs for all sets of inputs, except the set of all, and evaluate a cheap model at them.

    Values of fixed inputs that are given replace those of the joint distribution.
    """
    dimension = len(joint.random)
    whole = (1 << dimension) - 1
    subsets = list(range(whole))
    if dimension > MOST_INPUTS_FOR_ALL_SETS:
        single = [1 << i for i in range(dimension)]
        subsets = [0, *single, *(whole ^ one for one in single)]
    draws = ConditionalDraws(evaluator, joint, given, stream)
    (found,) = paired_outputs(draws, [evaluator], subsets)
    return found


def paired_outputs(
    draws: ConditionalDraws, evaluators: Sequence[Evaluator], subsets: Sequence[int]
) -> list[PickFreezePairs]:
    """Evaluate several models at the same pairs of draws.

    Parameters
    ----------
    evaluators : sequence of Evaluator
        Their outputs are NaN at draws that never become admissible.
    subsets : sequence of int
        Sets of the inputs that pairs share, as bits; 0, that of none, is one of them.
    """
    dimension = len(draws.joint.random)
    evaluations = len(evaluators) * (len(subsets) + 1)
    pairs = min(max(_EVALUATIONS // evaluations, _FEWEST_PAIRS), _MOST_PAIRS)
    size = (1 << pairs.bit_length() - 1) // _REPLICATES
    generators = [draws.stream.generator("pairs", i) for i in range(_REPLICATES)]
    unit = np.concatenate([sobol_points(each, size, 2 * dimension) for each in generators])
    first = draws.draw(unit[:, :dimension], {}, "first")
    points, rest = first.points, unit[:, dimension:]
    # Others share the value of a discrete input alone: where inputs depend on each other, the place
    # within its step says more than the value does.
    is_discrete = [entry.distribution.is_discrete for entry in draws.joint.random]
    if any(is_discrete) and not draws.joint.is_independent:
        points = np.where(is_discrete, draws.probabilities(first.inputs, rest), points)
    second: list[dict[int, Mapping[str, FloatArray]]] = [{} for _ in evaluators]
    for subset in subsets:
        shared = {i: points[:, i] for i in range(dimension) if subset >> i & 1}
        found = draws.draw(rest, shared, f"second {subset}")
        for each, evaluator in zip(second, evaluators, strict=True):
            each[subset] = evaluator(found.inputs).outputs
    return [
        PickFreezePairs(dimension, evaluator(first.inputs).outputs, each)
        for evaluator, each in zip(evaluators, second, strict=True)
    ]


# Enough that the error of sampling is far below that of the fit.
_SAMPLE = SobolSequence(runs=65_536, replicates=16)


@dataclass(frozen=True)
class SurrogateDraws:
    """A fitted surrogate with the joint distribution of its inputs."""

    model: FittedSurrogate
    joint: JointDistribution
    constraints: Sequence[Constraint]  # bounds of the joint distribution
    # Values of fixed inputs that replace those of the joint distribution.
    given: Mapping[str, float]
    stream: Stream  # source of the random numbers

    @cached_property
    def runs(self) -> xr.Dataset:
        """Runs of the surrogate at a sample of the joint distribution."""
        points = first_round(_SAMPLE, self.joint, self.stream.child("sample")).assign(self.given)
        runs = evaluate(self._evaluator, points, {})
        return runs.assign_attrs({SAMPLING: str(_SAMPLE.sampling)})

    @cached_property
    def pairs(self) -> PickFreezePairs:
        """Pairs of draws for all sets of inputs."""
        return draw_pick_freeze_pairs(self._evaluator, self.joint, self.given, self.stream)

    @cached_property
    def all_are_admissible(self) -> bool:
        """True if no draw of the sample is inadmissible."""
        return not bool((self.runs[STATUS].values == Status.INADMISSIBLE).any())

    @cached_property
    def closed_forms(self) -> ClosedForms | None:
        """The surrogate's closed forms, if it has any; None if a draw is inadmissible."""
        is_whole = isinstance(self.model, ClosedForms) and self.all_are_admissible
        return cast(ClosedForms, self.model) if is_whole else None

    def closed_forms_of_output(self, output: str) -> ClosedForms | None:
        """Return the closed forms if they are those of an output; None for draws in their place."""
        forms = self.closed_forms
        return forms if forms is not None and forms.has_closed_form(output) else None

    def closed_forms_of_logarithm(self) -> ClosedForms | None:
        """Return the closed forms if they are those of a logarithm that was fitted."""
        return self.closed_forms if self.joint.is_independent else None

    @property
    def sampling_estimator(self) -> str:
        """Text on the estimation of statistics from the sample."""
        drawn = int((self.runs[STATUS].values == Status.OK).sum())
        return texts.FROM_DRAWS.format(draws=drawn)

    @property
    def pairs_estimator(self) -> str:
        """Text on the estimation of indices from the pairs."""
        if self.joint.conditional_reason:
            return texts.NO_PAIRS
        pairs = len(next(iter(self.pairs.first.values())))
        return texts.FROM_PAIRS.format(pairs=pairs)

    @property
    def estimand(self) -> str:
        """Text on the distribution of the indices, and on first-order ones with dependence."""
        estimand = texts.ESTIMAND if self.all_are_admissible else texts.ESTIMAND_IF_ADMISSIBLE
        if self.joint.is_independent:
            return estimand
        return f"{estimand}; {texts.FIRST_ORDER_INCLUDES}"

    @cached_property
    def _evaluator(self) -> Evaluator:
        return Evaluator(self.model, self.constraints)

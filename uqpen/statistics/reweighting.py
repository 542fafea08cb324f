"""Runs of one joint distribution of the inputs as weighted runs of another: when, and how well.

Kish's effective size alone is no measure of trust: the runs do not show what they have missed.
Three things are asked. The exact variance of the weights, before anything is looked at, is finite.
The effective size is a good part of the runs. And for a probability, there are enough effective
runs with the event, and enough without it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy

from uqpen.core.arrays import Arrays, BoolArray, FloatArray
from uqpen.distributions.copulas import GaussianCopula
from uqpen.distributions.distribution import OPEN_INTERVAL, Distribution
from uqpen.distributions.input_group import InputGroup
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.distributions.univariate import Normal
from uqpen.statistics.weights import effective_sizes, runs_on_a_side

# Rules, by their coverage in simulations (`docs/statistics.md`).

ENOUGH_ON_A_SIDE = 30
"""Effective runs with an event, and without it, that an interval of its probability needs."""

LEAST_SHARE = 0.3
"""Effective size over the number of runs, below which there is no interval."""

ENOUGH_SHARE = 0.5
"""The same, below which a mean is approximate."""


def effective_share(weights: FloatArray) -> FloatArray:
    """Effective size over the number of runs, shape (...) of weights (..., run)."""
    return effective_sizes(weights) / weights.shape[-1]


def has_enough_on_both_sides(weights: FloatArray, events: BoolArray) -> BoolArray:
    """Check for enough effective runs with an event and without it, at any places."""
    return runs_on_a_side(weights, events) >= ENOUGH_ON_A_SIDE


# The weights.


def changed_inputs(one: JointDistribution, other: JointDistribution) -> tuple[str, ...]:
    """Return the random inputs whose distributions differ, with all those of another dependence.

    Both have the same random inputs. What does not differ has no part in the weights, and needs no
    density.
    """
    before = {each.variable.name: each.distribution for each in one.random}
    grouped = {name for joint in (one, other) for group in joint.groups for name in group.inputs}
    found = {
        each.variable.name
        for each in other.random
        if each.variable.name not in grouped and each.distribution != before[each.variable.name]
    }
    for joint, opposite in ((one, other), (other, one)):
        if joint.dependence is not None and joint.dependence != opposite.dependence:
            found |= {*joint.dependence.inputs}
        for group in joint.groups:
            if not any(_are_same(group, each) for each in opposite.groups):
                found |= {*group.inputs}
    return tuple(each.variable.name for each in other.random if each.variable.name in found)


def _are_same(one: InputGroup, other: InputGroup) -> bool:
    """Check that two groups give the same values at the same points of the unit cube."""
    if one is other:
        return True
    if type(one) is not type(other) or one.inputs != other.inputs:
        return False
    unit = np.random.default_rng(0).random((256, len(one.inputs)))
    return np.array_equal(one.values(unit), other.values(unit))


def log_weights(values: Arrays, drawn: JointDistribution, asked: JointDistribution) -> FloatArray:
    """Return the logarithms of the weights of runs under another joint distribution.

    They are those of the density that is asked for over the density of the draws. A design of
    several distributions at once has them as mixtures, one for each input.

    Parameters
    ----------
    values : mapping of str to ndarray, shape (run,)
        The random inputs of the runs, in SI units.
    drawn, asked : JointDistribution
        Of the same random inputs. The points are independent draws of the first. Where they differ,
        both have densities: see `reason_without_weights`.

    Returns
    -------
    ndarray, shape (run,)
        -inf for a run that the joint distribution that is asked for never has.
    """
    names = changed_inputs(drawn, asked)
    over, under = (joint.log_density(values, names) for joint in (asked, drawn))
    return np.where(np.isneginf(over), -np.inf, over - np.where(np.isneginf(over), 0.0, under))


def relative_weights(
    values: Arrays, drawn: JointDistribution, asked: JointDistribution
) -> FloatArray:
    """Return the weights of runs over the largest of them; all 0 where no run can be drawn now.

    The arguments are those of `log_weights`.
    """
    logarithms = log_weights(values, drawn, asked)
    largest = logarithms.max(initial=-np.inf)
    return np.exp(logarithms - (largest if np.isfinite(largest) else 0.0))


# What is known of the weights before any run is looked at.


@dataclass(frozen=True)
class ExpectedWeights:
    """Variance of the weights by the two joint distributions alone."""

    share: float  # the expected effective size over the number of runs; 0 for an infinite variance
    is_exact: bool  # False where the share is at most this
    reason: str = ""  # why the weights have no finite variance, or do not exist; empty otherwise
    input: str = ""  # the input for that reason; empty for a dependence of several


def expected_weights(drawn: JointDistribution, asked: JointDistribution) -> ExpectedWeights:
    """Return what two joint distributions say of the weights, or the reason why there are none.

    The expected effective size of n runs is n / E(w), over the distribution that is asked for. It
    is a product over independent inputs; of dependent ones it is at most that. A normal
    distribution with s times the scale, moved by d standard deviations, has
    s √(2 - s²) exp(-d² / (2 - s²)), and none from s = √2 on.
    """
    names = changed_inputs(drawn, asked)
    for joint in (drawn, asked):
        if reason := joint.reason_without_density(names):
            return ExpectedWeights(0.0, True, reason)
    before = {each.variable.name: each.distribution for each in drawn.random}
    after = {each.variable.name: each.distribution for each in asked.random}
    share = 1.0
    for name in names:
        if before[name] == after[name]:
            continue
        if before[name].is_discrete != after[name].is_discrete:
            reason = f"{name} has single values in one of the two, and a density in the other"
            return ExpectedWeights(0.0, True, reason, name)
        missed = _never_drawn(before[name], after[name])
        if missed is not None:
            reason = f"no run has {name} near {missed:.6g} (SI units), where it may lie now"
            return ExpectedWeights(0.0, True, reason, name)
        expected = _expected_weight(before[name], after[name])
        if math.isinf(expected):
            reason = (
                f"the weights of {name} have no finite variance: its distribution reaches too far "
                "beyond the one that the runs were drawn from"
            )
            return ExpectedWeights(0.0, True, reason, name)
        share /= expected
    joined = [joint.dependence for joint in (drawn, asked)]
    is_joined = any(each is not None and {*each.inputs} & {*names} for each in joined)
    if not _has_finite_variance(drawn, asked):
        reason = "the weights of the copula have no finite variance: it was stronger for the runs"
        return ExpectedWeights(0.0, True, reason)
    return ExpectedWeights(min(share, 1.0), not is_joined)


def _has_finite_variance(drawn: JointDistribution, asked: JointDistribution) -> bool:
    """Check the weights between Gaussian copulas; true for others, where it is not known."""
    one, other = drawn.dependence, asked.dependence
    if not (isinstance(one, GaussianCopula) and isinstance(other, GaussianCopula)):
        return True
    if one.inputs != other.inputs:
        return True
    before, after = (np.linalg.inv(np.array(each.matrix)) for each in (one, other))
    return bool(np.linalg.eigvalsh(2 * after - before).min() > 0)


# Logits of the quantiles over which a weight is averaged, and their distance. Where the weight
# grows as a power of the tail's probability, -0.99 or below, the variance counts as infinite.
_FURTHEST, _STEP, _FLATTEST = 300.0, 0.05, 0.01


def _values(distribution: Distribution) -> tuple[FloatArray, FloatArray]:
    """Return single values or quantiles to both tails, and the logarithms of their shares."""
    if (atoms := distribution.atoms()) is not None:
        return atoms[0], np.log(atoms[1])
    logits = np.arange(-_FURTHEST, _FURTHEST + _STEP, _STEP)
    near = scipy.special.expit(-np.abs(logits))
    values = np.where(logits < 0, distribution.ppf(near), distribution.isf(near))
    return values, np.log(near) + np.log1p(-near) + math.log(_STEP)


def _never_drawn(drawn: Distribution, asked: Distribution) -> float | None:
    """Return a value that one distribution has and the other never; None where there is none."""
    values, shares = _values(asked)
    values = values[shares > math.log(OPEN_INTERVAL[0])]  # of no rarer one there is a draw
    under, over = _log_densities(values, drawn, asked)
    missed = values[np.isneginf(under) & ~np.isneginf(over)]
    return float(missed[0]) if missed.size else None


def _log_densities(values: FloatArray, *distributions: Distribution) -> list[FloatArray]:
    """Return those of distributions that have one: see `reason_without_density`."""
    found = [each.log_density(values) for each in distributions]
    return [each for each in found if each is not None]


@np.errstate(invalid="ignore")  # of a difference of infinite logarithms, which is left out
def _expected_weight(drawn: Distribution, asked: Distribution) -> float:
    """Return the mean of the weight over the distribution that is asked for; infinite for none."""
    pair = (drawn.logarithm() or drawn, asked.logarithm() or asked)
    one, other = pair if all(type(each) is Normal for each in pair) else (drawn, asked)
    are_both = (drawn.logarithm() is None) == (asked.logarithm() is None)
    if are_both and isinstance(one, Normal) and isinstance(other, Normal):
        scale, shift = other.std / one.std, (other.mean - one.mean) / one.std
        rest = 2 - scale**2
        if rest <= 1e-12:  # from the square root of 2 on, but for rounding
            return math.inf
        exponent = shift**2 / rest
        return math.exp(exponent) / (scale * math.sqrt(rest)) if exponent < 700 else math.inf
    values, shares = _values(asked)
    under, over = _log_densities(values, drawn, asked)
    terms = over - under + shares
    if not asked.is_discrete and not (_decays(terms) and _decays(terms[::-1])):
        return math.inf
    return max(float(np.exp(scipy.special.logsumexp(terms[np.isfinite(terms)]))), 1.0)


def _decays(terms: FloatArray) -> bool:
    """Check that logarithms of parts of a mean fall along the last quarter, so that it exists."""
    last = terms[-(len(terms) // 4) :]
    last = last[np.isfinite(last)]
    return last.size < 2 or bool(last[0] - last[-1] > _FLATTEST * _STEP * last.size)

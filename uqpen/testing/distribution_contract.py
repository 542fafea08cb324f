"""Contract tests of the distribution of one input, and of the joint distribution."""

from __future__ import annotations

import pickle

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.joint_distribution import JointDistribution, RandomInput

__all__ = ["check_distribution", "check_joint"]

# Contract test of the distribution of one input.

_PROBABILITIES = np.array([1e-9, 1e-3, 0.1, 0.5, 0.77, 0.999, 1 - 1e-9])

# A quantile rounded to double precision moves the probability by the density times an ulp.
_ROUNDING = 1e-9


def check_distribution(distribution: Distribution) -> None:
    """Check the contract of a distribution of one input.

    Its four functions keep the shape of their argument, are inverse to each other, add up to 1, and
    are accurate in both tails. It survives pickling, as worker processes need it.

    Parameters
    ----------
    distribution : Distribution
        With any parameters.

    Raises
    ------
    AssertionError
        If one of these is broken.
    """
    p = _PROBABILITIES
    assert distribution.is_finite, "every draw is finite, and draws differ"
    values = distribution.ppf(p)
    assert values.dtype == np.float64
    for function in (distribution.ppf, distribution.isf):
        assert function(p.reshape(7, 1)).shape == (7, 1), "functions keep the shape of an array"
    assert np.all(np.diff(values) >= 0), "ppf does not decrease"
    np.testing.assert_allclose(
        distribution.isf(p[::-1]),
        distribution.ppf(1 - p[::-1]),
        rtol=1e-6,
        err_msg="isf(p) = ppf(1 - p)",
    )
    inner = np.unique(values)
    again = pickle.loads(pickle.dumps(distribution))
    assert np.array_equal(again.ppf(p), values), "a pickled copy is the same distribution"
    if distribution.is_discrete:
        values = distribution.ppf(p)
        below, above = distribution.cdf(values), distribution.sf(values)
        np.testing.assert_allclose(below + above, 1.0, rtol=_ROUNDING, err_msg="cdf + sf = 1")
        assert np.all(below >= p * (1 - _ROUNDING)), "cdf(ppf(p)) is p or more"
        assert np.all(above <= (1 - p) + _ROUNDING), "sf(ppf(p)) is 1 - p or less"
        before = distribution.cdf(values - _ROUNDING * (1 + np.abs(values)))
        assert np.all(before <= p + _ROUNDING), "ppf(p) is the smallest value with a cdf of p"
        return
    below, above = distribution.cdf(inner), distribution.sf(inner)
    np.testing.assert_allclose(below + above, 1.0, rtol=_ROUNDING, err_msg="cdf + sf = 1")
    np.testing.assert_allclose(
        distribution.cdf(distribution.ppf(p)),
        p,
        rtol=1e-6,
        atol=_ROUNDING,
        err_msg="cdf(ppf(p)) = p",
    )
    np.testing.assert_allclose(
        distribution.sf(distribution.isf(p)), p, rtol=1e-6, atol=_ROUNDING, err_msg="sf(isf(p)) = p"
    )


# Contract test of the joint distribution of the inputs.


# Number of standard errors within which a mean of draws is expected: 1 of 16 000 is outside.
_ERRORS = 4.0


def check_joint(joint: JointDistribution) -> None:
    """Check the contract of the joint distribution of a study's inputs.

    Every draw is finite and depends on its own point of the unit cube alone; the nominal point has
    all inputs; each input follows its own distribution, where that is known; independent inputs
    depend on their own coordinates alone. It survives pickling.

    Parameters
    ----------
    joint : JointDistribution
        With at least one random input.

    Raises
    ------
    AssertionError
        If one of these is broken.
    """
    names = [entry.variable.name for entry in joint.random]
    unit = np.random.default_rng(1).random((4_000, len(names)))
    values = _draws(joint, unit)
    for name in names:
        assert np.isfinite(values[name]).all(), f"draws of {name} are finite"
    assert joint.nominal().keys() == {entry.variable.name for entry in joint.inputs}
    assert all(map(np.isfinite, joint.nominal().values())), "the nominal point is finite"
    for rows in (slice(7), slice(1_500, 1_501), slice(None, None, -1)):
        for name, part in _draws(joint, unit[rows]).items():
            assert np.array_equal(part, values[name][rows]), f"a draw of {name} depends on others"
    again = _draws(pickle.loads(pickle.dumps(joint)), unit)
    assert all(np.array_equal(again[name], values[name]) for name in names), "a copy is the same"
    for entry in joint.random:
        if entry.variable.name not in joint.implicit_inputs:
            _check_margin(entry, values[entry.variable.name])
    assert joint.is_independent == (not joint.dependence_text), "dependence has a text"
    moved = unit.copy()
    moved[:, 0] = 1 - unit[:, 0]
    if joint.is_independent:
        others = _draws(joint, moved)
        for name in [*values][1:]:
            assert np.array_equal(others[name], values[name]), f"{name} depends on others"
    if not joint.conditional_reason:
        given = {0: unit[:, 0]}
        found = joint.conditional_probabilities(moved, given)
        assert np.array_equal(found[:, 0], unit[:, 0]), "a given input is unchanged"


def _draws(joint: JointDistribution, unit: FloatArray) -> dict[str, FloatArray]:
    points = joint.points(unit, {})
    return {entry.variable.name: points[entry.variable.name].values for entry in joint.random}


def _check_margin(entry: RandomInput, values: FloatArray) -> None:
    """Check the share of draws at or below three quantiles of an input's own distribution."""
    quantiles = entry.distribution.ppf(np.array([0.1, 0.5, 0.8]))
    expected = entry.distribution.cdf(quantiles)
    found = (values[:, None] <= quantiles).mean(axis=0)
    error = np.sqrt(expected * (1 - expected) / len(values))
    rule = f"draws of {entry.variable.name} follow its own distribution"
    assert np.all(np.abs(found - expected) <= _ERRORS * error + _ROUNDING), rule

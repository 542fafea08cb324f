"""Contract test of the distribution of one input."""

from __future__ import annotations

import pickle

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.distributions.distribution import Distribution

__all__ = ["check_distribution"]

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
        _check_steps(distribution, p)
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


def _check_steps(distribution: Distribution, p: FloatArray) -> None:
    """Check the functions of a discrete distribution, whose cdf is a step at each value."""
    values = distribution.ppf(p)
    below, above = distribution.cdf(values), distribution.sf(values)
    np.testing.assert_allclose(below + above, 1.0, rtol=_ROUNDING, err_msg="cdf + sf = 1")
    assert np.all(below >= p * (1 - _ROUNDING)), "cdf(ppf(p)) is p or more"
    assert np.all(above <= (1 - p) + _ROUNDING), "sf(ppf(p)) is 1 - p or less"
    before = distribution.cdf(values - _ROUNDING * (1 + np.abs(values)))
    assert np.all(before <= p + _ROUNDING), "ppf(p) is the smallest value with a cdf of p"

"""Choice of the threshold beyond which a tail is fitted."""

from __future__ import annotations

from collections.abc import Iterator

from uqpen.core.arrays import FloatArray
from uqpen.statistics.tails.generalised_pareto import fit_tails
from uqpen.statistics.tails.goodness_of_fit import p_value
from uqpen.statistics.tails.profile_likelihood import FittedTail

__all__ = ["FEWEST_BEYOND", "FEWEST_RUNS", "fitting_tails"]

FEWEST_BEYOND = 50
"""Number of runs beyond a threshold that a fit needs."""

FEWEST_RUNS = 500
"""Number of runs that a fit needs: a tail has a tenth of them at the most."""

# The error of a fit falls with the runs beyond, and its bias rises: the number grows slowly.
_FACTOR, _POWER = 10.0, 1 / 3
_STEP = 2**0.5
# A fit with a smaller p-value is rejected.
_SMALLEST_P_VALUE = 0.1


def fitting_tails(ordered: FloatArray) -> Iterator[FittedTail]:
    """Yield the tails that a generalised Pareto distribution fits, from the lowest threshold.

    The thresholds leave min(n/10, 10 n^(1/3)) of n runs beyond them, then 1/√2 of the runs before,
    down to 50. A fit is rejected where Anderson and Darling's p-value is below 0.1.

    Parameters
    ----------
    ordered : ndarray, shape (run,)
        The values, ascending.
    """
    runs = len(ordered)
    beyond = min(runs / 10, _FACTOR * runs**_POWER)
    while round(beyond) >= FEWEST_BEYOND:
        number = round(beyond)
        threshold = float(ordered[runs - number - 1])
        excesses = ordered[runs - number :] - threshold
        excesses = excesses[excesses > 0]  # a value may stand in several runs
        if len(excesses) >= FEWEST_BEYOND and excesses[0] < excesses[-1]:
            fit = fit_tails(excesses)
            shape, scale = float(fit.shape), float(fit.scale)
            found = p_value(float(fit.anderson_darling), shape)
            if found >= _SMALLEST_P_VALUE:
                yield FittedTail(ordered, threshold, excesses, shape, scale, found)
        beyond /= _STEP

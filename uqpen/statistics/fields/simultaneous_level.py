"""The level at which the intervals at all places of a field hold at once.

A simultaneous band consists of the intervals at each place, at a common level above the stated one.
The level follows from how the errors at the places depend on each other: they are simulated, and
the furthest of all places counts.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from functools import lru_cache

import numpy as np
from scipy import special

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.streams import Stream
from uqpen.statistics.sample import ErrorModel, Sample

__all__ = ["simultaneous_level"]

# The rank of the level among one more than these is a whole number for 90, 95 and 99 %.
_DRAWS = 999
# More runs are added up in so many groups, which show the dependence between places as well.
_MOST_GROUPS = 1024
# Numbers that are simulated together, so that memory is bounded: 32 MB.
_MOST_VALUES = 2**22


def simultaneous_level(runs: Sample, deviations: Iterable[FloatArray]) -> float:
    """Return the level at which intervals at all places hold at once with the sample's level.

    Parameters
    ----------
    runs : Sample
        All runs of a field. Replicates, where there are any, are the only independent groups.
    deviations : iterable of ndarray, shape (run, place)
        Influence of each run on the estimate at each place, in blocks of places. At each place
        they add up to zero, and are 0 in runs that do not reach it.

    Returns
    -------
    float
        At least the sample's level.

    Notes
    -----
    The errors of independent runs are simulated as sums of the deviations times independent normal
    numbers, relative to their standard deviation (Gaussian multiplier bootstrap: Chernozhukov, V.,
    Chetverikov, D. & Kato, K. (2014). Ann. Statist. 42, 1787-1818). Of a few replicates each error
    has a standard deviation of its own, so that one of them is often too small: as many normal
    curves as there are replicates are simulated, with the correlation of their means, and the mean
    of these curves relative to their own standard deviation counts.
    """
    is_replicated = runs.error_model is ErrorModel.REPLICATED
    group = runs.replicate if is_replicated else _groups_of_runs(runs.size)
    groups = int(group[-1]) + 1 if group.size else 0
    draws = max(_DRAWS, math.ceil(runs.level / (1 - runs.level)))
    copies = groups if is_replicated else 1
    normal = _normal_numbers(draws * copies, groups)
    largest = np.zeros(draws)
    for correlated in _correlated(deviations, group, groups, most=_MOST_VALUES // len(normal)):
        # A matrix product is right here: the level is a simulated one, to three digits.
        curves = (normal @ correlated).reshape(draws, copies, -1)
        scores = _studentised(curves) if is_replicated else curves[:, 0]
        np.maximum(largest, np.abs(scores).max(axis=1, initial=0.0), out=largest)
    rank = math.ceil(round(runs.level * (draws + 1), 6))
    critical = float(np.sort(largest)[rank - 1])
    beyond = special.stdtr(groups - 1, -critical) if is_replicated else special.ndtr(-critical)
    return max(1 - 2 * float(beyond), runs.level)


def _groups_of_runs(runs: int) -> IntArray:
    """Return the group of each run, neighbouring runs together."""
    return np.arange(runs) * min(runs, _MOST_GROUPS) // max(runs, 1)


def _correlated(
    deviations: Iterable[FloatArray], group: IntArray, groups: int, *, most: int
) -> Iterator[FloatArray]:
    """Yield the sums of deviations over groups, of shape (group, place), with a norm of 1.

    Places without scatter between groups are left out.
    """
    order = np.argsort(group, kind="stable")
    starts = np.searchsorted(group[order], np.arange(groups))
    for block in deviations:
        sums = np.add.reduceat(block[order], starts, axis=0)
        largest = np.abs(sums).max(axis=0)
        sums = sums[:, largest > 0] / largest[largest > 0]  # so that no square overflows
        sums /= np.sqrt((sums**2).sum(axis=0))
        step = max(most, 1)
        yield from (sums[:, first : first + step] for first in range(0, sums.shape[1], step))


@lru_cache(maxsize=1)
def _normal_numbers(rows: int, columns: int) -> FloatArray:
    """Return the numbers of the simulation, the same for all bands of a field: 8 MB at most."""
    generator = Stream(0, "analyses", "simultaneous bands").generator()
    return generator.standard_normal((rows, columns))


def _studentised(curves: FloatArray) -> FloatArray:
    """Return the means of curves over their standard errors, shape (draw, place)."""
    count = curves.shape[1]
    sums = curves.sum(axis=1)
    squares = np.einsum("dcp,dcp->dp", curves, curves)
    variance = np.maximum(squares - sums**2 / count, 0.0) / (count - 1)
    found: FloatArray = sums / np.sqrt(count * variance)
    return found

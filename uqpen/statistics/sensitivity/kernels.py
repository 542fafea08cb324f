"""Compiled loops over many runs: each goes once through memory where arrays go a dozen times.

Sums are added in one order, and no operation is fused or reordered: the same bits on any processor.
"""

from __future__ import annotations

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.compiled import compiled
from uqpen.statistics.ordering import Numbers

__all__ = [
    "add_sums_above",
    "pair_influence",
    "pair_products",
    "pair_sums",
    "residuals_in_bins",
]

# Terms that are added before their sum is added to the others: the rounding of a long sum.
_TOGETHER = 512


@compiled
def residuals_in_bins(
    runs: Numbers,
    first: IntArray,
    place: FloatArray,
    values: FloatArray,
    fewest_for_a_slope: int,
    influence: FloatArray,
) -> tuple[float, float]:
    """Fit a line to a variable in each bin, and write each run's influence on what is left.

    Parameters
    ----------
    runs : ndarray of int, shape (run,)
        Numbers of the runs, bin by bin.
    first : ndarray of int, shape (bin + 1,)
        Where in `runs` each bin begins, and the last one ends.
    place : ndarray, shape (run,)
        Where in its bin each of `runs` lies, as `RegressionBins` has it.
    values : ndarray, shape (run,)
    fewest_for_a_slope : int
        Fewest runs of a bin with a slope.
    influence : ndarray, shape (run,)
        Is written.

    Returns
    -------
    left, pairs : float
        Unbiased sum of squares about the lines; sum of the squared products of pairs.
    """
    left, all_pairs, part, pairs_part = 0.0, 0.0, 0.0, 0.0
    for b in range(len(first) - 1):
        if b % _TOGETHER == 0:
            left, all_pairs, part, pairs_part = left + part, all_pairs + pairs_part, 0.0, 0.0
        start, stop = first[b], first[b + 1]
        size = float(stop - start)
        freedom = size - 1.0 - (1.0 if size >= fewest_for_a_slope else 0.0)
        scale = size / freedom if freedom > 0 else 0.0
        mean = 0.0
        for j in range(start, stop):
            mean += values[runs[j]]
        mean /= size
        slope = 0.0
        for j in range(start, stop):
            slope += place[j] * (values[runs[j]] - mean)
        squares = 0.0
        s0, s1, s2, own = 0.0, 0.0, 0.0, 0.0
        for j in range(start, stop):
            residual = values[runs[j]] - mean - place[j] * slope
            square = residual * residual
            leverage = 1.0 / size + place[j] * place[j]
            left_out = square / (1.0 - leverage) if leverage < 1.0 else 0.0
            squares += square
            s0 += left_out
            s1 += left_out * place[j]
            s2 += left_out * place[j] * place[j]
            own += (leverage * left_out) ** 2
            influence[runs[j]] = scale * left_out
        pairs = (s0 / size) ** 2 + 2.0 * s1 * s1 / size + s2 * s2 - own
        part += scale * squares
        pairs_part += scale * scale * max(pairs, 0.0)
        shift = (scale - 1.0) * scale * squares / size
        for j in range(start, stop):
            influence[runs[j]] -= shift
    return left + part, all_pairs + pairs_part


@compiled
def pair_sums(columns: FloatArray, summed: IntArray, weights: FloatArray) -> FloatArray:
    """Add up two weighted sums of columns, shape (2, run), a block of runs after the other.

    Parameters
    ----------
    columns : ndarray, shape (column, run)
    summed : ndarray of int
        Numbers of the columns that have a weight.
    weights : ndarray, shape (2, column)
    """
    runs = columns.shape[1]
    sums = np.zeros((2, runs))
    for start in range(0, runs, _TOGETHER):
        stop = min(start + _TOGETHER, runs)
        one, other = sums[0, start:stop], sums[1, start:stop]
        for k in summed:
            column, weight, other_weight = columns[k, start:stop], weights[0, k], weights[1, k]
            for r in range(len(column)):
                one[r] += weight * column[r]
                other[r] += other_weight * column[r]
    return sums


@compiled
def pair_products(sums: FloatArray) -> tuple[float, float, float]:
    """Mean squares of two rows, shape (2, run), and their mean product."""
    runs = sums.shape[1]
    square, other_square, product = 0.0, 0.0, 0.0
    for start in range(0, runs, _TOGETHER):
        part, other_part, product_part = 0.0, 0.0, 0.0
        for r in range(start, min(start + _TOGETHER, runs)):
            one, other = sums[0, r], sums[1, r]
            part += one * one
            other_part += other * other
            product_part += one * other
        square += part
        other_square += other_part
        product += product_part
    return square / runs, other_square / runs, product / runs


@compiled
def pair_influence(
    sums: FloatArray, stds: FloatArray, value: float, targets: FloatArray, influence: FloatArray
) -> None:
    """Write each run's influence on the correlation `value` of two rows, of standard deviations.

    `targets`, shape (run, 2), become what each row lacks of the other.
    """
    for r in range(sums.shape[1]):
        one, other = sums[0, r] / stds[0], sums[1, r] / stds[1]
        influence[r] = one * other - value / 2.0 * (one * one + other * other)
        targets[r, 0] = other - value * one
        targets[r, 1] = one - value * other


@compiled
def add_sums_above(
    order: Numbers,
    is_above: BoolArray,
    targets: FloatArray,
    weights: tuple[float, float],
    influence: FloatArray,
) -> None:
    """Add to each run the weighted sum of two targets over the runs above; an equal one is half.

    `order` and `is_above` are those of an `Ordering`; an empty `is_above` has no equal values.
    """
    one, other = weights
    above = 0.0
    if len(is_above) == 0:
        for j in range(len(order) - 1, -1, -1):
            at = one * targets[order[j], 0] + other * targets[order[j], 1]
            influence[order[j]] += above + at / 2.0
            above += at
        return
    stop = len(order)
    while stop > 0:
        start = stop - 1
        while not is_above[start]:
            start -= 1
        total = 0.0
        for j in range(start, stop):
            total += one * targets[order[j], 0] + other * targets[order[j], 1]
        for j in range(start, stop):
            influence[order[j]] += above + total / 2.0
        above += total
        stop = start

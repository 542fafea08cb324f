"""Compiled loops over many runs: each goes once through memory where arrays go a dozen times.

Sums are added in one order, and no operation is fused or reordered: the same bits on any processor.
"""

from __future__ import annotations

import math

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
# Runs whose columns, up to hundreds, stay in a processor's cache.
_IN_A_BLOCK = 128


@compiled
def residuals_in_bins(
    runs: Numbers,
    first: IntArray,
    rank: Numbers,
    values: FloatArray,
    fewest_for_a_slope: int,
    influence: FloatArray,
) -> FloatArray:
    """Fit a line to a variable in each bin, and add up each run's influence on what is left.

    A run's square and its influence are nearly equal where the input explains nothing, and far
    apart where it explains all. So there are sums of products with their difference too.

    Parameters
    ----------
    runs : ndarray of int, shape (run,)
        Numbers of the runs, bin by bin.
    first : ndarray of int, shape (bin + 1,)
        Where in `runs` each bin begins, and the last one ends.
    rank : ndarray of int, shape (run,)
        Rank of the input in each of `runs`.
    values : ndarray, shape (run,)
        Of variance 1.
    fewest_for_a_slope : int
        Fewest runs of a bin with a slope.
    influence : ndarray, shape (run,) or (0,)
        Is written, unless it is empty.

    Returns
    -------
    ndarray, shape (9,)
        Unbiased sum of squares about the lines; sum of the squared products of pairs. Of the square
        of a value less 1, s, of the influence l and of their difference d the sums of s, l, s s,
        l l, d d, s l, s d.
    """
    largest = 0
    for b in range(len(first) - 1):
        largest = max(largest, first[b + 1] - first[b])
    place, own, lost = np.empty((3, largest))
    whole, part = np.zeros(9), np.zeros(9)
    for b in range(len(first) - 1):
        if b % _TOGETHER == 0:
            whole += part
            part[:] = 0.0
        start, count = first[b], first[b + 1] - first[b]
        in_bin = runs[start : start + count]
        has_slope = count >= fewest_for_a_slope
        _take_bin(in_bin, rank[start : start + count], values, has_slope, place, own)
        _add_residuals(place[:count], own[:count], has_slope, lost, part)
        _add_influence(own[:count], lost, part)
        if len(influence):
            for j in range(count):
                influence[in_bin[j]] = lost[j]
    return whole + part


@compiled
def _take_bin(
    runs: Numbers,
    rank: Numbers,
    values: FloatArray,
    has_slope: bool,
    place: FloatArray,
    own: FloatArray,
) -> None:
    """Write the values of the runs of a bin, and their places: of mean 0 and sum of squares 1."""
    middle, spread = 0.0, 0.0
    for j in range(len(runs)):
        own[j] = values[runs[j]]
        place[j] = rank[j]
        middle += place[j]
    middle /= float(len(runs))
    for j in range(len(runs)):
        place[j] -= middle
        spread += place[j] * place[j]
    factor = 1.0 / math.sqrt(spread) if has_slope else 0.0
    for j in range(len(runs)):
        place[j] *= factor


@compiled
def _add_residuals(
    place: FloatArray, own: FloatArray, has_slope: bool, lost: FloatArray, part: FloatArray
) -> None:
    """Fit the line of a bin, add its two sums, and write each run's influence on the first."""
    size, mean, slope = float(len(own)), 0.0, 0.0
    freedom = size - 1.0 - (1.0 if has_slope else 0.0)
    scale = size / freedom if freedom > 0 else 0.0
    for j in range(len(own)):
        mean += own[j]
    mean /= size
    for j in range(len(own)):
        slope += place[j] * (own[j] - mean)
    squares, s0, s1, s2, diagonal = 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(len(own)):
        residual = own[j] - mean - place[j] * slope
        leverage = 1.0 / size + place[j] * place[j]
        square = residual * residual
        left_out = square / (1.0 - leverage) if leverage < 1.0 else 0.0
        lost[j] = left_out
        squares += square
        s0 += left_out
        s1 += left_out * place[j]
        s2 += left_out * place[j] * place[j]
        diagonal += (leverage * left_out) ** 2
    pairs = (s0 / size) ** 2 + 2.0 * s1 * s1 / size + s2 * s2 - diagonal
    part[0] += scale * squares
    part[1] += scale * scale * max(pairs, 0.0)
    shift = (scale - 1.0) * scale * squares / size
    for j in range(len(own)):
        lost[j] = scale * lost[j] - shift


@compiled
def _add_influence(own: FloatArray, lost: FloatArray, part: FloatArray) -> None:
    """Add the sums over the runs of a bin of what `residuals_in_bins` names."""
    sums = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for j in range(len(own)):
        square = own[j] * own[j] - 1.0
        difference = square - lost[j]
        sums = (
            sums[0] + square,
            sums[1] + lost[j],
            sums[2] + square * square,
            sums[3] + lost[j] * lost[j],
            sums[4] + difference * difference,
            sums[5] + square * lost[j],
            sums[6] + square * difference,
        )
    for k, total in enumerate(sums):
        part[2 + k] += total


@compiled
def pair_sums(columns: FloatArray, weights: FloatArray) -> FloatArray:
    """Add up two weighted sums of columns for each pair, shape (pair, run, 2).

    All pairs take a block of runs after the other, so columns go once through memory.

    Parameters
    ----------
    columns : ndarray, shape (column, run)
    weights : ndarray, shape (pair, 2, column)
    """
    runs = columns.shape[1]
    sums = np.empty((len(weights), runs, 2))
    one, other = np.empty((2, _IN_A_BLOCK))
    for start in range(0, runs, _IN_A_BLOCK):
        count = min(_IN_A_BLOCK, runs - start)
        for p in range(len(weights)):
            one[:], other[:] = 0.0, 0.0
            for k in range(len(columns)):
                weight, other_weight = weights[p, 0, k], weights[p, 1, k]
                if weight != 0.0 or other_weight != 0.0:
                    column = columns[k, start : start + count]
                    for r in range(count):
                        one[r] += weight * column[r]
                        other[r] += other_weight * column[r]
            for r in range(count):
                sums[p, start + r, 0] = one[r]
                sums[p, start + r, 1] = other[r]
    return sums


@compiled
def pair_products(sums: FloatArray) -> tuple[float, float, float]:
    """Mean squares of two sums, shape (run, 2), and their mean product."""
    runs = len(sums)
    square, other_square, product = 0.0, 0.0, 0.0
    for start in range(0, runs, _TOGETHER):
        part, other_part, product_part = 0.0, 0.0, 0.0
        for r in range(start, min(start + _TOGETHER, runs)):
            one, other = sums[r, 0], sums[r, 1]
            part += one * one
            other_part += other * other
            product_part += one * other
        square += part
        other_square += other_part
        product += product_part
    return square / runs, other_square / runs, product / runs


@compiled
def pair_influence(sums: FloatArray, stds: FloatArray, value: float, influence: FloatArray) -> None:
    """Write each run's influence on the correlation `value` of two sums, of standard deviations.

    `sums`, shape (run, 2), become what each of them, of variance 1, lacks of the other.
    """
    for r in range(len(sums)):
        one, other = sums[r, 0] / stds[0], sums[r, 1] / stds[1]
        influence[r] = one * other - value / 2.0 * (one * one + other * other)
        sums[r, 0] = other - value * one
        sums[r, 1] = one - value * other


@compiled
def add_sums_above(
    orders: Numbers,
    is_above: BoolArray,
    factors: FloatArray,
    targets: FloatArray,
    influence: FloatArray,
) -> None:
    """Add to each run the weighted sum of two targets over the runs above; an equal one is half.

    Parameters
    ----------
    orders : ndarray of int, shape (column, run)
        Of each column that of its `Ordering`.
    is_above : ndarray of bool, shape (column, run) or (0, 0)
        As `Ordering` has it; empty where no column has equal values.
    factors : ndarray, shape (column, 2)
        Of the targets.
    targets : ndarray, shape (run, 2)
    influence : ndarray, shape (run,)
        Is added to.
    """
    for k in range(len(orders)):
        one, other = factors[k]
        if one == 0.0 and other == 0.0:
            continue
        if len(is_above):
            _add_sums_above_ties(orders[k], is_above[k], one, other, targets, influence)
            continue
        order, above = orders[k], 0.0
        for j in range(len(order) - 1, -1, -1):
            at = one * targets[order[j], 0] + other * targets[order[j], 1]
            influence[order[j]] += above + at / 2.0
            above += at


@compiled
def _add_sums_above_ties(
    order: Numbers,
    is_above: BoolArray,
    one: float,
    other: float,
    targets: FloatArray,
    influence: FloatArray,
) -> None:
    above, stop = 0.0, len(order)
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

"""Compiled loops over many runs: each goes once through memory where arrays go a dozen times.

Sums are added in one order, and no operation is fused or reordered: the same bits on any processor.
Arrays of other types than a loop states are refused, and those that it reads may be read-only.
Memory for all runs comes from the caller: NumPy takes it in larger pages than Numba does.
"""

from __future__ import annotations

import math

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.models.compiled import compiled, inlined
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
# Sums that `residuals_in_bins` finds.
_SUMS = 9

# Arrays that are read, in one piece.
_READ = {
    kind: [f"Array({kind}, {axes}, 'C', True)" for axes in range(4)]
    for kind in ("float64", "int32", "int64", "boolean")
}
_FLOATS, _NUMBERS = _READ["float64"], _READ["int32"]


@inlined
def _take_bin(
    runs: Numbers,
    start: int,
    count: int,
    rank: Numbers,
    values: FloatArray,
    has_slope: bool,
    place: FloatArray,
    own: FloatArray,
) -> None:
    """Write the values of the runs of a bin, and their places: of mean 0 and sum of squares 1."""
    middle, spread = 0.0, 0.0
    for j in range(count):
        own[j] = values[runs[start + j]]
        place[j] = float(rank[start + j])
        middle += place[j]
    middle /= float(count)
    for j in range(count):
        place[j] -= middle
        spread += place[j] * place[j]
    factor = 1.0 / math.sqrt(spread) if has_slope else 0.0
    for j in range(count):
        place[j] *= factor


@inlined
def _add_residuals(
    count: int,
    place: FloatArray,
    own: FloatArray,
    has_slope: bool,
    lost: FloatArray,
    part: FloatArray,
) -> None:
    """Fit the line of a bin, add its two sums, and write each run's influence on the first."""
    size, mean, slope = float(count), 0.0, 0.0
    freedom = size - 1.0 - (1.0 if has_slope else 0.0)
    scale = size / freedom if freedom > 0 else 0.0
    for j in range(count):
        mean += own[j]
    mean /= size
    for j in range(count):
        slope += place[j] * (own[j] - mean)
    squares, s0, s1, s2, diagonal = 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(count):
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
    for j in range(count):
        lost[j] = scale * lost[j] - shift


@inlined
def _add_influence(count: int, own: FloatArray, lost: FloatArray, part: FloatArray) -> None:
    """Add the sums over the runs of a bin of what `residuals_in_bins` names."""
    s, left, ss, ll, dd, sl, sd = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(count):
        square = own[j] * own[j] - 1.0
        difference = square - lost[j]
        s += square
        left += lost[j]
        ss += square * square
        ll += lost[j] * lost[j]
        dd += difference * difference
        sl += square * lost[j]
        sd += square * difference
    part[2] += s
    part[3] += left
    part[4] += ss
    part[5] += ll
    part[6] += dd
    part[7] += sl
    part[8] += sd


@compiled(
    f"float64[::1]({_NUMBERS[1]}, {_READ['int64'][1]}, {_NUMBERS[1]}, {_FLOATS[1]}, int64, "
    "float64[::1])"
)
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
        Becomes that of each run on the first of the sums, unless it is empty.

    Returns
    -------
    ndarray, shape (9,)
        Unbiased sum of squares about the lines; sum of the squared products of pairs. Of the square
        of a value less 1, s, of the influence l and of their difference d the sums of s, l, s s,
        l l, d d, s l, s d.
    """
    sums, part = np.zeros(_SUMS), np.zeros(_SUMS)
    bins, largest = len(first) - 1, 0
    for b in range(bins):
        largest = max(largest, first[b + 1] - first[b])
    place, own, lost = np.empty(largest), np.empty(largest), np.empty(largest)
    for b in range(bins):
        if b % _TOGETHER == 0:
            for k in range(_SUMS):
                sums[k] += part[k]
                part[k] = 0.0
        start, count = first[b], first[b + 1] - first[b]
        has_slope = count >= fewest_for_a_slope
        _take_bin(runs, start, count, rank, values, has_slope, place, own)
        _add_residuals(count, place, own, has_slope, lost, part)
        _add_influence(count, own, lost, part)
        if len(influence) > 0:
            for j in range(count):
                influence[runs[start + j]] = lost[j]
    for k in range(_SUMS):
        sums[k] += part[k]
    return sums


@compiled(f"void({_FLOATS[2]}, {_FLOATS[3]}, float64[:, :, ::1])")
def pair_sums(columns: FloatArray, weights: FloatArray, sums: FloatArray) -> None:
    """Add up two weighted sums of columns for each pair.

    All pairs take a block of runs after the other, so columns go once through memory.

    Parameters
    ----------
    columns : ndarray, shape (column, run)
    weights : ndarray, shape (pair, 2, column)
    sums : ndarray, shape (pair, run, 2)
        Is written.
    """
    count, runs = columns.shape
    pairs = len(weights)
    one, other = np.empty(_IN_A_BLOCK), np.empty(_IN_A_BLOCK)
    for start in range(0, runs, _IN_A_BLOCK):
        size = min(_IN_A_BLOCK, runs - start)
        for p in range(pairs):
            for k in range(count):
                weight, other_weight = weights[p, 0, k], weights[p, 1, k]
                if k == 0:
                    for r in range(size):
                        one[r] = weight * columns[k, start + r]
                        other[r] = other_weight * columns[k, start + r]
                elif weight != 0.0 or other_weight != 0.0:
                    for r in range(size):
                        one[r] += weight * columns[k, start + r]
                        other[r] += other_weight * columns[k, start + r]
            found = sums[p].ravel()
            for r in range(size):
                found[2 * (start + r)] = one[r]
                found[2 * (start + r) + 1] = other[r]


@compiled(f"UniTuple(float64, 3)({_FLOATS[2]})")
def pair_products(sums: FloatArray) -> tuple[float, float, float]:
    """Return the mean squares of two sums, shape (run, 2), and their mean product."""
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


@compiled("void(float64[:, ::1], float64, float64, float64, float64[::1])")
def pair_influence(
    sums: FloatArray, std: float, other_std: float, value: float, influence: FloatArray
) -> None:
    """Write each run's influence on the correlation `value` of two sums, of standard deviations.

    `sums`, shape (run, 2), become what each of them, of variance 1, lacks of the other.
    """
    flat = sums.ravel()
    for r in range(len(sums)):
        one, other = flat[2 * r] / std, flat[2 * r + 1] / other_std
        influence[r] = one * other - value / 2.0 * (one * one + other * other)
        flat[2 * r] = other - value * one
        flat[2 * r + 1] = one - value * other


@inlined
def _sums_above(
    order: Numbers, one: float, other: float, targets: FloatArray, sums: FloatArray
) -> None:
    """Write the sums over the runs above, in the order of a column."""
    above = 0.0
    for j in range(len(order) - 1, -1, -1):
        at = one * targets[2 * order[j]] + other * targets[2 * order[j] + 1]
        sums[j] = above + at / 2.0
        above += at


@inlined
def _sums_above_equal(
    order: Numbers,
    is_above: BoolArray,
    level: Numbers,
    one: float,
    other: float,
    targets: FloatArray,
    sums: FloatArray,
) -> None:
    """Write the same sum for all runs of equal values, at their level."""
    above, stop = 0.0, len(order)
    while stop > 0:
        start = stop - 1
        while not is_above[start]:
            start -= 1
        total = 0.0
        for j in range(start, stop):
            total += one * targets[2 * order[j]] + other * targets[2 * order[j] + 1]
        sums[level[order[start]]] = above + total / 2.0
        above += total
        stop = start


@compiled(
    f"void({_NUMBERS[2]}, {_READ['boolean'][2]}, {_NUMBERS[2]}, Array(float64, 2, 'A', True), "
    f"{_FLOATS[2]}, float64[::1], float64[::1])"
)
def add_sums_above(
    orders: Numbers,
    is_above: BoolArray,
    levels: Numbers,
    factors: FloatArray,
    targets: FloatArray,
    sums: FloatArray,
    influence: FloatArray,
) -> None:
    """Add to each run the weighted sum of two targets over the runs above; an equal one is half.

    The sums are written in the order of a column, and read at random afterwards: to write at random
    takes several times as long.

    Parameters
    ----------
    orders, levels : ndarray of int, shape (column, run)
        Of each column those of its `Ordering`.
    is_above : ndarray of bool, shape (column, run) or (0, 0)
        As `Ordering` has it; empty where no column has equal values.
    factors : ndarray, shape (column, 2)
        Of the targets.
    targets : ndarray, shape (run, 2)
    sums : ndarray, shape (run,)
        Memory.
    influence : ndarray, shape (run,)
        Is added to.
    """
    columns, runs = orders.shape
    flat = targets.ravel()
    for k in range(columns):
        one, other = factors[k, 0], factors[k, 1]
        if one == 0.0 and other == 0.0:
            continue
        if len(is_above) > 0:
            _sums_above_equal(orders[k], is_above[k], levels[k], one, other, flat, sums)
        else:
            _sums_above(orders[k], one, other, flat, sums)
        for r in range(runs):
            influence[r] += sums[levels[k, r]]

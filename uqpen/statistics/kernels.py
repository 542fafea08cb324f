"""Loops over many runs: each goes once through memory where arrays go a dozen times.

Each is a function for C of flat arrays, compiled by Numba: `loops` calls it, and has its machine
code on disk. So memory comes from the caller, no function is called that is not compiled into it,
and all of it stands in this file, whose hash decides whether the code on disk is of this version.
Sums are added in one order, and no operation is fused or reordered: the same bits on any processor.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from uqpen.models.compiled import inlined

__all__ = [
    "add_sums_above",
    "pair_influence",
    "pair_products",
    "pair_sums",
    "residuals_in_bins",
    "sort_words",
]

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Numbers = npt.NDArray[np.int32]
Flags = npt.NDArray[np.uint8]
Words = npt.NDArray[np.uint64]

# Terms that are added before their sum is added to the others: the rounding of a long sum.
_TOGETHER = 512
# Sums that `residuals_in_bins` finds.
_SUMS = 9
# Digits of a word that is sorted, each of up to 16 bits.
_DIGITS = 4


def residuals_in_bins(
    runs: Numbers,
    first: Integers,
    bins: int,
    rank: Numbers,
    values: Floats,
    fewest_for_a_slope: int,
    place: Floats,
    own: Floats,
    lost: Floats,
    part: Floats,
    influence: Floats,
    is_written: int,
    found: Floats,
) -> None:
    """Fit a line to a variable in each bin, and add up each run's influence on what is left.

    A run's square and its influence are nearly equal where the input explains nothing, and far
    apart where it explains all. So there are sums of products with their difference too.

    Parameters
    ----------
    runs : ndarray of int, shape (run,)
        Numbers of the runs, bin by bin.
    first : ndarray of int, shape (bin + 1,)
        Where in `runs` each bin begins, and the last one ends.
    bins : int
        Number of bins.
    rank : ndarray of int, shape (run,)
        Rank of the input in each of `runs`.
    values : ndarray, shape (run,)
        Of variance 1.
    fewest_for_a_slope : int
        Fewest runs of a bin with a slope.
    place, own, lost : ndarray
        Memory for the runs of the largest bin.
    part : ndarray, shape (9,)
        Memory, which is 0.
    influence : ndarray, shape (run,) or (0,)
        Is written if `is_written` is not 0.
    found : ndarray, shape (9,)
        Is 0, and becomes: unbiased sum of squares about the lines; sum of the squared products of
        pairs. Of the square of a value less 1, s, of the influence l and of their difference d the
        sums of s, l, s s, l l, d d, s l, s d.
    """
    for b in range(bins):
        if b % _TOGETHER == 0:
            for k in range(_SUMS):
                found[k] += part[k]
                part[k] = 0.0
        start, count = first[b], first[b + 1] - first[b]
        has_slope = count >= fewest_for_a_slope
        _take_bin(runs, start, count, rank, values, has_slope, place, own)
        _add_residuals(count, place, own, has_slope, lost, part)
        _add_influence(count, own, lost, part)
        if is_written:
            for j in range(count):
                influence[runs[start + j]] = lost[j]
    for k in range(_SUMS):
        found[k] += part[k]


@inlined
def _take_bin(
    runs: Numbers,
    start: int,
    count: int,
    rank: Numbers,
    values: Floats,
    has_slope: bool,
    place: Floats,
    own: Floats,
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
    factor = 1.0 / spread**0.5 if has_slope else 0.0  # a root by name is a call
    for j in range(count):
        place[j] *= factor


@inlined
def _add_residuals(
    count: int, place: Floats, own: Floats, has_slope: bool, lost: Floats, part: Floats
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
def _add_influence(count: int, own: Floats, lost: Floats, part: Floats) -> None:
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


def pair_sums(
    columns: Floats,
    runs: int,
    count: int,
    weights: Floats,
    pairs: int,
    blocks: int,
    together: int,
    rest: int,
    one: Floats,
    other: Floats,
    sums: Floats,
) -> None:
    """Add up two weighted sums of columns for each pair.

    All pairs take a block of runs after the other, so columns go once through memory.

    Parameters
    ----------
    columns : ndarray, shape (column, run)
    runs, count : int
        Number of runs, and of columns.
    weights : ndarray, shape (pair, 2, column)
    pairs : int
        Number of pairs.
    blocks, together, rest : int
        Number of whole blocks, runs of each of them, and runs behind them.
    one, other : ndarray
        Memory for the sums of a block.
    sums : ndarray, shape (pair, run, 2)
        Is written.
    """
    for block in range(blocks):
        start = block * together
        _sums_of_block(columns, runs, count, weights, pairs, start, together, one, other, sums)
    start = blocks * together
    _sums_of_block(columns, runs, count, weights, pairs, start, rest, one, other, sums)


@inlined
def _sums_of_block(
    columns: Floats,
    runs: int,
    count: int,
    weights: Floats,
    pairs: int,
    start: int,
    size: int,
    one: Floats,
    other: Floats,
    sums: Floats,
) -> None:
    """Write both sums of all pairs in some neighbouring runs."""
    for p in range(pairs):
        weight, other_weight = weights[2 * p * count], weights[(2 * p + 1) * count]
        for r in range(size):
            one[r] = weight * columns[start + r]
            other[r] = other_weight * columns[start + r]
        for k in range(1, count):
            weight = weights[2 * p * count + k]
            other_weight = weights[(2 * p + 1) * count + k]
            if weight != 0.0 or other_weight != 0.0:
                at = k * runs + start
                for r in range(size):
                    one[r] += weight * columns[at + r]
                    other[r] += other_weight * columns[at + r]
        at = 2 * (p * runs + start)
        for r in range(size):
            sums[at + 2 * r] = one[r]
            sums[at + 2 * r + 1] = other[r]


def pair_products(sums: Floats, runs: int, found: Floats) -> None:
    """Write the mean squares of two sums, shape (run, 2), and their mean product."""
    square, other_square, product = 0.0, 0.0, 0.0
    start = 0
    while start < runs:
        part, other_part, product_part = 0.0, 0.0, 0.0
        stop = start + _TOGETHER if start + _TOGETHER < runs else runs
        for r in range(start, stop):
            one, other = sums[2 * r], sums[2 * r + 1]
            part += one * one
            other_part += other * other
            product_part += one * other
        square += part
        other_square += other_part
        product += product_part
        start += _TOGETHER
    found[0] = square / runs
    found[1] = other_square / runs
    found[2] = product / runs


def pair_influence(
    sums: Floats, runs: int, std: float, other_std: float, value: float, influence: Floats
) -> None:
    """Write each run's influence on the correlation `value` of two sums, of standard deviations.

    `sums`, shape (run, 2), become what each of them, of variance 1, lacks of the other.
    """
    for r in range(runs):
        one, other = sums[2 * r] / std, sums[2 * r + 1] / other_std
        influence[r] = one * other - value / 2.0 * (one * one + other * other)
        sums[2 * r] = other - value * one
        sums[2 * r + 1] = one - value * other


def add_sums_above(
    orders: Numbers,
    is_above: Flags,
    has_equal: int,
    levels: Numbers,
    columns: int,
    runs: int,
    factors: Floats,
    targets: Floats,
    sums: Floats,
    influence: Floats,
) -> None:
    """Add to each run the weighted sum of two targets over the runs above; an equal one is half.

    The sums are written in the order of a column, and read at random afterwards: to write at random
    takes several times as long.

    Parameters
    ----------
    orders, levels : ndarray of int, shape (column, run)
        Of each column those of its `Ordering`.
    is_above : ndarray of bool, shape (column, run) or (0,)
        As `Ordering` has it; is read if `has_equal` is not 0.
    columns, runs : int
        Number of columns, and of runs.
    factors : ndarray, shape (column, 2)
        Of the targets.
    targets : ndarray, shape (run, 2)
    sums : ndarray, shape (run,)
        Memory.
    influence : ndarray, shape (run,)
        Is added to.
    """
    for k in range(columns):
        one, other = factors[2 * k], factors[2 * k + 1]
        if one == 0.0 and other == 0.0:
            continue
        if has_equal:
            _sums_above_equal(orders, is_above, levels, k * runs, runs, one, other, targets, sums)
        else:
            _sums_above(orders, k * runs, runs, one, other, targets, sums)
        for r in range(runs):
            influence[r] += sums[levels[k * runs + r]]


@inlined
def _sums_above(
    orders: Numbers,
    first: int,
    runs: int,
    one: float,
    other: float,
    targets: Floats,
    sums: Floats,
) -> None:
    """Write the sums over the runs above, in the order of a column."""
    above = 0.0
    for j in range(runs - 1, -1, -1):
        run = 2 * np.int64(orders[first + j])
        at = one * targets[run] + other * targets[run + 1]
        sums[j] = above + at / 2.0
        above += at


@inlined
def _sums_above_equal(
    orders: Numbers,
    is_above: Flags,
    levels: Numbers,
    first: int,
    runs: int,
    one: float,
    other: float,
    targets: Floats,
    sums: Floats,
) -> None:
    """Write the same sum for all runs of equal values, at their level."""
    above, stop = 0.0, runs
    while stop > 0:
        start = stop - 1
        while not is_above[first + start]:
            start -= 1
        total = 0.0
        for j in range(start, stop):
            run = 2 * np.int64(orders[first + j])
            total += one * targets[run] + other * targets[run + 1]
        sums[levels[first + orders[first + start]]] = above + total / 2.0
        above += total
        stop = start


def sort_words(words: Words, other: Words, runs: int, fewest: int, counts: Integers) -> None:
    """Sort words, which already ascend by their lowest `fewest` bits.

    Each pass puts them in the order of a digit and keeps that of the digits below (radix sort).

    Parameters
    ----------
    words : ndarray, shape (run,)
        Are sorted.
    other : ndarray, shape (run,)
        Memory.
    runs : int
        Number of words.
    fewest : int
        Number of these bits.
    counts : ndarray of int, shape (4 · 65 536,)
        Memory, which is 0.
    """
    width = (64 - fewest + _DIGITS - 1) // _DIGITS
    mask = np.uint64((1 << width) - 1)
    for r in range(runs):
        rest = words[r] >> np.uint64(fewest)
        for digit in range(_DIGITS):
            counts[(digit << 16) + np.int64(rest & mask)] += 1
            rest >>= np.uint64(width)
    for half in range(_DIGITS // 2):
        _sort_by_digit(words, other, runs, fewest, width, 2 * half, counts)
        _sort_by_digit(other, words, runs, fewest, width, 2 * half + 1, counts)


@inlined
def _sort_by_digit(
    words: Words,
    other: Words,
    runs: int,
    fewest: int,
    width: int,
    digit: int,
    counts: Integers,
) -> None:
    """Write words in the order of one digit to other memory."""
    first, total = digit << 16, 0
    for bucket in range(first, first + (1 << width)):
        count = counts[bucket]
        counts[bucket] = total
        total += count
    shift, mask = np.uint64(fewest + digit * width), np.uint64((1 << width) - 1)
    for r in range(runs):
        mine = first + np.int64((words[r] >> shift) & mask)
        other[counts[mine]] = words[r]
        counts[mine] += 1

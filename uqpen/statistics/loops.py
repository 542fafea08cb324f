"""Compiled loops over many runs, called with arrays.

Their machine code is kept on disk, so a process that uses them loads no compiler (`machine_code`).
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable
from ctypes import c_double, c_int64, c_void_p
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.models.machine_code import load_or_compile
from uqpen.models.source import source_sha256

__all__ = [
    "add_sums_above",
    "pair_influence",
    "pair_products",
    "pair_sums",
    "residuals_in_bins",
    "sorted_words",
]

Numbers = npt.NDArray[np.signedinteger[Any]]

# Types of the arguments of each loop in `kernels`: of arrays of floats, of whole numbers of 32 and
# of 64 bits, of flags and of words; of a whole number and of a float.
_LOOPS = {
    "residuals_in_bins": "NILNFLFFFFFLF",
    "pair_sums": "FLLFLLLLFFF",
    "pair_products": "FLF",
    "pair_influence": "FLDDDF",
    "add_sums_above": "NBLNLLFFFF",
    "sort_words": "WWLLI",
}
_TYPES = {
    "F": ("CPointer(float64)", c_void_p),
    "N": ("CPointer(int32)", c_void_p),
    "I": ("CPointer(int64)", c_void_p),
    "B": ("CPointer(uint8)", c_void_p),
    "W": ("CPointer(uint64)", c_void_p),
    "L": ("int64", c_int64),
    "D": ("float64", c_double),
}
_ARRAYS = {"F": np.float64, "N": np.int32, "I": np.int64, "B": np.bool_, "W": np.uint64}

_SUMS = 9
_NO_INFLUENCE: FloatArray = np.empty(0)
# Runs whose columns, up to hundreds, stay in a processor's cache.
_IN_A_BLOCK = 128
# Numbers of words by each value of four digits of 16 bits.
_COUNTS = 4 * 2**16


def residuals_in_bins(
    runs: Numbers,
    first: IntArray,
    rank: Numbers,
    values: FloatArray,
    fewest_for_a_slope: int,
    *,
    has_influence: bool,
) -> tuple[FloatArray, FloatArray]:
    """Fit a line to a variable in each bin, see `kernels.residuals_in_bins`.

    Returns
    -------
    sums : ndarray, shape (9,)
    influence : ndarray, shape (run,) or (0,)
        Of each run on the first of the sums.
    """
    influence = np.empty(len(values)) if has_influence else _NO_INFLUENCE
    place, own, lost = np.empty((3, int(np.diff(first).max(initial=0))))
    part, sums = np.zeros((2, _SUMS))
    memory = place, own, lost, part
    bins = first, len(first) - 1, rank
    arguments = runs, *bins, values, fewest_for_a_slope, *memory, influence, has_influence, sums
    _call("residuals_in_bins", *arguments)
    return sums, influence


def pair_sums(columns: FloatArray, weights: FloatArray) -> FloatArray:
    """Add up two weighted sums of columns, shape (column, run), for each pair.

    Parameters
    ----------
    columns : ndarray, shape (column, run)
    weights : ndarray, shape (pair, 2, column)

    Returns
    -------
    ndarray, shape (pair, run, 2)
    """
    count, runs = columns.shape
    sums, memory = np.empty((len(weights), runs, 2)), np.empty((2, _IN_A_BLOCK))
    own, (blocks, rest) = np.ascontiguousarray(weights), divmod(runs, _IN_A_BLOCK)
    sizes = blocks, _IN_A_BLOCK, rest
    _call("pair_sums", columns, runs, count, own, len(own), *sizes, *memory, sums)
    return sums


def pair_products(sums: FloatArray) -> tuple[float, float, float]:
    """Return the mean squares of two sums, shape (run, 2), and their mean product."""
    found = np.empty(3)
    _call("pair_products", sums, len(sums), found)
    square, other_square, product = found.tolist()
    return square, other_square, product


def pair_influence(sums: FloatArray, stds: FloatArray, value: float) -> FloatArray:
    """Return each run's influence on the correlation `value` of two sums, of standard deviations.

    `sums`, shape (run, 2), become what each of them, of variance 1, lacks of the other.
    """
    influence = np.empty(len(sums))
    _call("pair_influence", sums, len(sums), *map(float, stds), value, influence)
    return influence


def add_sums_above(
    orders: Numbers,
    is_above: BoolArray,
    levels: Numbers,
    factors: FloatArray,
    targets: FloatArray,
    influence: FloatArray,
) -> None:
    """Add to each run the weighted sum of two targets over the runs above; an equal one is half.

    Parameters
    ----------
    orders, levels : ndarray of int, shape (column, run)
        Of each column those of its `Ordering`.
    is_above : ndarray of bool, shape (column, run) or (0, 0)
        As `Ordering` has it; empty where no column has equal values.
    factors : ndarray, shape (column, 2)
        Of the targets.
    targets : ndarray, shape (run, 2)
    influence : ndarray, shape (run,)
        Is added to.
    """
    own = np.ascontiguousarray(factors)
    order = orders, is_above, len(is_above) > 0, levels, *orders.shape
    _call("add_sums_above", *order, own, targets, np.empty(len(influence)), influence)


def sorted_words(words: npt.NDArray[np.uint64], fewest: int) -> npt.NDArray[np.uint64]:
    """Sort words, which already ascend by their lowest `fewest` bits, 16 of 64 or more."""
    counts = np.zeros(_COUNTS, dtype=np.int64)
    _call("sort_words", words, np.empty_like(words), len(words), fewest, counts)
    return words


def _call(name: str, *arguments: Any) -> None:
    """Call a loop; an array of another type than it takes, or in pieces, is refused."""
    pairs = zip(arguments, _LOOPS[name], strict=True)
    _loop(name)(*(_address(each, _ARRAYS[key]) if key in _ARRAYS else each for each, key in pairs))


def _address(values: npt.NDArray[Any], kind: type[np.generic]) -> int:
    if values.dtype != kind or not values.flags.c_contiguous:
        raise TypeError(f"an array of {values.dtype} is no array of {kind.__name__} in one piece")
    return values.ctypes.data


@functools.cache
def _loop(name: str) -> Callable[..., None]:
    """Return a loop, as a function of addresses and numbers."""
    signature = f"void({', '.join(_TYPES[key][0] for key in _LOOPS[name])})"

    def compile_loop(cache: bool) -> Any:
        from uqpen.models.compiled import entry_point
        from uqpen.statistics import kernels

        return entry_point(getattr(kernels, name), signature, cache=cache)

    source = f"{name} {signature} {_source()}"
    return load_or_compile(source, compile_loop, [_TYPES[key][1] for key in _LOOPS[name]])


@functools.cache
def _source() -> str:
    """Return the hash of the loops and of how they are compiled."""
    own = Path(__file__).with_name("kernels.py").read_bytes()
    return hashlib.sha256(own).hexdigest() + source_sha256("uqpen.models.compiled")

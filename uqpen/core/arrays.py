"""Types of arrays, and conversion of numbers from a user's function or a file."""

from __future__ import annotations

import numbers
import sys
from collections.abc import Mapping
from decimal import Decimal
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]
Arrays = Mapping[str, FloatArray]

_NO_NUMBERS = {"c": "complex numbers", "U": "text", "S": "bytes", "M": "dates", "m": "durations"}


def is_finite_number(value: object) -> bool:
    """Check for a number that a float can hold: a whole number of a file may be too large.

    >>> is_finite_number(3), is_finite_number(10**400), is_finite_number(True)
    (True, False, False)
    """
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        return False
    size: Any = abs(value)
    return bool(size <= sys.float_info.max)


def raw_bytes(values: npt.NDArray[Any]) -> memoryview:
    """Return the bytes of an array in its own order of bytes, as a view where it is contiguous."""
    return np.ascontiguousarray(values).reshape(-1).view(np.uint8).data


def floats(value: object) -> FloatArray:
    """Convert a number, an array or a nested list to an array of floats; masked entries to NaN.

    ValueError if it is something else: text, a complex number, None. The message names it.
    """
    try:
        array = np.asanyarray(value)
        if array.dtype.kind == "O":
            found = np.full(array.shape, np.nan)
            for index, entry in np.ndenumerate(array):
                if entry is np.ma.masked:
                    continue
                if not isinstance(entry, numbers.Real | Decimal):
                    raise ValueError(f"{type(entry).__name__} in place of a number")
                try:
                    found[index] = float(entry)
                except OverflowError:
                    found[index] = np.inf
            return found
        if array.dtype.kind not in "biuf":
            kind = _NO_NUMBERS.get(array.dtype.kind, str(array.dtype))
            raise ValueError(f"{kind} in place of numbers")
        whole = np.asarray(array, dtype=np.float64)
        return np.where(np.ma.getmaskarray(array), np.nan, whole)  # type: ignore[no-untyped-call]
    except ValueError as error:
        if "inhomogeneous" in str(error):
            raise ValueError("lists of different lengths") from None
        raise
    except Exception as error:  # a user-defined object may raise anything when it is read
        raise ValueError(f"{type(error).__name__} when it is read as numbers") from None


def evenly_spread(size: int, most: int) -> IntArray:
    """Return positions in an array, evenly spread from the first to the last; `most` at the most.

    >>> evenly_spread(9, 3)
    array([0, 4, 8])
    """
    return np.unique(np.round(np.linspace(0, size - 1, min(size, most))).astype(np.int64))


def rows_by_weight(weights: FloatArray, probability: FloatArray) -> IntArray:
    """Return the rows at probabilities, each row over an interval as long as its weight.

    Weights are not below 0, and above 0 somewhere. Equally spaced probabilities are systematic
    resampling.
    """
    ends = np.cumsum(weights / weights.max())
    rows = np.searchsorted(ends, probability * ends[-1], side="right")
    last = int(np.flatnonzero(weights)[-1])  # rounding must not lead beyond it
    return np.minimum(rows, last).astype(np.int64)

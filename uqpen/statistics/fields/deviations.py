"""Deviations of the values of a field, or of functions of them, from their means."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.statistics.fields.field_sample import FieldSample

__all__ = ["Influence", "deviation_blocks"]

# A function of values of shape (run, place) and of the positions of their places.
Influence = Callable[[FloatArray, IntArray], FloatArray | BoolArray]

# Places that are taken together, so that memory is bounded.
_PLACES = 256


def deviation_blocks(
    field: FieldSample, places: IntArray, influence: Influence
) -> Iterator[tuple[IntArray, FloatArray]]:
    """Yield the deviations from their means at some places, in blocks.

    Parameters
    ----------
    field : FieldSample
        The field.
    places : ndarray of int, shape (place,)
        Positions of places that some run reaches.
    influence : callable
        Of the values at some places; whether they lie below a quantile, say.

    Yields
    ------
    places : ndarray of int, shape (block,)
        Those of the block.
    deviations : ndarray, shape (run, block)
        They are 0 where a curve has ended.
    """
    for start in range(0, len(places), _PLACES):
        block = places[start : start + _PLACES]
        found = influence(field.matrix[:, block], block)
        exists = field.exists[:, block]
        if exists.all():
            yield block, found - found.mean(axis=0)
        else:
            known = np.where(exists, found, 0.0)
            yield block, np.where(exists, known - known.sum(axis=0) / exists.sum(axis=0), 0.0)

"""A field over runs, as samples of its values at each place."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.model import Dimension, Output
from uqpen.statistics.sample import Sample
from uqpen.statistics.sample_shape import shape_of

__all__ = ["FieldSample", "PlaceSamples", "equal_columns"]

# Values of a field that are taken together, so that memory is bounded: 8 MB.
_MOST_VALUES = 2**20


@dataclass(frozen=True, eq=False)
class PlaceSamples:
    """Samples of a field at places that exist in the same runs.

    Parameters
    ----------
    places : ndarray of int, shape (place,)
        Positions of the places in the field, flattened.
    runs : Sample
        The runs in which these places exist; its values are of shape (place, run), those of a
        place next to each other.
    """

    places: IntArray
    runs: Sample

    @property
    def values(self) -> FloatArray:
        """The values by place, shape (place, run)."""
        return self.runs.values

    def at(self, place: int) -> Sample:
        """Return the sample at one of the places, by its position in `places`."""
        return replace(self.runs, values=self.values[place])


@dataclass(frozen=True, eq=False)
class FieldSample:
    """A field over the completed runs of a design.

    Parameters
    ----------
    runs : Sample
        The runs, with values of shape (run, *dims). They are NaN where a curve has ended.
    output : Output
        The field.
    """

    runs: Sample
    output: Output

    @property
    def dims(self) -> tuple[Dimension, ...]:
        """The dimensions of the field."""
        return self.output.dims

    @cached_property
    def weights(self) -> FloatArray:
        """Weight of each place in a mean over the field; their sum is 1."""
        return self.output.place_weights

    @property
    def matrix(self) -> FloatArray:
        """The values in shape (run, place)."""
        return self.runs.values.reshape(self.runs.size, math.prod(self.output.shape))

    @cached_property
    def exists(self) -> BoolArray:
        """Mask of the values that exist, shape (run, place)."""
        mask: BoolArray = ~np.isnan(self.matrix)
        return mask

    @cached_property
    def effective_runs(self) -> FloatArray:
        """Runs that decide the variance at each place, shape (place,); NaN without scatter."""
        found = np.full(self.matrix.shape[1], np.nan)
        for group in self.samples():
            found[group.places] = shape_of(group.runs).effective_runs
        return found

    def samples(self) -> Iterator[PlaceSamples]:
        """Yield the samples at all places, together for places that exist in the same runs."""
        most = max(_MOST_VALUES // max(self.runs.size, 1), 1)
        for places in equal_columns(self.exists):
            chosen = np.flatnonzero(self.exists[:, places[0]])
            used = self.runs.used[chosen]
            for start in range(0, len(places), most):
                part = places[start : start + most]
                # Those of a place next to each other, as sums are then the same as of it alone.
                values = np.ascontiguousarray(self.matrix[:, part][chosen].T)
                yield PlaceSamples(part, replace(self.runs, values=values, used=used))


def equal_columns(mask: BoolArray) -> Iterator[IntArray]:
    """Yield the positions of equal columns of a mask, in the order of the first of each."""
    if mask.all():
        yield np.arange(mask.shape[1])
        return
    packed = np.packbits(mask, axis=0).T
    found: dict[bytes, list[int]] = {}
    for position, column in enumerate(packed):
        found.setdefault(column.tobytes(), []).append(position)
    yield from (np.array(positions) for positions in found.values())

"""Estimates of one statistic: of a scalar output, or at several places of a field."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS, estimate_array
from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.labels import INTERVAL_LEVEL
from uqpen.statistics.estimate import LEVEL, Estimate

__all__ = ["PLACE", "EstimateVector"]

# Dimension of the places of a field, before they are put along those of the field.
PLACE = "place"


@dataclass(frozen=True, eq=False)
class EstimateVector:
    """Estimates of a statistic with their bounds, as arrays of shape () or (place,).

    Parameters
    ----------
    value, lower, upper : ndarray
        NaN where there is none.
    method, label, note : str or ndarray of str
        As of an `Estimate`; one for all, or one for each.
    """

    value: FloatArray
    lower: FloatArray
    upper: FloatArray
    method: Any
    label: Any
    note: Any = ""

    @classmethod
    def of(cls, estimate: Estimate) -> EstimateVector:
        """Return one estimate as an array of shape ()."""
        value, lower, upper = (np.asarray(each) for each in estimate.bounds)
        return cls(value, lower, upper, estimate.method, estimate.label, estimate.note)

    @classmethod
    def without_bounds(cls, value: FloatArray, *reasons: str) -> EstimateVector:
        """Return estimates without bounds, with the reasons; empty ones are left out."""
        missing = np.full(np.shape(value), np.nan)
        return cls(value, missing, missing, "none", "none", "; ".join(filter(None, reasons)))

    @classmethod
    def joined(cls, parts: Iterable[tuple[IntArray, EstimateVector]]) -> EstimateVector:
        """Return estimates at some places each, as those at all places in their order."""
        places, vectors = zip(*parts, strict=True)
        order = np.argsort(np.concatenate(places))
        columns = zip(*(each._columns() for each in vectors), strict=True)
        return cls(*(np.concatenate(column)[order] for column in columns))

    def __getitem__(self, place: int) -> EstimateVector:
        """Return the estimates at a place."""
        return EstimateVector(*(column[place] for column in self._columns()))

    def replace_at(self, condition: npt.ArrayLike, other: EstimateVector) -> EstimateVector:
        """Return other estimates where a condition is true, and these elsewhere."""
        return EstimateVector(
            *(
                np.where(condition, new, old)
                for new, old in zip(other._numbers, self._numbers, strict=True)
            ),
            *(
                np.where(condition, _objects(new), _objects(old))
                for new, old in zip(other._texts, self._texts, strict=True)
            ),
        )

    def remove_bounds_at(self, condition: npt.ArrayLike, *reasons: str) -> EstimateVector:
        """Return the estimates, without bounds where a condition is true, for some reasons."""
        return self.replace_at(condition, EstimateVector.without_bounds(self.value, *reasons))

    def with_further_note(self, note: str) -> EstimateVector:
        """Return the estimates with a further note behind their own; an empty one adds nothing."""
        if not note:
            return self
        further = np.frompyfunc(lambda each: "; ".join(filter(None, (each, note))), 1, 1)
        return replace(self, note=further(self.note))

    def each(self) -> list[Estimate]:
        """Return the estimates one by one."""
        columns = (column.ravel().tolist() for column in self._columns())
        return [Estimate(*entries) for entries in zip(*columns, strict=True)]

    @property
    def has_bounds(self) -> BoolArray:
        """True where there are bounds."""
        return np.broadcast_to(_objects(self.label) != "none", np.shape(self.value))

    def method_within(self, template: str) -> npt.NDArray[np.object_]:
        """Return the methods in a text that contains ``{method}``."""
        return _objects(np.frompyfunc(lambda each: template.format(method=each), 1, 1)(self.method))

    @classmethod
    def stack(cls, parts: Sequence[EstimateVector], axis: int = -1) -> EstimateVector:
        """Return estimates as one, along a further dimension, usually behind that of the places."""
        columns = zip(*(each._columns() for each in parts), strict=True)
        return cls(*(_stacked(column, axis) for column in columns))

    @classmethod
    def from_array(cls, array: xr.DataArray) -> EstimateVector:
        """Return the estimates of an estimate array, in its shape without ``bound``."""
        texts = (array.coords.variables[name].values for name in INTERVAL_TEXTS)
        return cls(*np.moveaxis(array.values, -1, 0), *texts)

    def to_array(
        self,
        along: str = "",
        *,
        units: str,
        long_name: str,
        coordinates: Mapping[str, Any] | None = None,
        level: float = LEVEL,
    ) -> xr.DataArray:
        """Return an estimate array along ``place``, if there are places, a dimension and ``bound``.

        The dimension is that along which estimates were put by `stack`.
        """
        bounds = self.bounds
        own = [along] if along else []
        names = [PLACE, *own] if bounds.ndim - 1 > len(own) else own
        return estimate_array(
            bounds,
            dict(zip(names, bounds.shape, strict=False)),
            self.texts,
            units=units,
            long_name=long_name,
            attributes={INTERVAL_LEVEL: level} if self.has_bounds.any() or along else {},
            coordinates=coordinates,
        )

    def _columns(self) -> Iterator[npt.NDArray[Any]]:
        """Yield the numbers and the texts, all in the shape of the values."""
        shape = np.shape(self.value)
        for column in (*map(np.asarray, self._numbers), *map(_objects, self._texts)):
            yield column if column.shape == shape else np.broadcast_to(column, shape)

    @property
    def bounds(self) -> FloatArray:
        """Value, lower and upper bound along a last axis."""
        return np.stack(self._numbers, axis=-1)

    @property
    def texts(self) -> dict[str, Any]:
        """The texts by `INTERVAL_TEXTS`."""
        return dict(zip(INTERVAL_TEXTS, self._texts, strict=True))

    @property
    def _numbers(self) -> tuple[FloatArray, ...]:
        return self.value, self.lower, self.upper

    @property
    def _texts(self) -> tuple[Any, ...]:
        return self.method, self.label, self.note


def _stacked(parts: Sequence[npt.NDArray[Any]], axis: int) -> npt.NDArray[Any]:
    """Return what `numpy.stack` does, which makes an array of each single entry first."""
    if parts[0].ndim:
        return np.stack(parts, axis)
    is_text = parts[0].dtype.kind == "O"
    return np.array([part[()] for part in parts], dtype=object if is_text else None)


def _objects(texts: Any) -> npt.NDArray[np.object_]:
    return np.asarray(texts, dtype=object)

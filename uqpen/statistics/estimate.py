"""Estimate: values with their bounds and the method of these, or the reason for having none."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.labels import BOUND, INTERVAL, INTERVAL_LABEL, INTERVAL_LEVEL, NOTE
from uqpen.statistics import texts

if TYPE_CHECKING:
    import xarray as xr

# The probability with which an interval covers, and the confidence of a one-sided bound, where a
# study states no other.
LEVEL = 0.95

# Dimension of the places of a field, before they are put along those of the field.
PLACE = "place"

# What estimates statistics yields: the name of each in an archive, and its estimate array.
NamedArrays = Iterator["tuple[str, xr.DataArray]"]

_TEXTS = (INTERVAL, INTERVAL_LABEL, NOTE)


@dataclass(frozen=True)
class Estimate:
    """Estimate of a statistic with its bounds: of a number, or at all places of a field at once.

    Parameters
    ----------
    value, lower, upper : float or ndarray, shape (...)
        NaN where there is none. A number has the shape (), a field the shape (place,).
    method : str or ndarray of str, shape (...)
        The formula of the bounds, in words; one for all, or one for each.
    label : str or ndarray of str, shape (...)
        ``"nominal"``: the coverage of the bounds is the confidence level. ``"discrete"``: it is at
        least that, because counts are whole numbers. ``"conservative"``: it is at least that.
        ``"none"``: there are no bounds.
    note : str or ndarray of str, shape (...)
        Note for the reader: why there are no bounds, or when their coverage may be smaller.
    """

    value: Any
    lower: Any
    upper: Any
    method: Any
    label: Any
    note: Any = ""

    @classmethod
    def without_bounds(cls, value: npt.ArrayLike, *reasons: str) -> Estimate:
        """Return an estimate without bounds, with the reasons; empty ones are left out."""
        missing = np.full(np.shape(value), np.nan) if np.ndim(value) else math.nan
        return cls(value, missing, missing, "none", "none", "; ".join(filter(None, reasons)))

    @classmethod
    def stacked(cls, parts: Iterable[Estimate], axis: int = -1) -> Estimate:
        """Return estimates as one, along a further dimension, usually behind that of the places."""
        columns = [*zip(*(each._columns() for each in parts), strict=True)]
        if not columns:
            return cls.without_bounds(np.empty(0))
        return cls(*(_stacked(column, axis) for column in columns))

    @classmethod
    def joined(cls, parts: Iterable[tuple[IntArray, Estimate]]) -> Estimate:
        """Return estimates at some places each, as those at all places in their order."""
        places, estimates = zip(*parts, strict=True)
        order = np.argsort(np.concatenate(places))
        columns = zip(*(each._columns() for each in estimates), strict=True)
        return cls(*(np.concatenate(column)[order] for column in columns))

    @classmethod
    def from_array(cls, array: xr.DataArray) -> Estimate:
        """Return the estimates of an estimate array, in its shape without ``bound``."""
        described = (array.coords.variables[name].values for name in _TEXTS)
        return cls(*np.moveaxis(array.values, -1, 0), *described)

    @classmethod
    def stack(cls, estimates: Sequence[Estimate], dimension: str, **described: Any) -> xr.DataArray:
        """Return several numbers as an estimate array along a dimension, as `to_array` does."""
        return cls.stacked(estimates).to_array(dimension, **described)

    @classmethod
    def table(
        cls, rows: Sequence[Sequence[Estimate]], dimensions: tuple[str, str], **described: Any
    ) -> xr.DataArray:
        """Return rows of numbers as an estimate array along two dimensions."""
        stacked = cls.stacked(map(cls.stacked, rows), axis=0)
        return stacked.to_array(*dimensions, **described)

    def __getitem__(self, place: Any) -> Estimate:
        """Return the estimates at a place, or at those of an index of arrays."""
        return Estimate(*(column[place] for column in self._columns()))

    def each(self) -> list[Estimate]:
        """Return the estimates one by one."""
        columns = (column.ravel().tolist() for column in self._columns())
        return [Estimate(*entries) for entries in zip(*columns, strict=True)]

    def replace_at(self, condition: npt.ArrayLike, other: Estimate) -> Estimate:
        """Return other estimates where a condition is true, and these elsewhere."""
        pairs = zip(other._arrays(), self._arrays(), strict=True)
        return Estimate(*(np.where(condition, new, old) for new, old in pairs))

    def remove_bounds_at(self, condition: npt.ArrayLike, *reasons: str) -> Estimate:
        """Return the estimates, without bounds where a condition is true, for some reasons."""
        return self.replace_at(condition, Estimate.without_bounds(self.value, *reasons))

    def with_note(self, *notes: str) -> Estimate:
        """Return the estimates with further notes behind their own; empty ones add nothing."""
        further = [note for note in notes if note]
        if not further:
            return self
        join = np.frompyfunc(lambda own: "; ".join(filter(None, (own, *further))), 1, 1)
        return replace(self, note=join(self.note))

    def with_method(self, template: str) -> Estimate:
        """Return the estimates with their methods in a text that contains ``{method}``."""
        put = np.frompyfunc(lambda own: template.format(method=own), 1, 1)
        return replace(self, method=put(self.method))

    @property
    def has_bounds(self) -> BoolArray:
        """True where there are bounds."""
        return np.broadcast_to(_objects(self.label) != "none", np.shape(self.value))

    @property
    def bounds(self) -> FloatArray:
        """Value, lower and upper bound along a last axis."""
        return np.stack([self.value, self.lower, self.upper], axis=-1)

    @property
    def texts(self) -> dict[str, Any]:
        """Method, label and note by the names that an estimate array has for them."""
        return dict(zip(_TEXTS, (self.method, self.label, self.note), strict=True))

    def to_array(
        self,
        *along: str,
        units: str,
        long_name: str,
        coordinates: Mapping[str, Any] | None = None,
        level: float = LEVEL,
    ) -> xr.DataArray:
        """Return an estimate array along ``place``, if there are places, dimensions and ``bound``.

        The dimensions are those along which estimates were put by `stacked`.
        """
        from uqpen.archive.estimates import estimate_array

        bounds = self.bounds
        names = along if bounds.ndim - 1 == len(along) else (PLACE, *along)
        return estimate_array(
            bounds,
            dict(zip(names, bounds.shape, strict=False)),
            self.texts,
            units=units,
            long_name=long_name,
            attributes={INTERVAL_LEVEL: level} if along or self.has_bounds.any() else {},
            coordinates=coordinates,
        )

    def in_place_of(
        self, array: xr.DataArray, *, level: float | None = None, **beside: FloatArray
    ) -> xr.DataArray:
        """Return the estimates as the estimate array of the same entries and attributes.

        Parameters
        ----------
        array : DataArray
        level : float, optional
            Confidence level; without one, the array has none.
        **beside : ndarray
            Numbers that stand beside the estimates, by the names of their coordinates.
        """
        from uqpen.archive.estimates import estimate_array

        dims = {str(name): size for name, size in array.sizes.items() if name != BOUND}
        attributes = {key: each for key, each in array.attrs.items() if key != INTERVAL_LEVEL}
        kept = {key: each for key, each in array.coords.variables.items() if key not in _TEXTS}
        found = estimate_array(
            self.bounds.reshape(array.shape),
            dims,
            self.texts,
            units=attributes.pop("units"),
            long_name=attributes.pop("long_name"),
            attributes={**({} if level is None else {INTERVAL_LEVEL: level}), **attributes},
            coordinates={key: each for key, each in kept.items() if key != BOUND},
        )
        shape = tuple(dims.values())
        return found.assign_coords(
            {name: (tuple(dims), values.reshape(shape)) for name, values in beside.items()}
        )

    def along(
        self,
        array: xr.DataArray,
        coordinate: tuple[str, Any, dict[str, str]],
        words: str,
        *,
        level: float,
    ) -> xr.DataArray:
        """Return the estimates along a dimension before those of an estimate array.

        Parameters
        ----------
        array : DataArray
            Has the entries of each.
        coordinate : tuple
            The dimension, its labels and their attributes.
        words : str
            What the estimates are, behind the title of the array.
        level : float
            Confidence level.
        """
        from uqpen.archive.estimates import estimate_array

        dims = {str(name): size for name, size in array.sizes.items() if name != BOUND}
        own = {key: each for key, each in array.coords.variables.items() if key not in _TEXTS}
        return estimate_array(
            self.bounds,
            {coordinate[0]: len(coordinate[1]), **dims},
            self.texts,
            units=array.attrs["units"],
            long_name=f"{array.attrs['long_name']}{words}",
            attributes={INTERVAL_LEVEL: level},
            coordinates={**own, coordinate[0]: coordinate},
        )

    def _columns(self) -> Iterator[npt.NDArray[Any]]:
        """Yield the numbers and the texts, all in the shape of the values."""
        shape = np.shape(self.value)
        for column in self._arrays():
            yield column if column.shape == shape else np.broadcast_to(column, shape)

    def _arrays(self) -> Iterator[npt.NDArray[Any]]:
        yield from map(np.asarray, (self.value, self.lower, self.upper))
        yield from map(_objects, (self.method, self.label, self.note))


def _stacked(parts: Sequence[npt.NDArray[Any]], axis: int) -> npt.NDArray[Any]:
    """Return what `numpy.stack` does, which makes an array of each single entry first."""
    if parts[0].ndim:
        return np.stack(parts, axis)
    is_text = parts[0].dtype.kind == "O"
    return np.array([part[()] for part in parts], dtype=object if is_text else None)


def _objects(texts: Any) -> npt.NDArray[np.object_]:
    return np.asarray(texts, dtype=object)


def unweighted(
    analysis: Callable[..., Iterable[tuple[str, xr.DataArray]]],
) -> Callable[..., NamedArrays]:
    """Return an analysis without its values, for runs whose weights it does not know."""

    def without_values(*evidence: Any) -> NamedArrays:
        for name, array in analysis(*evidence):
            yield name, refused(array, texts.NOT_WEIGHTED) if BOUND in array.dims else array

    return without_values


def refused(array: xr.DataArray, reason: str) -> xr.DataArray:
    """Return an estimate array of the same entries without values, for one reason."""
    return Estimate.without_bounds(np.full(array.shape[:-1], np.nan), reason).in_place_of(array)

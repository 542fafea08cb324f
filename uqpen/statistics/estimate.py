"""Estimate: a value with its bounds and their method, or the reason for having none."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from uqpen.core.labels import BOUND, INTERVAL, INTERVAL_LABEL, INTERVAL_LEVEL, NOTE
from uqpen.statistics import texts

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["LEVEL", "Estimate", "refused", "unweighted"]

# The probability with which an interval covers, and the confidence of a one-sided bound, where a
# study states no other.
LEVEL = 0.95


@dataclass(frozen=True)
class Estimate:
    """Estimate of a statistic with its bounds.

    Parameters
    ----------
    value, lower, upper : float
        NaN where there is none.
    method : str
        The formula of the bounds, in words.
    label : str
        ``"nominal"``: the coverage of the bounds is the confidence level. ``"discrete"``: it is at
        least that, because counts are whole numbers. ``"conservative"``: it is at least that.
        ``"none"``: there are no bounds.
    note : str
        Note for the reader: why there are no bounds, or when their coverage may be smaller.
    """

    value: float
    lower: float
    upper: float
    method: str
    label: str
    note: str = ""

    @classmethod
    def without_bounds(cls, value: float, *reasons: str) -> Estimate:
        """Return an estimate without bounds, with the reasons; empty ones are left out."""
        return cls(value, math.nan, math.nan, "none", "none").with_note(*reasons)

    def with_note(self, *notes: str) -> Estimate:
        """Return the estimate with other notes; empty ones are left out."""
        return replace(self, note="; ".join(filter(None, notes)))

    @property
    def bounds(self) -> tuple[float, float, float]:
        """Value, lower and upper bound."""
        return self.value, self.lower, self.upper

    def to_array(self, *, units: str, long_name: str, level: float = LEVEL) -> xr.DataArray:
        """Return the estimate as an estimate array along ``bound``."""
        return _estimate_array([self], {}, units, long_name, level=level)

    @staticmethod
    def stack(
        estimates: Sequence[Estimate],
        dimension: str,
        *,
        units: str,
        long_name: str,
        coordinates: Mapping[str, Any] | None = None,
        level: float = LEVEL,
    ) -> xr.DataArray:
        """Return several estimates as an estimate array along a dimension and ``bound``."""
        dims = {dimension: len(estimates)}
        return _estimate_array(estimates, dims, units, long_name, coordinates, level=level)

    @staticmethod
    def table(
        rows: Sequence[Sequence[Estimate]],
        dimensions: tuple[str, str],
        *,
        units: str,
        long_name: str,
        coordinates: Mapping[str, Any] | None = None,
        level: float = LEVEL,
    ) -> xr.DataArray:
        """Return estimates as an estimate array along two dimensions and ``bound``."""
        shape = dict(zip(dimensions, (len(rows), len(rows[0])), strict=True))
        estimates = [estimate for row in rows for estimate in row]
        return _estimate_array(estimates, shape, units, long_name, coordinates, level=level)

    @staticmethod
    def array(
        estimates: Sequence[Estimate],
        dims: Mapping[str, int],
        *,
        units: str,
        long_name: str,
        coordinates: Mapping[str, Any] | None = None,
        level: float = LEVEL,
    ) -> xr.DataArray:
        """Return estimates as an estimate array along dimensions of given sizes and ``bound``."""
        return _estimate_array(estimates, dims, units, long_name, coordinates, level=level)


def _estimate_array(
    estimates: Sequence[Estimate],
    dims: Mapping[str, int],
    units: str,
    long_name: str,
    coordinates: Mapping[str, Any] | None = None,
    *,
    level: float,
) -> xr.DataArray:
    """Return estimates along dimensions, each with its own texts, which no other may change."""
    from uqpen.archive.estimates import estimate_array

    has_bounds = any(estimate.label != "none" for estimate in estimates)
    return estimate_array(
        [estimate.bounds for estimate in estimates],
        dims,
        {
            INTERVAL: [estimate.method for estimate in estimates],
            INTERVAL_LABEL: [estimate.label for estimate in estimates],
            NOTE: [estimate.note for estimate in estimates],
        },
        units=units,
        long_name=long_name,
        attributes={INTERVAL_LEVEL: level} if has_bounds or dims else {},
        coordinates=coordinates,
    )


def unweighted(
    analysis: Callable[..., Iterable[tuple[str, xr.DataArray]]],
) -> Callable[..., Iterator[tuple[str, xr.DataArray]]]:
    """Return an analysis without its values, for runs whose weights it does not know."""

    def without_values(*evidence: Any) -> Iterator[tuple[str, xr.DataArray]]:
        for name, array in analysis(*evidence):
            yield name, refused(array, texts.NOT_WEIGHTED) if BOUND in array.dims else array

    return without_values


def refused(array: xr.DataArray, reason: str) -> xr.DataArray:
    """Return an estimate array of the same entries without values, for one reason."""
    from uqpen.archive.estimates import estimate_array

    replaced = {INTERVAL: "none", INTERVAL_LABEL: "none", NOTE: reason}
    attributes = {key: value for key, value in array.attrs.items() if key != INTERVAL_LEVEL}
    return estimate_array(
        np.full(array.shape, math.nan),
        {str(name): size for name, size in array.sizes.items() if name != BOUND},
        replaced,
        units=attributes.pop("units"),
        long_name=attributes.pop("long_name"),
        attributes=attributes,
        coordinates={k: each.variable for k, each in array.coords.items() if k not in replaced},
    )

"""Statistics that a benchmark compares, and their estimates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import BENCHMARK_STATISTICS, CATALOGUE
from uqpen.core.labels import (
    BOUNDS,
    EXCEEDANCE,
    LOWER_THRESHOLD,
    MOMENTS,
    PROBABILITY,
    QUANTILES,
    THRESHOLD,
)
from uqpen.core.statistic import Statistic, UnitRule
from uqpen.core.units import DIMENSIONLESS
from uqpen.statistics.quantity_of_interest import QuantityOfInterest

__all__ = ["COMPARED_ANALYSES", "BenchmarkStatistic", "Estimates", "benchmark_statistics"]


# Estimate arrays by output and statistic.
Estimates = Mapping[str, Mapping[str, xr.DataArray]]

_COMPARED = tuple(each.name for each in BENCHMARK_STATISTICS)

# The analyses that yield the statistics that are compared.
COMPARED_ANALYSES = (MOMENTS, QUANTILES, EXCEEDANCE)

# Where a value's own size says little, because zero is a place as any other, errors are relative
# to the standard deviation.
_SMALL = 0.01


@dataclass(frozen=True)
class BenchmarkStatistic:
    """A statistic of an output, with one entry or several.

    Parameters
    ----------
    quantity : QuantityOfInterest
        The quantity of interest of its output.
    name : str
        Its name in the catalogue.
    entries : tuple of float or str
        The coordinates of its entries; ``("",)`` for a single entry.
    """

    quantity: QuantityOfInterest
    name: str
    entries: tuple[float | str, ...] = ("",)

    @property
    def output(self) -> str:
        """The name of its output."""
        return self.quantity.output.name

    @property
    def dimension(self) -> str:
        """The dimension of its entries; empty for a single one."""
        return next(iter(self._described.dims), "")

    @property
    def units(self) -> str:
        """The unit of its values."""
        return self.quantity.output.unit if self._has_unit else DIMENSIONLESS

    @property
    def display_units(self) -> str:
        """The unit to show its values in."""
        return self.quantity.display_unit if self._has_unit else DIMENSIONLESS

    @property
    def _described(self) -> Statistic:
        return CATALOGUE[self.name]

    @property
    def _has_unit(self) -> bool:
        return self._described.unit is not UnitRule.NONE

    def estimates(self, estimates: Estimates) -> FloatArray:
        """Return its estimates out of all, of shape (entry, bound); NaN for missing ones."""
        shape = (len(self.entries), len(BOUNDS))
        array = estimates.get(self.output, {}).get(self.name)
        if array is None:
            return np.full(shape, np.nan)
        return np.asarray(array.values, dtype=np.float64).reshape(shape)

    def error_scale(self, truth: FloatArray, spread: float) -> FloatArray:
        """Return the sizes that errors are relative to, of shape (entry,).

        They follow from the reference's values and the standard deviation of the output.
        """
        size = np.abs(truth)
        if self._described.unit is UnitRule.VALUE:  # may be zero without being small
            size = np.where(size < _SMALL * spread, spread, size)
        return np.where(size > 0, size, 1.0)


def benchmark_statistics(
    quantities: Sequence[QuantityOfInterest],
    names: Sequence[str] = _COMPARED,
) -> Iterator[BenchmarkStatistic]:
    """Yield the statistics of every output that is a number, output by output."""
    for quantity in quantities:
        if not quantity.output.is_number:
            continue
        entries: Mapping[str, tuple[float | str, ...]] = {
            PROBABILITY: tuple(quantity.quantiles),
            THRESHOLD: tuple(threshold.text for threshold in quantity.thresholds),
            LOWER_THRESHOLD: tuple(threshold.text for threshold in quantity.lower_thresholds),
        }
        for name in names:
            along = [entries[dimension] for dimension in CATALOGUE[name].dims]
            if all(along):
                yield BenchmarkStatistic(quantity, name, *along)

"""The statistics that methods are judged by, and where the analyses put them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.core.labels import BOUNDS, ENTRIES, EXCEEDANCE, MOMENTS, QUANTILES
from uqpen.core.units import DIMENSIONLESS
from uqpen.statistics.quantity_of_interest import QuantityOfInterest

__all__ = ["GROUPS", "BenchmarkStatistic", "benchmark_statistics"]

FloatArray = npt.NDArray[np.float64]

# The analyses whose answers are compared.
GROUPS = (MOMENTS, QUANTILES, EXCEEDANCE)

# Where a value's own size says little, because zero is a place as any other, errors are relative
# to the standard deviation.
_SMALL = 0.01


@dataclass(frozen=True)
class BenchmarkStatistic:
    """What is asked of an output, of which there may be several entries.

    Parameters
    ----------
    quantity : QuantityOfInterest
        Of which output.
    name : str
        ``"mean"``, ``"std"``, ``"quantile"`` or ``"exceedance"``.
    group, variable : str
        Where the analyses answer it.
    dimension : str
        What several entries lie along; empty for a single one.
    entries : tuple of float or str
        What they are called.
    """

    quantity: QuantityOfInterest
    name: str
    group: str
    variable: str
    dimension: str = ""
    entries: tuple[float | str, ...] = ("",)

    @property
    def output(self) -> str:
        """The name of its output."""
        return self.quantity.output.name

    @property
    def units(self) -> str:
        """Of its values."""
        return DIMENSIONLESS if self.name == EXCEEDANCE else self.quantity.output.unit

    @property
    def display_units(self) -> str:
        """The unit to show its values in."""
        return DIMENSIONLESS if self.name == EXCEEDANCE else self.quantity.display_unit

    @property
    def long_name(self) -> str:
        """What it is, in words."""
        words = {"std": "standard deviation", EXCEEDANCE: "probability of exceeding a value"}
        return f"{words.get(self.name, self.name)} of {self.quantity.output.title}"

    @property
    def is_location(self) -> bool:
        """Whether it says where values lie, and so may be zero without being small."""
        return self.name in ("mean", "quantile")

    def estimates(self, groups: Mapping[str, xr.Dataset]) -> FloatArray:
        """Its estimates with their bounds.

        Parameters
        ----------
        groups : mapping of str to Dataset
            What analyses answered, by group.

        Returns
        -------
        ndarray, shape (entry, bound)
            NaN where nothing was answered.
        """
        shape = (len(self.entries), len(BOUNDS))
        answers = groups.get(self.group)
        if answers is None or self.variable not in answers:
            return np.full(shape, np.nan)
        return np.asarray(answers[self.variable].values, dtype=np.float64).reshape(shape)

    def error_scale(self, truth: FloatArray, spread: float) -> FloatArray:
        """What errors are relative to.

        Parameters
        ----------
        truth : ndarray, shape (entry,)
            The reference's values.
        spread : float
            The standard deviation of the output.
        """
        size = np.abs(truth)
        if self.is_location:
            size = np.where(size < _SMALL * spread, spread, size)
        scale: FloatArray = np.where(size > 0, size, 1.0)
        return scale


def benchmark_statistics(quantities: Sequence[QuantityOfInterest]) -> Iterator[BenchmarkStatistic]:
    """The statistics of every output that is a number, output by output."""
    for quantity in quantities:
        name = quantity.output.name
        if quantity.output.categories:
            continue
        yield BenchmarkStatistic(quantity, "mean", MOMENTS, f"{name}_mean")
        yield BenchmarkStatistic(quantity, "std", MOMENTS, f"{name}_std")
        yield BenchmarkStatistic(
            quantity, "quantile", QUANTILES, name, ENTRIES["quantile"], tuple(quantity.quantiles)
        )
        if quantity.thresholds:
            texts = tuple(threshold.text for threshold in quantity.thresholds)
            yield BenchmarkStatistic(
                quantity, EXCEEDANCE, EXCEEDANCE, name, ENTRIES[EXCEEDANCE], texts
            )

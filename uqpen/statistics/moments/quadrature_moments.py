"""Moments by an integration rule: sums over its nodes with their weights."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import CONDITIONAL, QUADRATURE_WEIGHT, STATUS
from uqpen.core.status import Status
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.quantity_of_interest import QuantityOfInterest

__all__ = ["quadrature_moments"]


# Rounding error of a sum of weighted terms, relative to their size.
_ROUNDING = 1e-12


def quadrature_moments(
    runs: xr.Dataset, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Moments of an output by the weights of its runs.

    Yields
    ------
    name : str
        ``mean``, ``std``, ``skewness``, ``kurtosis``.
    estimate : DataArray
        Along ``bound``, without bounds: a quadrature rule gives no estimate of its error.
    """
    if quantity.output.categories:
        return
    name, title, unit = quantity.output.name, quantity.output.title, quantity.output.unit
    integrals = _Integrals.from_runs(runs, name)
    for statistic, units, long_name in (
        ("mean", unit, "mean"),
        ("std", unit, "standard deviation"),
        ("skewness", "1", "skewness"),
        ("kurtosis", "1", "kurtosis"),
    ):
        value, reason = integrals.statistic_with_reason(statistic)
        estimate = Estimate.without_bounds(value, reason, integrals.missing_runs_note)
        yield statistic, estimate.to_array(units=units, long_name=f"{long_name} of {title}")


@dataclass(frozen=True, eq=False)
class _Integrals:
    """Completed runs of a quadrature rule, with weights scaled to a sum of 1."""

    values: FloatArray
    weights: FloatArray
    missing_runs_note: str
    # Sum of the weights before scaling; 1 where no run failed.
    total: float

    @classmethod
    def from_runs(cls, runs: xr.Dataset, name: str) -> _Integrals:
        """Compute the integrals of an output."""
        weights = runs[QUADRATURE_WEIGHT].values
        used = runs[STATUS].values == Status.OK
        missing_runs_note = ""
        if not used.all():
            share = float(np.abs(weights[~used]).sum() / np.abs(weights).sum())
            is_absent = CONDITIONAL in runs.attrs
            missing_runs_note = (texts.ABSENT_NODES if is_absent else texts.MISSING_NODES).format(
                failed=np.count_nonzero(~used), nodes=len(used), share=100 * share
            )
        total = float(weights[used].sum())
        values = runs[name].values[used].astype(np.float64)
        return cls(values, weights[used] / (total or math.nan), missing_runs_note, total)

    def statistic_with_reason(self, statistic: str) -> tuple[float, str]:
        """Return a statistic with the reason why it has no interval, or is NaN."""
        if not len(self.values):
            return math.nan, texts.NO_RUN
        if not self.total > _ROUNDING:
            return math.nan, texts.NO_WEIGHT
        if statistic == "mean":
            return self.mean, texts.NO_SCATTER_OF_RULE
        if not self.scale > 0:
            return (0.0 if statistic == "std" else math.nan), texts.CONSTANT_OUTPUT
        if not self._moment(2) > _ROUNDING:
            return math.nan, texts.IMPOSSIBLE_MOMENT.format(moment="variance")
        if statistic == "std":
            return math.sqrt(self._moment(2)) * self.scale, texts.NO_SCATTER_OF_RULE
        if statistic == "skewness":
            return self.skewness, texts.NO_SCATTER_OF_RULE
        # No distribution has less (Pearson 1916, Phil. Trans. R. Soc. A 216, 429-457).
        if self.kurtosis < (1 + self.skewness**2) * (1 - _ROUNDING):
            return math.nan, texts.IMPOSSIBLE_MOMENT.format(moment="kurtosis")
        return self.kurtosis, texts.NO_SCATTER_OF_RULE

    @cached_property
    def mean(self) -> float:
        """Σ w y."""
        # About a value of its own a constant comes out exactly; over the largest no sum overflows.
        first = float(self.values[0])
        largest = float(np.abs(self.values).max()) or 1.0
        weighted = (self.values / largest - first / largest) * self.weights
        return first + float(weighted.sum()) * largest

    @cached_property
    def scale(self) -> float:
        """The largest deviation; powers of values divided by it neither overflow nor vanish."""
        return float(np.abs(self.values - self.mean).max())

    def _moment(self, power: int) -> float:
        deviations = (self.values - self.mean) / self.scale
        return float((deviations**power * self.weights).sum())

    @property
    def skewness(self) -> float:
        """The third central moment over the cube of the standard deviation."""
        return float(self._moment(3) / self._moment(2) ** 1.5)

    @property
    def kurtosis(self) -> float:
        """The fourth central moment over the square of the variance."""
        return self._moment(4) / self._moment(2) ** 2

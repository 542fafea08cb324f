"""Estimates of a curve by one source at all of its places, in the units that are shown."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.fields import field_dimensions
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import BOUND, INTERVAL_LEVEL, NOTE
from uqpen.results.archive_view import ArchiveView
from uqpen.results.table import first_runs

__all__ = ["CurveEstimates", "curves"]


def curves(view: ArchiveView) -> list[str]:
    """Return the outputs along one dimension; only the selected one, if any."""
    runs = first_runs(view.tree)
    return [name for name in view.fields if len(field_dimensions(runs[name])) == 1]


@dataclass(frozen=True)
class CurveEstimates:
    """Estimates of an output along one dimension.

    Parameters
    ----------
    view : ArchiveView
        The part of an archive on one model.
    output, source : str
        The curve, and the design or surrogate whose estimates they are.
    """

    view: ArchiveView
    output: str
    source: str

    @property
    def dimension(self) -> str:
        """The dimension of the curve."""
        return field_dimensions(first_runs(self.view.tree)[self.output])[0]

    @cached_property
    def places(self) -> FloatArray:
        """The coordinates, shape (place,)."""
        coordinates = first_runs(self.view.tree)[self.dimension].values
        return np.asarray(self.view.scale(self.dimension).from_si(coordinates), dtype=np.float64)

    def array(self, statistic: str) -> xr.DataArray | None:
        """Return an estimate array as the archive has it, in SI units; None without one."""
        return self.view.statistics.get(self.source, self.output, statistic)

    def bounds(self, statistic: str) -> FloatArray | None:
        """Return a statistic of one value at each place, shape (place, bound); None without it."""
        found = self.array(statistic)
        return None if found is None else self._shown(found, statistic)

    def entries(self, statistic: str) -> dict[Any, FloatArray]:
        """Return a statistic by its labels, shape (place, bound) each; empty without it."""
        found = self.array(statistic)
        if found is None:
            return {}
        (own,) = (dim for dim in found.dims if dim not in (self.dimension, BOUND))
        return {
            each[own].item(): self._shown(each, statistic) for each in found.transpose(own, ...)
        }

    def _shown(self, array: xr.DataArray, statistic: str) -> FloatArray:
        convert = self.view.conversion(self.output, statistic)
        values = array.transpose(self.dimension, BOUND).values
        return np.asarray(convert(values), dtype=np.float64)

    def level(self, statistic: str) -> float:
        """Return the confidence level of a statistic; NaN without one."""
        found = self.array(statistic)
        return np.nan if found is None else float(found.attrs.get(INTERVAL_LEVEL, np.nan))

    def reason(self, statistic: str) -> str:
        """Return the first reason why a statistic has no bounds at a place; empty for none."""
        found = self.array(statistic)
        if found is None or NOTE not in found.coords:
            return ""
        lacks = ~np.isfinite(found.values[..., 1:]).all(axis=-1)
        notes = np.broadcast_to(found.coords[NOTE].values, lacks.shape)[lacks]
        return next((str(note) for note in notes if note), "")

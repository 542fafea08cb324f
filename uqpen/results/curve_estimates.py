"""Estimates of a curve by one source at all of its places, in the units that are shown."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.fields import field_dimensions
from uqpen.archive.read import read_group
from uqpen.core.arrays import FloatArray, IntArray, evenly_spread
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import BOUND, LEFT_OUT, RUNS
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
    most_places : int, optional
        Places at the most, evenly spread over the curve; all of them by default.
    """

    view: ArchiveView
    output: str
    source: str
    most_places: int | None = None

    @cached_property
    def dimension(self) -> str:
        """The dimension of the curve."""
        return field_dimensions(first_runs(self.view.tree)[self.output])[0]

    @property
    def size(self) -> int:
        """Number of all places of the curve."""
        return int(self._coordinates.size)

    @cached_property
    def positions(self) -> IntArray:
        """Positions of the places among all of the curve."""
        return evenly_spread(self.size, self.most_places or self.size)

    @cached_property
    def places(self) -> FloatArray:
        """The coordinates, shape (place,)."""
        coordinates = self._coordinates.values[self.positions]
        return np.asarray(self.view.scale(self.dimension).from_si(coordinates), dtype=np.float64)

    @property
    def _coordinates(self) -> xr.DataArray:
        return first_runs(self.view.tree)[self.dimension]

    @property
    def has_runs(self) -> bool:
        """True if the source is a design and the archive has its runs."""
        return self.source in self.view.designs and self.view.design(self.source).keeps_runs

    @cached_property
    def runs(self) -> FloatArray:
        """The curves of the completed runs of a design, shape (run, place); NaN behind an end."""
        return self._shown_runs(self.view.design(self.source).completed_values(self.output))

    @property
    def outlying_runs(self) -> FloatArray:
        """The curves of the outlying runs of a design, shape (run, place); of those kept alone."""
        mask = self.view.statistics.get(self.source, self.output, "outlying")
        if not self.has_runs:
            mask = None
        every = read_group(self.view.tree, RUNS, self.source)[self.output].values
        numbers = [] if mask is None else mask["curve"].values[mask.values == 1]
        return self._shown_runs(every[np.asarray(numbers, dtype=np.int64)])

    @property
    def outlying_count(self) -> tuple[int, int]:
        """The numbers of outlying runs and of all that are ranked."""
        mask = self.view.statistics.get(self.source, self.output, "outlying")
        return (0, 0) if mask is None else (int((mask.values == 1).sum()), mask.size)

    def _shown_runs(self, values: FloatArray) -> FloatArray:
        shown = self.view.scale(self.output).from_si(values[:, self.positions])
        return np.asarray(shown, dtype=np.float64)

    def array(self, statistic: str, source: str = "") -> xr.DataArray | None:
        """Return an estimate array at the places, in SI units; None without one.

        It is of another source, if one is named.
        """
        found = self.view.statistics.get(source or self.source, self.output, statistic)
        if found is None or self.dimension not in found.dims:
            return None
        return found.isel({self.dimension: self.positions})

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
        convert = self.view.conversion(self.output, CATALOGUE[statistic])
        values = array.transpose(self.dimension, BOUND).values
        return np.asarray(convert(values), dtype=np.float64)

    def left_out(self, statistic: str) -> str:
        """Return the places that a band leaves out, and why; empty for none."""
        found = self.array(statistic)
        return "" if found is None else str(found.attrs.get(LEFT_OUT, ""))

"""A field along one dimension as a page shows it: some of its places, in the units of the study."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.read import read_group
from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.labels import RUN, RUNS
from uqpen.figures.scatter import thin_runs
from uqpen.results.archive_view import ArchiveView
from uqpen.results.curve_estimates import CurveEstimates
from uqpen.results.texts import unit_suffix

__all__ = ["CurveView"]

# Places of a curve in the charts at the most, of some thousand.
_MOST_PLACES = 161


@dataclass(frozen=True)
class CurveView:
    """A field along one dimension, by one design.

    Parameters
    ----------
    view : ArchiveView
        The part of an archive on one model.
    output, design : str
        The field, and the design whose estimates are shown.
    dimension : str
        What the field lies along.
    """

    view: ArchiveView
    output: str
    design: str
    dimension: str

    @cached_property
    def positions(self) -> IntArray:
        """Positions of the places that are shown, evenly spread, with the first and the last."""
        size = self.view.runs(self.design).sizes[self.dimension]
        return np.unique(np.round(np.linspace(0, size - 1, min(size, _MOST_PLACES))).astype(int))

    @cached_property
    def places(self) -> FloatArray:
        """Coordinates of these places, in the unit that is shown."""
        every = self.view.runs(self.design)[self.dimension].values
        found: FloatArray = self.view.scale(self.dimension).from_si(every[self.positions])
        return found

    @property
    def places_note(self) -> str:
        """Number of the places that are shown, where these are not all."""
        size = self.view.runs(self.design).sizes[self.dimension]
        shown = self.positions.size
        return "" if shown == size else f"{shown} of {size} places are shown."

    def place_text(self, position: int) -> str:
        """Return one of the places with its unit."""
        return f"{self.places[position]:.6g}{unit_suffix(self.view.unit(self.dimension))}"

    @cached_property
    def _estimates(self) -> CurveEstimates:
        return CurveEstimates(self.view, self.output, self.design)

    def estimate(self, statistic: str, source: str = "") -> xr.DataArray | None:
        """Return a statistic at the places, in SI units; None where the source has none."""
        array = self.view.statistics.get(source or self.design, self.output, statistic)
        if array is None or self.dimension not in array.dims:
            return None
        return array.isel({self.dimension: self.positions})

    def bounds(self, statistic: str) -> FloatArray | None:
        """Return a statistic of one value at each place, in the unit that is shown."""
        found = self._estimates.bounds(statistic)
        return None if found is None else found[self.positions]

    def entries(self, statistic: str) -> Iterator[tuple[Any, FloatArray]]:
        """Yield each entry of a statistic by its label, as by `bounds`."""
        for label, found in self._estimates.entries(statistic).items():
            yield label, found[self.positions]

    @cached_property
    def runs(self) -> FloatArray:
        """Values of the completed runs at the places, shape (run, place); NaN behind an end."""
        values = self.view.completed_values(self.design, self.output)[:, self.positions]
        found: FloatArray = self.view.scale(self.output).from_si(values)
        return found

    def some_runs(self, most: int) -> FloatArray:
        """Return a random part of the runs, the same each time."""
        numbers = xr.Dataset({"row": (RUN, np.arange(len(self.runs)))})
        return self.runs[thin_runs(numbers, most)["row"].values]

    @property
    def outlying_runs(self) -> FloatArray:
        """Values of the outlying runs at the places, shape (run, place)."""
        mask = self.view.statistics.get(self.design, self.output, "outlying")
        every = read_group(self.view.tree, RUNS, self.design)[self.output].values
        numbers = [] if mask is None else mask["curve"].values[mask.values == 1]
        values = every[np.asarray(numbers, dtype=np.int64)][:, self.positions]
        found: FloatArray = self.view.scale(self.output).from_si(values)
        return found

"""The runs of a design as points: some of many, the same ones in all charts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.read import group
from uqpen.figures.part import Part
from uqpen.figures.scatter import thinned
from uqpen.labels import MATRIX, RUN, RUNS, STATUS, Status
from uqpen.summary.digits import grouped

__all__ = ["Cloud"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

# Runs in a chart at the most, and lost ones besides.
_MOST_RUNS, _MOST_LOST = 400, 100


@dataclass(frozen=True)
class Cloud:
    """The runs of a design that are shown.

    Parameters
    ----------
    part : Part
    design : str
        One of which some runs came back.
    """

    part: Part
    design: str

    @cached_property
    def runs(self) -> xr.Dataset:
        """Those that are a sample of the law, each with its place among all runs of the design."""
        every = group(self.part.tree, RUNS, self.design)
        places = np.arange(every.sizes[RUN])
        if MATRIX in every:
            places = places[every[MATRIX].values <= 1]
        return self.part.runs(self.design).assign_coords(number=(RUN, places))

    @cached_property
    def came_back(self) -> BoolArray:
        """Which of them did."""
        is_ok: BoolArray = self.runs[STATUS].values == Status.OK
        return is_ok

    @cached_property
    def ok(self) -> xr.Dataset:
        """Some of those that came back."""
        return _some(self.runs, self.came_back, _MOST_RUNS)

    @cached_property
    def lost(self) -> xr.Dataset:
        """Some of those that did not."""
        return _some(self.runs, ~self.came_back, _MOST_LOST)

    @property
    def inputs(self) -> list[str]:
        """Those that are not the same in all runs."""
        return self.part.random_inputs(self.design)

    @property
    def thinning(self) -> str:
        """How many of the runs are shown."""
        whole = int(self.came_back.sum())
        counts = [_counted(self.ok, whole, "that came back")]
        if lost := len(self.came_back) - whole:
            counts.append(_counted(self.lost, lost, "that were lost"))
        return f"Runs of {self.design} that are shown: {', '.join(counts)}."

    def values(self, name: str, runs: xr.Dataset) -> FloatArray:
        """Of an input or an output that is a number, in the unit that is shown."""
        found: FloatArray = self.part.measure(name).from_si(runs[name].values)
        return found


def _some(runs: xr.Dataset, which: BoolArray, most: int) -> xr.Dataset:
    """Some of the runs, without copying all."""
    places = xr.Dataset({"place": (RUN, np.flatnonzero(which))})
    return runs.isel({RUN: thinned(places, most)["place"].values})


def _counted(shown: xr.Dataset, whole: int, what: str) -> str:
    number = shown.sizes[RUN]
    if number == whole:
        return f"{'all' if whole > 1 else 'the'} {grouped(whole)} {what}"
    return f"{grouped(number)} of {grouped(whole)} {what}"

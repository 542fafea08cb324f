"""The runs of a design as points: some of many, the same ones in all charts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr

from uqpen.archive.read import read_group
from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.labels import MATRIX, RUN, RUNS, STATUS
from uqpen.core.status import Status
from uqpen.results.archive_view import ArchiveView, thin_runs
from uqpen.results.digits import grouped_number

__all__ = ["PlottedRuns"]


# Runs in a chart at the most, and failed ones besides.
_MOST_RUNS, _MOST_LOST = 400, 100


@dataclass(frozen=True)
class PlottedRuns:
    """Runs that are shown of a design with some completed runs."""

    view: ArchiveView
    design: str

    @cached_property
    def runs(self) -> xr.Dataset:
        """Sample of the joint distribution, each run with its place among all of the design."""
        every = read_group(self.view.tree, RUNS, self.design)
        runs = self.view.design(self.design).shown_runs
        if MATRIX in every:
            places = np.flatnonzero(every[MATRIX].values <= 1)
        else:
            places = np.arange(runs.sizes[RUN])
        return runs.assign_coords(number=(RUN, places[: runs.sizes[RUN]]))

    @cached_property
    def completed(self) -> BoolArray:
        """Completed runs, as a mask of the sample."""
        is_ok: BoolArray = self.runs[STATUS].values == Status.OK
        return is_ok

    @cached_property
    def shown_completed(self) -> xr.Dataset:
        """Some of the completed runs."""
        return _sample_runs(self.runs, self.completed, _MOST_RUNS)

    @cached_property
    def shown_failed(self) -> xr.Dataset:
        """Some of the failed runs."""
        return _sample_runs(self.runs, ~self.completed, _MOST_LOST)

    @property
    def inputs(self) -> list[str]:
        """Inputs that are not the same in all runs."""
        return self.view.design(self.design).random_inputs

    @property
    def thinning_note(self) -> str:
        """Number of the runs that are shown."""
        whole = int(self.completed.sum())
        counts = [_count_text(self.shown_completed, whole, "completed")]
        if failed := len(self.completed) - whole:
            counts.append(_count_text(self.shown_failed, failed, "failed"))
        return f"Runs of {self.design} in the charts: {', '.join(counts)}."

    def values(self, name: str, runs: xr.Dataset) -> FloatArray:
        """Values of an input or a numeric output, in the unit that is shown."""
        found: FloatArray = self.view.scale(name).from_si(runs[name].values)
        return found


def _sample_runs(runs: xr.Dataset, which: BoolArray, most: int) -> xr.Dataset:
    """Some of the runs, without copying all."""
    places = xr.Dataset({"place": (RUN, np.flatnonzero(which))})
    return runs.isel({RUN: thin_runs(places, most)["place"].values})


def _count_text(shown: xr.Dataset, whole: int, status: str) -> str:
    number = shown.sizes[RUN]
    if number == whole:
        return f"{'all' if whole > 1 else 'the'} {grouped_number(whole)} {status}"
    return f"{grouped_number(number)} of {grouped_number(whole)} {status}"

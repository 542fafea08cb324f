"""The runs of one design, as figures and the report show them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr

from uqpen.archive.read import read_group
from uqpen.core.arrays import FloatArray, rows_by_weight
from uqpen.core.labels import ROLE, RUN, RUNS, SAMPLING, STATUS, WEIGHT
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.execution import status_counts
from uqpen.execution.omitted_runs import are_omitted
from uqpen.results.digits import grouped_number
from uqpen.statistics.convergence import reason_without_parts
from uqpen.statistics.run_samples import input_sample

__all__ = ["DesignView", "thin_runs"]


@dataclass(frozen=True)
class DesignView:
    """The runs of one design.

    Parameters
    ----------
    tree : DataTree
        The groups of the model.
    design : str
        The name of the design.
    """

    tree: xr.DataTree
    design: str

    @property
    def _archived(self) -> xr.Dataset:
        return read_group(self.tree, RUNS, self.design)

    @property
    def sampling(self) -> Sampling:
        """The way in which the points were chosen."""
        return Sampling(self._archived.attrs[SAMPLING])

    @property
    def runs(self) -> xr.Dataset:
        """The runs that sample the input distribution, failed ones too."""
        return input_sample(self._archived)

    @cached_property
    def shown_runs(self) -> xr.Dataset:
        """The runs that figures show: those of `runs`, in memory, the first of very many."""
        return self.runs.isel({RUN: slice(RUNS_IN_MEMORY)}).load()

    @property
    def shown_prefix(self) -> str:
        """Words before the design's name in figures that show only some of its runs."""
        if self.runs.sizes[RUN] <= RUNS_IN_MEMORY:
            return ""
        return f"the first {grouped_number(RUNS_IN_MEMORY)} runs of "

    @property
    def has_completed_runs(self) -> bool:
        """True if a run completed."""
        return bool(status_counts(self.runs)[Status.OK])

    @property
    def keeps_runs(self) -> bool:
        """True if the archive has the runs, and not only their statistics."""
        return not are_omitted(self._archived)

    @property
    def shows_all_runs(self) -> bool:
        """True if the runs that figures show are all of the design."""
        return self.keeps_runs and self.runs.sizes[RUN] <= RUNS_IN_MEMORY

    @property
    def has_shown_runs(self) -> bool:
        """True if there are completed runs to draw."""
        return self.keeps_runs and self.has_completed_runs

    @property
    def random_inputs(self) -> list[str]:
        """The inputs that are not the same in all runs."""
        variables = self._archived.variables
        named = [str(name) for name, v in variables.items() if v.attrs.get(ROLE) == "input"]
        return [name for name in named if variables[name].dims]

    @property
    def reason_without_convergence(self) -> str:
        """Reason why no part of the runs is a smaller sample; empty where some are."""
        return reason_without_parts(self._archived)

    def completed_values(self, output: str) -> FloatArray:
        """Return an output of the completed ones of the shown runs, in SI units.

        Runs without a value of a derived output are left out. Of weighted runs, as many values as
        there are runs, each as often as its weight says.
        """
        runs = self.shown_runs
        is_ok = runs[STATUS].values == Status.OK
        # A field has a value where some of its places do.
        values = runs[output].values
        is_ok &= ~np.isnan(values).all(axis=tuple(range(1, values.ndim)))
        values = np.asarray(values[is_ok], dtype=np.float64)
        if WEIGHT not in runs.coords or not values.size:
            return values
        weights = np.asarray(runs[WEIGHT].values[is_ok], dtype=np.float64)
        return values[rows_by_weight(weights, (np.arange(len(values)) + 0.5) / len(values))]


def thin_runs(runs: xr.Dataset, most: int) -> xr.Dataset:
    """A random part of the runs, the same each time, in order; the first runs may not be random."""
    size = runs.sizes[RUN]
    if size <= most:
        return runs
    chosen = Stream(0, "figures", "runs").generator().choice(size, most, replace=False)
    return runs.isel({RUN: np.sort(chosen)})

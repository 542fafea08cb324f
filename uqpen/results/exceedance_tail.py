"""Probability of exceeding a value, run by run, up to the largest run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import STATUS
from uqpen.core.status import Status
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import grouped_number, number_text
from uqpen.results.empirical_cdf import empirical_cdf
from uqpen.results.simultaneous_band import SimultaneousBand
from uqpen.results.texts import unit_suffix

__all__ = ["FEW_DISTINCT", "ExceedanceTail", "LargestRun"]

# Fewer distinct values than this are drawn as steps, all of them.
FEW_DISTINCT = 500
# Points of a line through more values, of each spacing.
_POINTS = 150


@dataclass(frozen=True)
class LargestRun:
    """The largest value of an output among the completed runs of a design.

    Parameters
    ----------
    value : float
        In the unit that is shown.
    runs : int
        Number of the completed runs.
    unit : str
        The text behind a number.
    """

    value: float
    runs: int
    unit: str

    @classmethod
    def of_design(cls, view: ArchiveView, design: str, output: str) -> LargestRun:
        """Return the largest run of a design with at least one completed run."""
        if not view.design(design).shows_all_runs:
            return cls._of_function(view, design, output)
        runs = view.design(design).shown_runs
        completed = runs[output].values[runs[STATUS].values == Status.OK]
        completed = completed[~np.isnan(completed)]
        value = float(view.scale(output).from_si(completed.max()))
        return cls(value, int(completed.size), unit_suffix(view.unit(output)))

    @classmethod
    def _of_function(cls, view: ArchiveView, design: str, output: str) -> LargestRun:
        """Return the end of a distribution function, which is the largest run."""
        values = view.estimates(output, "cdf_value")[design]
        value = float(view.scale(output).from_si(values.values[-1]))
        used = int(view.estimates(output, "cdf_band")[design].attrs["runs_used"])
        return cls(value, used, unit_suffix(view.unit(output)))

    @property
    def name(self) -> str:
        """Name in the row of a table."""
        return f"largest of {grouped_number(self.runs)} run{'s' * (self.runs != 1)}"

    @property
    def text(self) -> str:
        """Value with the unit."""
        return f"{number_text(self.value)}{self.unit}"

    @property
    def sentence(self) -> str:
        """A sentence on it."""
        return f"The {self.name} is {self.text}."


@dataclass(frozen=True)
class ExceedanceTail:
    """Probability of exceeding each of some values, by the completed runs of a design.

    Of many values some are taken, spaced evenly by that probability and by its logarithm: an
    archive's function has equally spaced ranks, and few of them lie in the tail. The last value is
    the largest run. No run exceeds it, so the probability there is that of all values from the run
    before it.

    Parameters
    ----------
    values : ndarray, shape (value,)
        Ascending, in the unit that is shown; empty where all runs are equal.
    band : ndarray, shape (value, bound)
        The probability, and the simultaneous band for any outcome of failed runs.
    largest : LargestRun
        The end of the tail.
    """

    values: FloatArray
    band: FloatArray
    largest: LargestRun

    @classmethod
    def of_design(
        cls, view: ArchiveView, design: str, output: str, limits: SimultaneousBand
    ) -> ExceedanceTail:
        """Return the tail of an output by a design with at least one completed run."""
        outputs = np.sort(view.shown_values(design, output))
        values = np.unique(outputs)
        if values.size >= FEW_DISTINCT:
            spaced = [space(1, outputs.size, _POINTS) for space in (np.geomspace, np.linspace)]
            left = np.concatenate(spaced).round().astype(np.int64)
            values = np.unique(outputs[outputs.size - left])
        # The largest value leaves nothing above it, which has no logarithm.
        values = values[values < outputs[-1]]
        band = 1 - limits.around(empirical_cdf(outputs, values))
        largest = LargestRun.of_design(view, design, output)
        if not values.size:
            return cls(values, band[:, [0, 2, 1]], largest)
        shown = np.append(view.scale(output).from_si(values), largest.value)
        # The probability of exceeding is least where the distribution function is greatest.
        return cls(shown, np.append(band, band[-1:], axis=0)[:, [0, 2, 1]], largest)

"""Distribution function of archived runs: at any value, its simultaneous band, its upper tail."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import STATUS
from uqpen.core.status import Status
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import grouped_number, number_text
from uqpen.results.texts import unit_suffix

__all__ = ["FEW_DISTINCT", "ExceedanceTail", "LargestRun", "SimultaneousBand", "empirical_cdf"]

# Fewer distinct values than this are drawn as steps, all of them.
FEW_DISTINCT = 500
# Points of a line through more values, of each spacing.
_POINTS = 150


def empirical_cdf(outputs: FloatArray, values: FloatArray) -> FloatArray:
    """Return the share of runs at or below each value.

    An archive has this function at some ranks alone. Between them, the runs decide.

    Parameters
    ----------
    outputs : ndarray, shape (run,)
        Of the completed runs.
    values : ndarray, shape (value,)
        In the unit of the outputs.

    Returns
    -------
    ndarray, shape (value,)
    """
    return np.searchsorted(np.sort(outputs), values, side="right") / outputs.size


@dataclass(frozen=True)
class SimultaneousBand:
    """Band around the share of the completed runs at or below each value.

    The estimate is of the completed runs. A failed run could have had any result, so for the lower
    end all of them lie above the value, and for the upper end all at or below it. The half-width is
    that of as many runs as there are of both. Requested probabilities allow for failed runs in the
    same way.

    Parameters
    ----------
    half_width : float
        Over the completed runs; NaN where no band is known.
    missing_share : float
        Share of the failed runs among the admissible ones, from 0 to below 1.

    Notes
    -----
    The two ends are functions of all n runs: with every failed run at plus infinity, and with every
    one at minus infinity. The one-sided inequality of Dvoretzky, Kiefer and Wolfowitz with
    Massart's constant (1990, Ann. Probab. 18, 1269-1283) holds for each, with a half-width that
    falls with the root of n. So the band covers with at least its level.
    """

    half_width: float
    missing_share: float = 0.0

    @classmethod
    def from_estimates(cls, band: xr.DataArray) -> SimultaneousBand:
        """Return the band of an archive's ``cdf_band``, which is of the completed runs alone.

        Parameters
        ----------
        band : DataArray
            Along ``rank`` and ``bound``, with at least one rank; the same width at all of them.
            Its attributes count the runs.
        """
        estimate, lower, _ = band.values[-1]
        used = int(band.attrs.get("runs_used", 0))
        inadmissible = int(band.attrs.get(f"runs_{Status.INADMISSIBLE.meaning}", 0))
        admissible = int(band.attrs.get("runs", used)) - inadmissible
        # Nearest to 1 no probability cuts the lower side off.
        return cls(float(estimate - lower), 1 - used / admissible if used else 0.0)

    def around(self, share: FloatArray) -> FloatArray:
        """Return the band around shares of the completed runs.

        Parameters
        ----------
        share : ndarray
            From 0 to 1.

        Returns
        -------
        ndarray, shape (..., bound)
            The share itself, and the ends of the band, which are NaN where none is known.
        """
        kept = 1.0 - self.missing_share
        half = self.half_width * math.sqrt(kept)
        lower = np.maximum(kept * share - half, 0.0)
        upper = np.minimum(kept * share + self.missing_share + half, 1.0)
        return np.stack([share, lower, upper], axis=-1)


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
        if view.design(design).shows_all_runs:
            runs = view.design(design).shown_runs
            completed = runs[output].values[runs[STATUS].values == Status.OK]
            completed = completed[~np.isnan(completed)]
            largest, count = completed.max(), int(completed.size)
        else:
            # It is the end of the distribution function.
            largest = view.estimates(output, "cdf_value")[design].values[-1]
            count = int(view.estimates(output, "cdf_band")[design].attrs["runs_used"])
        value = float(view.scale(output).from_si(largest))
        return cls(value, count, unit_suffix(view.unit(output)))

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

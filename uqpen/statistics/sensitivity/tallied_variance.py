"""Share of the variance that an input explains, from sums over independent runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from uqpen.core.arrays import FloatArray
from uqpen.statistics.estimate_vector import EstimateVector
from uqpen.statistics.sensitivity.local_regression import Lines
from uqpen.statistics.sensitivity.sampled_variable import SampledVariable
from uqpen.statistics.standard_errors import standard_error
from uqpen.statistics.tally import Tally

__all__ = ["TalliedLines", "TalliedVariance"]


class TalliedLines(Lines, Protocol):
    """Lines through a variable that go by compiled loops."""

    def share_tally(self, ratio: float, runs: int) -> Tally:
        """Return the tally of each run's influence on the share that the input explains.

        Parameters
        ----------
        ratio : float
            Of the variance about the lines to the variance.
        runs : int
            Number of independent runs.
        """


@dataclass(frozen=True, eq=False)
class TalliedVariance:
    """Variance of a variable over independent runs, and the part about the lines of an input."""

    total: FloatArray
    lines: TalliedLines

    def estimates(self, variable: SampledVariable) -> EstimateVector:
        """Return the share of the variance that the input explains, with its bounds."""
        ratio = self.lines.variance / self.total
        tally = self.lines.share_tally(float(ratio), variable.sample.size)
        errors, freedom = standard_error(variable.sample, tally.scaled(1 / float(self.total)))
        return variable.estimates(1 - ratio, errors, freedom, self.lines.pair_noise / self.total)

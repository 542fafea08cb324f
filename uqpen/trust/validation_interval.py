"""Intervals of validation runs, and their widening to one joint level.

Each interval misses the true value in 5 % of studies. Were an estimate refused wherever one of
several does, right estimates would be refused the more often the more designs a study has. So the
level of each is raised, to 1 - (1 - level) / count, that all of them hold in at least 95 % of
studies, whatever their dependence (Bonferroni).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from uqpen.statistics.intervals import student_quantile

__all__ = ["ValidationInterval", "band_widening", "jointly_widened"]

# An archive has no interval at another level. Its ends are moved out as those of Student's t with
# the fewest degrees of freedom that designs commonly have, 10 replicates. Other intervals move out
# less: normal ones by 1.27 instead of 1.38 for four designs, the upper end of Clopper-Pearson after
# no event by 1.37.
_FREEDOM = 9


class ValidationInterval(NamedTuple):
    """Interval of a statistic by a design's runs.

    It is not of all admissible inputs where runs failed and it does not allow for them.
    """

    design: str
    estimate: float
    lower: float
    upper: float
    level: float
    is_of_all_inputs: bool = True

    def widened(self, factor: float) -> ValidationInterval:
        """Return it with both sides multiplied by a factor."""
        return self._replace(
            lower=self.estimate - factor * (self.estimate - self.lower),
            upper=self.estimate + factor * (self.upper - self.estimate),
        )

    def overlaps(self, low: float, high: float) -> bool:
        """Return True if it has a value in common with another interval."""
        return low <= self.upper and high >= self.lower


def jointly_widened(intervals: Sequence[ValidationInterval]) -> list[ValidationInterval]:
    """Return intervals that contain the true value all together, at the level of each before."""
    return [each.widened(_widening(each.level, len(intervals))) for each in intervals]


def _widening(level: float, count: int) -> float:
    """Return the factor for the sides of one of several intervals; 1 for a single one."""
    if count == 1:
        return 1.0
    joint = 1 - (1 - level) / count
    return student_quantile(_FREEDOM, joint) / student_quantile(_FREEDOM, level)


def band_widening(level: float, count: int) -> float:
    """Return the same factor for a band of Dvoretzky, Kiefer, Wolfowitz and Massart.

    Its half-width is √(ln(2 / (1 - level)) / 2n).
    """
    return math.sqrt(math.log(2 * count / (1 - level)) / math.log(2 / (1 - level)))

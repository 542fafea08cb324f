"""Record of a rehearsal: the estimates of all repeats, and how often their intervals hold."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.rehearsal.repeats import Repeat
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.intervals import clopper_pearson

__all__ = ["RepeatRecord"]

# An interval falls short where it holds less often than stated by more than this, beyond the noise.
# It is what the project allows its own intervals without a note.
_ALLOWED = 0.03


@dataclass(frozen=True)
class RepeatRecord:
    """Estimates along repeat, source, entry and bound.

    Parameters
    ----------
    estimates : ndarray, shape (repeat, source, entry, bound)
        In SI units; NaN where there is none.
    run_counts : ndarray, shape (repeat, source)
        Number of runs.
    truth : ndarray, shape (entry, bound)
        The true values; their bounds are of a sample, and NaN where they are exact.
    """

    estimates: FloatArray
    run_counts: FloatArray
    truth: FloatArray

    @classmethod
    def of(cls, repeats: Sequence[Repeat], truth: Sequence[FloatArray]) -> RepeatRecord:
        """Return the record of repeats in any order, with the truth of each statistic."""
        ordered = sorted(repeats, key=lambda repeat: repeat.number)
        estimates = np.stack([each.estimates for each in ordered])
        return cls(estimates, np.stack([each.runs for each in ordered]), np.concatenate(truth))

    @property
    def repeats(self) -> int:
        """Number of repeats."""
        return len(self.estimates)

    @property
    def has_interval(self) -> BoolArray:
        """True where an estimate has an interval, of shape (repeat, source, entry)."""
        return np.asarray(~np.isnan(self.estimates[..., 1:]).any(axis=-1))

    def coverage(self) -> FloatArray:
        """Return the share of the intervals that hold the truth, of shape (source, entry, bound).

        Its own interval is Clopper and Pearson's. NaN where no repeat has an interval.
        """
        lower, upper = np.moveaxis(self.estimates[..., 1:], -1, 0)
        given = self.has_interval.sum(axis=0)
        truth = self.truth[:, 0]
        held = (self.has_interval & (lower <= truth) & (truth <= upper)).sum(axis=0)
        with np.errstate(invalid="ignore"):
            found = np.stack([held / given, *clopper_pearson(held, given, LEVEL)], axis=-1)
        found[given == 0] = np.nan
        return found

    def falls_short(self, levels: FloatArray) -> BoolArray:
        """Return whether intervals hold less often than stated, of shape (source, entry).

        Parameters
        ----------
        levels : ndarray, shape (entry,)
            The stated confidence levels.
        """
        coverage = self.coverage()
        return np.asarray((coverage[..., 0] < levels - _ALLOWED) & (coverage[..., 2] < levels))

    def half_widths(self) -> FloatArray:
        """Return the median half-widths, of shape (source, entry); NaN where there are none."""
        halves = (self.estimates[..., 2] - self.estimates[..., 1]) / 2
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # where no repeat has an interval
            return np.asarray(np.nanmedian(halves, axis=0))

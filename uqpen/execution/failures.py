"""Policy for missing runs: retries, and the largest allowed share."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from uqpen.core.errors import TooManyFailedError
from uqpen.core.settings import count, flag, share, validate
from uqpen.core.status import STATUS_TEXT, Status
from uqpen.execution.batch import BatchResult

_ROUNDING = 1e-12


@dataclass(frozen=True)
class FailurePolicy:
    """Number of retries of missing runs, how many may be missing, and what the first ones decide.

    Parameters
    ----------
    retry : int
        Number of further attempts at a missing run; an inadmissible run is never tried again.
    at_most : float
        The share of a design's runs that may be missing, from 0 to 1.
    stop_after : int
        Number of first runs that stop the study if all of them fail alike; 0 for never.
    trial : bool
        Whether the first run is made alone, before others are sent out.
    """

    retry: int = count(
        minimum=0,
        maximum=100,
        default=0,
        expected="how often a failed run is repeated, a whole number from 0 to 100",
    )
    at_most: float = share(default=1.0, expected='the share of runs that may fail, such as "5 %"')
    stop_after: int = count(
        minimum=0,
        maximum=1000,
        default=10,
        expected="how many first runs must all fail alike for the study to stop, 0 for never",
    )
    trial: bool = flag(default=True)

    def __post_init__(self) -> None:
        validate(self)


@dataclass
class FailureCount:
    """Count of a model's missing runs in a design so far; `allowed` is a share of all `runs`."""

    allowed: float
    runs: int
    statuses: Counter[Status] = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)
    counted: set[int] = field(default_factory=set)

    def add(self, batch_result: BatchResult) -> int:
        """Count the missing runs of a batch result that are new, and return their number.

        A batch of a vectorised model is made again as a whole where some of it is missing.

        Raises
        ------
        TooManyFailedError
            If there are now more than are allowed.
        """
        start, results = batch_result.start, batch_result.results
        missing = np.flatnonzero(results.status > Status.INADMISSIBLE).tolist()
        failed = [run for run in missing if start + run not in self.counted]
        self.counted.update(start + run for run in failed)
        self.statuses.update(Status(int(results.status[run])) for run in failed)
        self.reasons.update(results.reasons[run] for run in failed)
        # 29 of 100 are no more than 0.29, although 0.29 * 100 < 29 in floating point.
        if failed and self.statuses.total() > self.allowed * self.runs * (1 + _ROUNDING):
            raise TooManyFailedError(self._message())
        return len(failed)

    def forget(self, stop: int) -> None:
        """Forget the numbers of the runs before one; none of them is made again."""
        self.counted = {run for run in self.counted if run >= stop}

    def _message(self) -> str:
        kinds = ", ".join(
            f"{count} {STATUS_TEXT[status]}" for status, count in sorted(self.statuses.items())
        )
        reason, count = self.reasons.most_common(1)[0]
        return (
            f"{self.statuses.total()} of {self.runs} runs have failed so far ({kinds}), more than "
            f"the {100 * self.allowed:g} % that [failures] at_most allows\n"
            f"  the most frequent reason, {count} times: {reason}"
        )

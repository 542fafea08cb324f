"""Record of a benchmark: every estimate of every repeat, and the reference."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from uqpen.benchmark.accuracy import Accuracy, convergence_slope, root_mean_square_errors
from uqpen.benchmark.methods import BenchmarkMethod
from uqpen.benchmark.settings import BenchmarkSettings
from uqpen.benchmark.statistics import BenchmarkStatistic, Estimates
from uqpen.benchmark.verdicts import Verdict, find_verdict
from uqpen.core.arrays import FloatArray

__all__ = ["EstimateRecord"]


@dataclass(frozen=True)
class EstimateRecord:
    """Estimates along method, budget, repeat, entry and bound.

    Parameters
    ----------
    methods : tuple of BenchmarkMethod
        In the order of the first axis.
    settings : BenchmarkSettings
        Budgets and repeats.
    estimates : dict of BenchmarkStatistic to ndarray
        Of shape (method, budget, repeat, entry, bound); NaN where there is none.
    reference : dict of BenchmarkStatistic to ndarray
        The reference's, of shape (entry, bound).
    scales : dict of BenchmarkStatistic to ndarray
        Scales of the relative errors, of shape (entry,).
    reference_runs : int
        Number of runs of the reference.
    """

    methods: tuple[BenchmarkMethod, ...]
    settings: BenchmarkSettings
    estimates: Mapping[BenchmarkStatistic, FloatArray]
    reference: Mapping[BenchmarkStatistic, FloatArray]
    scales: Mapping[BenchmarkStatistic, FloatArray]
    reference_runs: int

    @classmethod
    def empty(
        cls,
        methods: tuple[BenchmarkMethod, ...],
        settings: BenchmarkSettings,
        statistics: Sequence[BenchmarkStatistic],
        reference: Estimates,
        *,
        reference_runs: int,
    ) -> EstimateRecord:
        """Return a record of nothing but the reference's estimates of some statistics."""
        shape = (len(methods), len(settings.budgets), settings.repeats)
        truth = {each: each.estimates(reference) for each in statistics}
        spreads = {each: float(reference[each.output]["std"].values[0]) for each in statistics}
        return cls(
            methods,
            settings,
            {each: np.full((*shape, *truth[each].shape), np.nan) for each in statistics},
            truth,
            {each: each.error_scale(truth[each][:, 0], spreads[each]) for each in statistics},
            reference_runs,
        )

    def add(self, method: int, budget: int, repeat: int, estimates: Estimates) -> None:
        """Take the estimates of a method from one repeat, all given by their positions."""
        for statistic, found in self.estimates.items():
            found[method, budget, repeat] = statistic.estimates(estimates)

    def accuracy(self, statistic: BenchmarkStatistic) -> Accuracy:
        """Return the relative errors, of shape (method, budget, entry)."""
        values = np.moveaxis(self.estimates[statistic][..., 0], 2, -1)
        truth = self.reference[statistic][:, :1]
        return root_mean_square_errors((values - truth) / self.scales[statistic][:, np.newaxis])

    def coverage(self, statistic: BenchmarkStatistic) -> FloatArray:
        """Return the share of the intervals that contain the reference; NaN for no intervals.

        Its shape is (method, budget, entry).
        """
        lower, upper = np.moveaxis(self.estimates[statistic][..., 1:], -1, 0)
        truth = self.reference[statistic][:, 0]
        has_interval = ~(np.isnan(lower) | np.isnan(upper))
        held = (has_interval & (lower <= truth) & (truth <= upper)).sum(axis=2)
        with np.errstate(invalid="ignore"):
            share: FloatArray = held / has_interval.sum(axis=2)
        return share

    def reference_error(self, statistic: BenchmarkStatistic, entry: int) -> float:
        """Return the half-width of the reference's interval, relative as errors; NaN for none."""
        _, lower, upper = self.reference[statistic][entry]
        return float((upper - lower) / 2 / self.scales[statistic][entry])

    def slopes(self, statistic: BenchmarkStatistic) -> FloatArray:
        """Return convergence rates over the usable budgets, of shape (method, entry, bound)."""
        errors = self.accuracy(statistic)
        slopes = []
        for position, method in enumerate(self.methods):
            runs = np.array([method.cost(budget).runs for budget in self.settings.budgets])
            used = errors[position, runs > 0]
            runs = runs[runs > 0].astype(np.float64)
            error = used.reliable_error
            slopes.append(convergence_slope(used.logarithm, error, runs, errors.repeats))
        return np.stack(slopes)

    def contestants(self, variant: str) -> list[int]:
        """Return the positions of the methods in one comparison."""
        return [i for i, method in enumerate(self.methods) if variant in method.variants]

    def verdict(
        self, statistic: BenchmarkStatistic, variant: str, budget: int, entry: int
    ) -> Verdict | None:
        """Return the verdict of one comparison; budget and entry by their positions."""
        inside = self.contestants(variant)
        return find_verdict(
            [self.methods[i].source for i in inside],
            self.accuracy(statistic)[inside, budget, entry],
            self.reference_error(statistic, entry),
        )

"""Record of a benchmark: every estimate of every repeat, and the reference."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from uqpen.benchmark.accuracy import Accuracy, convergence_slope, root_mean_square_errors
from uqpen.benchmark.methods import BenchmarkMethod
from uqpen.benchmark.settings import BenchmarkSettings
from uqpen.benchmark.statistics import BenchmarkStatistic, Estimates
from uqpen.benchmark.verdicts import Verdict, find_verdict
from uqpen.core.labels import BOUNDS

__all__ = ["EstimateRecord"]

FloatArray = npt.NDArray[np.float64]


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
        statistics: tuple[BenchmarkStatistic, ...],
        reference: Estimates,
        *,
        reference_runs: int,
    ) -> EstimateRecord:
        """Return a record of nothing but the reference.

        Parameters
        ----------
        methods, settings, reference_runs
            As of the class.
        statistics : tuple of BenchmarkStatistic
            The statistics that are judged.
        reference : mapping
            The reference's estimate arrays by output and statistic.
        """
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
        """Relative errors of shape (method, budget, entry)."""
        values = np.moveaxis(self.estimates[statistic][..., 0], 2, -1)
        truth = self.reference[statistic][:, :1]
        return root_mean_square_errors((values - truth) / self.scales[statistic][:, np.newaxis])

    def coverage(self, statistic: BenchmarkStatistic) -> FloatArray:
        """Share of the repeats whose interval contains the reference.

        Returns
        -------
        ndarray, shape (method, budget, entry)
            Of the repeats that have an interval; NaN where none has.
        """
        lower, upper = np.moveaxis(self.estimates[statistic][..., 1:], -1, 0)
        truth = self.reference[statistic][:, 0]
        has_interval = ~(np.isnan(lower) | np.isnan(upper))
        held = (has_interval & (lower <= truth) & (truth <= upper)).sum(axis=2)
        with np.errstate(invalid="ignore"):
            share: FloatArray = held / has_interval.sum(axis=2)
        return share

    def reference_error(self, statistic: BenchmarkStatistic, entry: int) -> float:
        """Half-width of the reference's interval, relative as errors are; NaN without bounds."""
        _, lower, upper = self.reference[statistic][entry]
        return float((upper - lower) / 2 / self.scales[statistic][entry])

    def slopes(self, statistic: BenchmarkStatistic) -> FloatArray:
        """Convergence rates over the usable budgets, of shape (method, entry, bound)."""
        errors = self.accuracy(statistic)
        found = np.full((*errors.logarithm[:, 0].shape, len(BOUNDS)), np.nan)
        for position, method in enumerate(self.methods):
            runs = np.array([method.cost(budget).runs for budget in self.settings.budgets])
            used = runs > 0
            found[position] = convergence_slope(
                errors.logarithm[position, used],
                np.where(errors.is_heavy, np.nan, errors.error)[position, used],
                runs[used].astype(np.float64),
                errors.repeats,
            )
        return found

    def verdict(
        self, statistic: BenchmarkStatistic, variant: str, budget: int, entry: int
    ) -> Verdict | None:
        """Return the verdict of one comparison; budget and entry by their positions."""
        inside = [i for i, method in enumerate(self.methods) if variant in method.variants]
        errors = self.accuracy(statistic)
        return find_verdict(
            [self.methods[i].source for i in inside],
            Accuracy(
                errors.logarithm[inside, budget, entry],
                errors.error[inside, budget, entry],
                errors.is_heavy[inside, budget, entry],
                errors.repeats,
            ),
            self.reference_error(statistic, entry),
        )

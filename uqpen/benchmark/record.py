"""What a comparison has seen: every estimate of every repeat, and the reference."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.benchmark.accuracy import Accuracy, convergence_slope, root_mean_square_errors
from uqpen.benchmark.methods import BenchmarkMethod
from uqpen.benchmark.settings import BenchmarkSettings
from uqpen.benchmark.statistics import BenchmarkStatistic
from uqpen.benchmark.verdicts import Verdict, find_verdict
from uqpen.core.labels import BOUNDS, MOMENTS

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
        What errors are relative to, of shape (entry,).
    reference_runs : int
        How many runs the reference made.
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
        answers: Mapping[str, xr.Dataset],
        *,
        reference_runs: int,
    ) -> EstimateRecord:
        """A record of nothing but the reference.

        Parameters
        ----------
        methods, terms, reference_runs
            As of the class.
        statistics : tuple of BenchmarkStatistic
            What is judged.
        answers : mapping of str to Dataset
            What the reference's analyses answered, by group.
        """
        shape = (len(methods), len(settings.budgets), settings.repeats)
        truth = {each: each.estimates(answers) for each in statistics}
        spreads = {
            each: float(answers[MOMENTS][f"{each.output}_std"].values[0]) for each in statistics
        }
        return cls(
            methods,
            settings,
            {each: np.full((*shape, *truth[each].shape), np.nan) for each in statistics},
            truth,
            {each: each.error_scale(truth[each][:, 0], spreads[each]) for each in statistics},
            reference_runs,
        )

    def add(self, method: int, budget: int, repeat: int, answers: Mapping[str, xr.Dataset]) -> None:
        """Take a method's answers, given by the positions of what they are of."""
        for statistic, estimates in self.estimates.items():
            estimates[method, budget, repeat] = statistic.estimates(answers)

    def accuracy(self, statistic: BenchmarkStatistic) -> Accuracy:
        """Relative errors of shape (method, budget, entry)."""
        values = np.moveaxis(self.estimates[statistic][..., 0], 2, -1)
        truth = self.reference[statistic][:, :1]
        return root_mean_square_errors((values - truth) / self.scales[statistic][:, np.newaxis])

    def coverage(self, statistic: BenchmarkStatistic) -> FloatArray:
        """In what share of the repeats the interval held the reference.

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
        """How far the reference may be off, relative as errors are; NaN where nothing tells."""
        _, lower, upper = self.reference[statistic][entry]
        return float((upper - lower) / 2 / self.scales[statistic][entry])

    def slopes(self, statistic: BenchmarkStatistic) -> FloatArray:
        """Of shape (method, entry, bound), over the budgets that each method can do with."""
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
        """Who wins a contest; budget and entry by their positions."""
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

"""What a comparison has seen: every estimate of every repeat, and the reference."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.head_to_head.accuracy import Accuracy, accuracy, slope
from uqpen.head_to_head.methods import Method
from uqpen.head_to_head.statistics import Statistic
from uqpen.head_to_head.terms import Terms
from uqpen.head_to_head.verdicts import Verdict, judge
from uqpen.labels import BOUNDS, MOMENTS

__all__ = ["Record"]

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Record:
    """Estimates along method, budget, repeat, entry and bound.

    Parameters
    ----------
    methods : tuple of Method
        In the order of the first axis.
    terms : Terms
        Budgets and repeats.
    estimates : dict of Statistic to ndarray
        Of shape (method, budget, repeat, entry, bound); NaN where there is none.
    truth : dict of Statistic to ndarray
        The reference's, of shape (entry, bound).
    scales : dict of Statistic to ndarray
        What errors are relative to, of shape (entry,).
    reference_runs : int
        How many runs the reference made.
    """

    methods: tuple[Method, ...]
    terms: Terms
    estimates: Mapping[Statistic, FloatArray]
    truth: Mapping[Statistic, FloatArray]
    scales: Mapping[Statistic, FloatArray]
    reference_runs: int

    @classmethod
    def empty(
        cls,
        methods: tuple[Method, ...],
        terms: Terms,
        statistics: tuple[Statistic, ...],
        answers: Mapping[str, xr.Dataset],
        *,
        reference_runs: int,
    ) -> Record:
        """A record of nothing but the reference.

        Parameters
        ----------
        methods, terms, reference_runs
            As of the class.
        statistics : tuple of Statistic
            What is judged.
        answers : mapping of str to Dataset
            What the reference's analyses answered, by group.
        """
        shape = (len(methods), len(terms.budgets), terms.repeats)
        truth = {each: each.figures(answers) for each in statistics}
        spreads = {
            each: float(answers[MOMENTS][f"{each.output}_std"].values[0]) for each in statistics
        }
        return cls(
            methods,
            terms,
            {each: np.full((*shape, *truth[each].shape), np.nan) for each in statistics},
            truth,
            {each: each.scale(truth[each][:, 0], spreads[each]) for each in statistics},
            reference_runs,
        )

    def enter(
        self, method: int, budget: int, repeat: int, answers: Mapping[str, xr.Dataset]
    ) -> None:
        """Take a method's answers, given by the positions of what they are of."""
        for statistic, estimates in self.estimates.items():
            estimates[method, budget, repeat] = statistic.figures(answers)

    def accuracy(self, statistic: Statistic) -> Accuracy:
        """Relative errors of shape (method, budget, entry)."""
        values = np.moveaxis(self.estimates[statistic][..., 0], 2, -1)
        truth = self.truth[statistic][:, :1]
        return accuracy((values - truth) / self.scales[statistic][:, np.newaxis])

    def covered(self, statistic: Statistic) -> FloatArray:
        """In what share of the repeats the interval held the reference.

        Returns
        -------
        ndarray, shape (method, budget, entry)
            Of the repeats that have an interval; NaN where none has.
        """
        lower, upper = np.moveaxis(self.estimates[statistic][..., 1:], -1, 0)
        truth = self.truth[statistic][:, 0]
        has_interval = ~(np.isnan(lower) | np.isnan(upper))
        held = (has_interval & (lower <= truth) & (truth <= upper)).sum(axis=2)
        with np.errstate(invalid="ignore"):
            share: FloatArray = held / has_interval.sum(axis=2)
        return share

    def resolution(self, statistic: Statistic, entry: int) -> float:
        """How far the reference may be off, relative as errors are; NaN where nothing tells."""
        _, lower, upper = self.truth[statistic][entry]
        return float((upper - lower) / 2 / self.scales[statistic][entry])

    def slopes(self, statistic: Statistic) -> FloatArray:
        """Of shape (method, entry, bound), over the budgets that each method can do with."""
        errors = self.accuracy(statistic)
        found = np.full((*errors.logarithm[:, 0].shape, len(BOUNDS)), np.nan)
        for position, method in enumerate(self.methods):
            runs = np.array([method.spent(budget).runs for budget in self.terms.budgets])
            used = runs > 0
            found[position] = slope(
                errors.logarithm[position, used],
                np.where(errors.is_heavy, np.nan, errors.error)[position, used],
                runs[used].astype(np.float64),
                errors.repeats,
            )
        return found

    def verdict(
        self, statistic: Statistic, variant: str, budget: int, entry: int
    ) -> Verdict | None:
        """Who wins a contest; budget and entry by their positions."""
        inside = [i for i, method in enumerate(self.methods) if variant in method.variants]
        errors = self.accuracy(statistic)
        return judge(
            [self.methods[i].source for i in inside],
            Accuracy(
                errors.logarithm[inside, budget, entry],
                errors.error[inside, budget, entry],
                errors.is_heavy[inside, budget, entry],
                errors.repeats,
            ),
            self.resolution(statistic, entry),
        )

"""Mean, standard deviation, skewness and kurtosis, and what the tail allows to say of them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from uqpen.analyses.estimate import LEVEL, Interval, bounded, reason_for_none
from uqpen.analyses.quantiles import half_spread
from uqpen.analyses.question import Question
from uqpen.analyses.sample import Plan, Sample
from uqpen.intervals import student_quantile

__all__ = ["moments"]

# Where the standard deviation's interval stopped covering in simulations: a tail so heavy that
# only a few runs decide the variance. With few runs a heavy tail need not show in them: below the
# first number it did not as a rule, up to the second now and then.
_HEAVY_KURTOSIS = 6.0
_FEWEST_EFFECTIVE_RUNS = 1000.0
_FEWEST_RUNS_FOR_TAILS = 200
_ENOUGH_RUNS_FOR_TAILS = 1000
# A law with a heavier tail may give a sample below the former limit; seldom one below this.
_DOUBTFUL_KURTOSIS = 4.5
# Means over replicates covered less than said on heavy tails below this many runs.
_FEWEST_RUNS_FOR_HEAVY_MEANS = 5000

_MEAN_INTERVALS = {
    Plan.INDEPENDENT: Interval("Student t"),
    Plan.REPLICATED: Interval("Student t over replicates"),
    Plan.SINGLE: Interval("Student t on the residuals of an additive fit", "conservative"),
}


@dataclass(frozen=True)
class _Tail:
    """How much of the variance hangs on how few runs."""

    runs: int
    kurtosis: float
    effective_runs: float

    @classmethod
    def of(cls, squares: np.ndarray) -> _Tail:
        """The tail of squared deviations from the mean."""
        second, fourth = float(squares.sum()), float(squares @ squares)
        if not fourth > 0:
            return cls(len(squares), math.nan, math.nan)
        return cls(len(squares), len(squares) * fourth / second**2, second**2 / fourth)

    @property
    def is_heavy(self) -> bool:
        return self.kurtosis > _HEAVY_KURTOSIS and self.effective_runs < _FEWEST_EFFECTIVE_RUNS

    def __str__(self) -> str:
        return f"kurtosis {self.kurtosis:.3g}, {self.effective_runs:.0f} effective runs"


def moments(sample: Sample, question: Question) -> Iterator[tuple[str, xr.DataArray]]:
    """Moments of an output, with the tail's kurtosis and effective number of runs.

    Parameters
    ----------
    sample : Sample
        The runs that came back.
    question : Question
        Its output says the units.

    Yields
    ------
    name : str
        ``<output>_mean``, ``_std``, ``_half_spread``, ``_skewness``, ``_kurtosis``,
        ``_effective_runs``.
    estimate : DataArray
        Along ``bound``.
    """
    if question.output.categories:
        return
    name, units = question.output.name, question.output.unit
    title = question.output.title
    mean = float(sample.values.mean()) if sample.size else math.nan
    deviations = sample.values - mean
    tail = _Tail.of(deviations**2)
    yield f"{name}_mean", _mean(sample, mean, tail, units, f"mean of {title}")
    yield f"{name}_std", _std(sample, deviations, tail, units, f"standard deviation of {title}")
    yield f"{name}_half_spread", half_spread(sample, units, title)
    for statistic, value, why in (
        ("skewness", _skewness(deviations), "no interval was found that covers"),
        ("kurtosis", tail.kurtosis, "a diagnosis of the tail, not an estimate"),
        ("effective_runs", tail.effective_runs, "a diagnosis of the tail, not an estimate"),
    ):
        long_name = f"{statistic.replace('_', ' ')} of {title}"
        none = Interval.none(why if sample.size else reason_for_none(sample))
        yield (
            f"{name}_{statistic}",
            bounded(value, math.nan, math.nan, none, units="1", long_name=long_name),
        )


def _mean(sample: Sample, mean: float, tail: _Tail, units: str, long_name: str) -> xr.DataArray:
    if reason := reason_for_none(sample):
        none = Interval.none(reason)
        return bounded(mean, math.nan, math.nan, none, units=units, long_name=long_name)
    error, freedom = sample.standard_error(sample.values)
    half = student_quantile(freedom, LEVEL) * error
    interval = _MEAN_INTERVALS[sample.plan]
    is_doubtful = sample.plan is Plan.REPLICATED and sample.size < _FEWEST_RUNS_FOR_HEAVY_MEANS
    if is_doubtful and tail.is_heavy:
        note = f"heavy tail ({tail}): below 5 000 runs it may cover less often than it says"
        interval = replace(interval, note=note)
    elif is_doubtful and sample.size < _FEWEST_RUNS_FOR_TAILS:
        note = (
            f"fewer than {_FEWEST_RUNS_FOR_TAILS} runs do not show a heavy tail: "
            "with one it covers less often than it says"
        )
        interval = replace(interval, note=note)
    return bounded(mean, mean - half, mean + half, interval, units=units, long_name=long_name)


def _std(
    sample: Sample, deviations: np.ndarray, tail: _Tail, units: str, long_name: str
) -> xr.DataArray:
    reason = reason_for_none(sample)
    std = float(deviations.std(ddof=1)) if sample.size > 1 else math.nan
    if not reason:
        # What the sample's mean takes from the squares is its own variance, which over strata is
        # less than that of independent draws; for those it makes the divisor one run less.
        std = math.hypot(float(deviations.std()), sample.standard_error(sample.values)[0])
    if not reason and sample.size < _FEWEST_RUNS_FOR_TAILS:
        reason = f"fewer than {_FEWEST_RUNS_FOR_TAILS} runs do not show a heavy tail"
    if not reason and tail.is_heavy:
        reason = f"heavy tail ({tail}): no interval covers; see the half spread"
    if reason or not std > 0:
        none = Interval.none(reason or "the output does not vary")
        return bounded(std, math.nan, math.nan, none, units=units, long_name=long_name)
    # The delta method on log(std), whose law is closer to normal than that of std itself.
    error, freedom = sample.standard_error(deviations**2)
    half = student_quantile(freedom, LEVEL) * error / (2 * std**2)
    method = f"delta method on the logarithm, {sample.plan}"
    interval = Interval(method, "conservative" if sample.plan is Plan.SINGLE else "nominal")
    is_doubtful = tail.kurtosis > _DOUBTFUL_KURTOSIS
    if sample.size < _ENOUGH_RUNS_FOR_TAILS or (
        is_doubtful and tail.effective_runs < _FEWEST_EFFECTIVE_RUNS
    ):
        note = "if the tail is heavier than these runs show, it covers less often than it says"
        interval = replace(interval, note=note)
    lower, upper = std * math.exp(-half), std * math.exp(half)
    return bounded(std, lower, upper, interval, units=units, long_name=long_name)


def _skewness(deviations: np.ndarray) -> float:
    variance = float((deviations**2).mean()) if deviations.size else 0.0
    return float((deviations**3).mean()) / variance**1.5 if variance > 0 else math.nan

"""Expected shortfall: the mean of an output beyond a quantile."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import SHORTFALL_LEVEL
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.quantiles import has_enough_runs_around, sample_quantile
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import ENOUGH_RUNS_FOR_MEANS, ErrorModel, Sample
from uqpen.statistics.standard_errors import extreme_margins, mean_margins
from uqpen.statistics.weights import effective_sizes

# Where fewer effective runs decide the scatter beyond the quantile, there may be no mean. It is
# judged, as that of all runs is, where there are many of them.
_FEWEST_EFFECTIVE_RUNS = 3


def expected_shortfalls(
    sample: Sample, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Estimate the mean of an output beyond its quantiles at the requested levels.

    Yields
    ------
    name : str
        ``expected_shortfall``.
    estimate : DataArray
        Along ``shortfall_level``, the probability below the quantile, and ``bound``.
    """
    asked = quantity.requested(CATALOGUE["expected_shortfall"])
    if quantity.output.categories or not asked:
        return
    described = {"units": "1", "long_name": "probability of lying below the quantile"}
    levels = np.array(asked)
    array = Estimate.stack(
        [_shortfall(sample, level) for level in asked],
        SHORTFALL_LEVEL,
        units=quantity.output.unit,
        long_name=f"mean of {quantity.output.title} beyond a quantile",
        coordinates={SHORTFALL_LEVEL: (SHORTFALL_LEVEL, levels, described)},
        level=sample.level,
    )
    yield "expected_shortfall", array


def _shortfall(sample: Sample, probability: float) -> Estimate:
    """Estimate q + E(y - q)⁺/(1 - p), which is stationary in the quantile q.

    So the error of the quantile has no part in its error (Rockafellar, R. T. and Uryasev, S.
    (2000). J. Risk 2, 21-41).
    """
    if not sample.size:
        reason = sample.reason_without_intervals or texts.NO_RUN
        return Estimate.without_bounds(np.nan, reason)
    quantile = float(sample_quantile(sample, probability))
    beyond = np.maximum(sample.values - quantile, 0.0)
    excess = beyond / (1 - probability)
    value = quantile + float(excess.mean())
    if reason := _reason_without_bounds(sample, probability):
        return Estimate.without_bounds(value, reason)
    margins = mean_margins(sample, excess, is_heavy=np.asarray(True))
    # The largest runs beyond a quantile are few, so the upper end allows for one more of them.
    upper = float(margins.above + extreme_margins(excess).above)
    # A mean over replicates has their degrees of freedom, one over runs those beyond the quantile.
    factor = 1.0
    if sample.error_model is not ErrorModel.REPLICATED:
        few = student_quantile(sample.size * (1 - probability) - 1, sample.level)
        factor = few / student_quantile(sample.degrees_of_freedom, sample.level)
    # Over replicates the coverage was 95 to 100 % (`benchmarks/tail_coverage.py`).
    is_stratified = sample.error_model is not ErrorModel.INDEPENDENT
    runs_beyond = sample.size * (1 - probability)
    note = texts.DOUBTFUL_TAIL if runs_beyond < ENOUGH_RUNS_FOR_MEANS else ""
    found = Estimate(
        value,
        value - factor * float(margins.below),
        value + factor * upper,
        texts.SHORTFALL_OVER_REPLICATES
        if sample.error_model is ErrorModel.REPLICATED
        else texts.SHORTFALL,
        "conservative" if is_stratified else "nominal",
        note,
    )
    effective = float(effective_sizes(beyond**2))
    if not note and effective < _FEWEST_EFFECTIVE_RUNS:
        reason = texts.SHORTFALL_MAY_NOT_EXIST.format(runs=effective)
        return Estimate.without_bounds(value, reason)
    return found


def _reason_without_bounds(sample: Sample, probability: float) -> str:
    if reason := sample.reason_without_intervals:
        return reason
    if bool(sample.is_constant):
        return texts.CONSTANT_OUTPUT
    beyond = sample.size * probability
    return "" if bool(has_enough_runs_around(sample, beyond)) else texts.FEW_BEYOND_QUANTILE

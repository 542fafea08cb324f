"""True statistics of the model that a study is rehearsed on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from uqpen.benchmark.statistics import BenchmarkStatistic
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import EXCEEDANCE, INPUT, MOMENTS, QUANTILES
from uqpen.core.streams import Stream
from uqpen.designs.quasi_monte_carlo import SobolSequence
from uqpen.rehearsal.sources import run_once
from uqpen.statistics.analyze import analyze
from uqpen.statistics.surrogate.surrogate_draws import SurrogateDraws
from uqpen.statistics.surrogate.surrogate_indices import surrogate_indices
from uqpen.study.study import ONLY_MODEL, ValidatedStudy
from uqpen.surrogates.fitted_surrogate import FittedSurrogate

__all__ = ["large_sample", "surrogate_truth"]

_REPLICATES = 16


def surrogate_truth(
    study: ValidatedStudy,
    fitted: FittedSurrogate,
    statistics: Sequence[BenchmarkStatistic],
    sample: xr.Dataset,
) -> list[FloatArray]:
    """Return the true statistics of a surrogate: from its closed forms, else from a large sample.

    Parameters
    ----------
    study : ValidatedStudy
        With the surrogate as its model.
    fitted : FittedSurrogate
    statistics : sequence of BenchmarkStatistic
    sample : Dataset
        Runs of `large_sample`.

    Returns
    -------
    list of ndarray, shape (entry, bound)
        In SI units; the bounds are those of the sample, and NaN where there is none.
    """
    stream = Stream(study.seed, "rehearsal", "truth")
    quantities = study.quantities_of_interest
    sampled = analyze(sample, quantities, only=(MOMENTS, QUANTILES, EXCEEDANCE))
    given = study.models[ONLY_MODEL].given
    draws = SurrogateDraws(fitted, study.joint, study.constraints, given, stream)
    with_indices = {each.quantity for each in statistics if each.dimension == INPUT}
    found = {
        quantity.output.name: {
            **sampled[quantity.output.name],
            **dict(surrogate_indices(draws, quantity) if quantity in with_indices else ()),
        }
        for quantity in quantities
    }
    return [_exact_moment(draws, each, each.estimates(found)) for each in statistics]


def large_sample(study: ValidatedStudy, draws: int) -> xr.Dataset:
    """Return runs of the only model of a study at a large sample of its inputs."""
    stream = Stream(study.seed, "rehearsal", "truth")
    return run_once(study, SobolSequence(draws, _REPLICATES), stream)


def _exact_moment(
    draws: SurrogateDraws, statistic: BenchmarkStatistic, sampled: FloatArray
) -> FloatArray:
    """Return a mean or standard deviation from closed forms if there are any, else as sampled."""
    forms = draws.closed_forms_of_output(statistic.output)
    if forms is None or statistic.name not in ("mean", "std"):
        return sampled
    mean, std = forms.closed_form_moments(statistic.output)
    value = mean if statistic.name == "mean" else std
    return np.full(sampled.shape, value)

"""Statistics at the places of a field: those of a scalar output, of the runs that exist there."""

import re
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from uqpen.archive.estimates import INTERVAL_TEXTS
from uqpen.core.labels import REPLICATE, ROLE, RUN, SAMPLING, STATUS, WEIGHT
from uqpen.core.model import Dimension, Output
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.statistics import texts
from uqpen.statistics.analyze import analyze
from uqpen.statistics.distribution_function.probabilities import (
    below_probabilities,
    event_probability,
    exceedance_probabilities,
)
from uqpen.statistics.distribution_function.quantiles import quantile_estimates
from uqpen.statistics.fields import field_sample
from uqpen.statistics.moments.sample_moments import sample_moments
from uqpen.statistics.quantity_of_interest import QuantityOfInterest, Threshold
from uqpen.statistics.run_samples import sample_of

# Distributions at the places: light and heavy tails, atoms, none.
_DRAWN = [
    lambda random, runs: random.normal(size=runs),
    lambda random, runs: random.standard_cauchy(size=runs),
    lambda random, runs: np.full(runs, 0.3),
    lambda random, runs: random.integers(0, 2, runs).astype(np.float64),
    lambda random, runs: (random.random(runs) < 0.03).astype(np.float64),
    lambda random, runs: np.exp(2 * random.normal(size=runs)),
    lambda random, runs: 1e300 * random.normal(size=runs),
]
# The analyses of each place by itself; those of all places at once have tests of their own.
_AT_PLACES = ("moments", "quantiles", "exceedance", "reached")
_DESIGNS = {
    "draws": (Sampling.INDEPENDENT, {}),
    "weighted": (Sampling.INDEPENDENT, {WEIGHT: lambda random, runs: random.gamma(2, size=runs)}),
    "replicates": (Sampling.STRATIFIED, {REPLICATE: lambda random, runs: np.arange(runs) % 5}),
    "hypercube": (Sampling.STRATIFIED, {}),
    "given": (Sampling.GIVEN, {}),
}


def curve(*, may_end):
    time = Dimension("time", "s", values=tuple(map(float, range(len(_DRAWN)))))
    output = Output("curve", "m", dims=(time,), may_end=may_end)
    above, below = (Threshold("0.5", 0.5), Threshold("99", 99.0)), (Threshold("0.1", 0.1),)
    return QuantityOfInterest(output, "m", above, below, (0.01, 0.5, 0.9))


def runs_of(design, runs, lost, seed, *, may_end):
    """Runs of a curve, with another distribution at each place."""
    random = np.random.default_rng(seed)
    values = np.stack([drawn(random, runs) for drawn in _DRAWN], axis=1)
    if may_end:
        ends = random.integers(1, len(_DRAWN) + 1, runs)
        values[np.arange(len(_DRAWN)) >= ends[:, np.newaxis]] = np.nan
    status = np.full(runs, int(Status.OK), dtype=np.int8)
    status[:lost] = Status.CRASHED
    values[:lost] = np.nan
    sampling, columns = _DESIGNS[design]
    inputs = {name: (RUN, random.random(runs), {ROLE: "input"}) for name in "ab"}
    described = {name: (RUN, make(random, runs)) for name, make in columns.items()}
    return xr.Dataset(
        {**inputs, "curve": ((RUN, "time"), values), STATUS: (RUN, status)},
        {RUN: np.arange(runs), **described},
        {SAMPLING: str(sampling)},
    )


def of_a_scalar(runs, place, quantity):
    """The statistics of one place, as those of a scalar output in the runs that exist there."""
    whole = replace(sample_of(runs, "curve"), level=quantity.confidence_level)
    exists = ~np.isnan(whole.values[:, place])
    sample = replace(whole, values=whole.values[exists, place], used=whole.used[exists])
    scalar = replace(quantity, output=Output("curve", "m"))
    yield from islice(sample_moments(sample, scalar), 2)
    yield from quantile_estimates(sample, scalar)
    yield from exceedance_probabilities(sample, scalar)
    yield from below_probabilities(sample, scalar)
    if quantity.output.may_end:
        share = event_probability(replace(whole, values=exists.astype(np.float64)), exists)
        yield "reached", share.to_array(units="1", long_name="")


def without_numbers(text):
    """A text of a scalar output, as it is at places."""
    text = re.sub(r"heavy tail \(.*?\)", texts.HEAVY_TAIL_AT_PLACES, text)
    text = re.sub(r"\A\d+ runs are too few", texts.TOO_FEW_RUNS_AT_PLACES, text)
    text = re.sub(r"an effective sample size of \S+", "the effective sample size", text)
    text = re.sub(r"\d+ effective runs decide", "few effective runs decide", text)
    return text.removesuffix(f"; {texts.SEE_HALF_SPREAD}")


@settings(max_examples=10, deadline=None)
@given(
    st.sampled_from(sorted(_DESIGNS)),
    st.sampled_from([2, 20, 250, 2500]),
    st.sampled_from([0, 1, 7]),
    st.integers(0, 99),
    st.booleans(),
)
def test_each_place_has_the_statistics_of_a_scalar_output(design, size, lost, seed, may_end):
    runs = runs_of(design, size, min(lost, size - 1), seed, may_end=may_end)
    quantity = curve(may_end=may_end)
    found = analyze(runs, [quantity], only=_AT_PLACES)["curve"]
    for place in range(len(_DRAWN)):
        expected = dict(of_a_scalar(runs, place, quantity))
        assert found.keys() == expected.keys()
        for name, array in expected.items():
            at_place = found[name][place]
            np.testing.assert_allclose(at_place.values, array.values, rtol=1e-12, atol=0)
            for text in INTERVAL_TEXTS:
                shown = np.vectorize(without_numbers, otypes=[object])(array.coords[text].values)
                np.testing.assert_array_equal(at_place.coords[text].values, shown)


@pytest.mark.parametrize("design", _DESIGNS)
def test_the_places_that_are_taken_together_do_not_matter(design, monkeypatch):
    runs, quantity = runs_of(design, 300, 2, 5, may_end=True), curve(may_end=True)
    whole = analyze(runs, [quantity])["curve"]
    monkeypatch.setattr(field_sample, "_MOST_VALUES", 1)
    for name, array in analyze(runs, [quantity])["curve"].items():
        assert array.identical(whole[name])


def test_statistics_of_a_curve_that_ends_are_of_the_runs_that_reach_the_place():
    runs = runs_of("draws", 60, 0, 1, may_end=True)
    runs[STATUS][:4] = Status.INADMISSIBLE
    found = analyze(runs, [curve(may_end=True)])["curve"]
    assert found["mean"].attrs["conditional_on"] == (
        "admissible inputs and the curve's reaching the place"
    )
    assert found["reached"].attrs["conditional_on"] == "admissible inputs"
    shares = (~np.isnan(runs["curve"].values[4:])).mean(axis=0)
    np.testing.assert_allclose(found["reached"].values[:, 0], shares)


def test_a_place_that_no_run_reaches_says_so():
    runs = runs_of("draws", 60, 0, 1, may_end=False)
    runs["curve"][:, -1] = np.nan
    runs["curve"][2:, -2] = np.nan
    runs["curve"][1:, -3] = np.nan
    mean = analyze(runs, [curve(may_end=True)])["curve"]["mean"]
    assert mean.coords["note"].values[-3:].tolist() == [
        texts.SINGLE_RUN,
        texts.DOUBTFUL_TAIL,
        texts.NO_RUN,
    ]
    assert np.isnan(mean.values[-1]).all()

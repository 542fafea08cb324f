"""Estimates from growing parts of a design's runs."""

import json
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from study_text import study_text

import uqpen
from uqpen.archive.estimates import INTERVAL_TEXTS, interval_text
from uqpen.core.labels import REPLICATE
from uqpen.core.model import Category, Output
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.results.json import archive_json
from uqpen.results.long_table import long_table
from uqpen.results.source_statistics import SourceStatistics
from uqpen.statistics import texts
from uqpen.statistics.analyze import analyze
from uqpen.statistics.convergence import reason_without_parts
from uqpen.statistics.quantity_of_interest import QuantityOfInterest, Threshold

Y = QuantityOfInterest(
    Output("y", "m"), "m", thresholds=(Threshold("1 m", 1.0), Threshold("2 m", 2.0))
)
KIND = QuantityOfInterest(
    Output("kind", "1", "", "", (Category("a", "A"), Category("b", "B"))), "1"
)

STUDY = study_text(
    "ishigami",
    seed=4,
    inputs={"x1": (-3, 3), "x2": (-3, 3), "x3": (-3, 3)},
    outputs={"y": {"exceeds": [8]}},
    designs={
        "independent": {"kind": "monte-carlo", "runs": 330},
        "replicated": {"kind": "latin-hypercube", "runs": 300},
        "blocks": {"kind": "saltelli", "base": 64},
    },
)


def runs_of(sampling, count, replicate=None):
    generator = np.random.default_rng(7)
    coordinates = {} if replicate is None else {REPLICATE: ("run", replicate)}
    return xr.Dataset(
        {
            "x": ("run", generator.random(count), {"role": "input"}),
            "y": ("run", generator.lognormal(size=count), {"role": "output"}),
            "kind": ("run", generator.integers(0, 2, count), {"role": "output"}),
            "status": ("run", np.zeros(count, dtype=np.int8)),
        },
        {"run": np.arange(count), **coordinates},
        {"sampling": str(sampling)},
    )


def convergence(runs, quantities):
    """What follows the runs so far, by output and by the statistic that it is of."""
    found = analyze(runs, quantities, only=("convergence",))
    return {output: followed(reported) for output, reported in found.items()}


def followed(statistics):
    return {
        name.removeprefix("convergence_"): array
        for name, array in statistics.items()
        if "runs_so_far" in array.dims
    }


def sizes(runs):
    reported = convergence(runs, [Y])["y"]
    return [int(size) for size in reported["mean"]["runs_so_far"].values] if reported else []


def assert_same(last, whole):
    """Figures are the same to the bit, and so is what they say of themselves."""
    assert last.values.tobytes() == whole.values.tobytes()
    entries = [(last, whole)] if whole.ndim == 1 else list(zip(last, whole, strict=True))
    for one, other in entries:
        assert [interval_text(one, what) for what in INTERVAL_TEXTS] == [
            interval_text(other, what) for what in INTERVAL_TEXTS
        ]


@pytest.fixture(scope="module")
def tree():
    return uqpen.run(uqpen.parse_study(STUDY))


@pytest.mark.processor
@pytest.mark.slow
def test_the_last_part_is_what_the_archive_tells(tree):
    for design in ("independent", "replicated", "blocks"):
        archived = SourceStatistics(tree).statistics(design, "y")
        answers = followed(archived)
        assert set(answers) == {"mean", "quantile", "exceedance"}
        for name, parts in answers.items():
            assert_same(parts[-1], archived[name])
            assert parts.attrs["units"] == archived[name].attrs["units"]


@pytest.mark.slow
def test_it_is_in_no_table_unless_it_is_asked_for(tree):
    detailed = {"percentile", "convergence_mean", "convergence_quantile", "convergence_exceedance"}
    assert not detailed & set(long_table(tree)["statistic"])
    assert detailed <= set(long_table(tree, functions=True)["statistic"])
    assert not any(name in json.dumps(archive_json(tree)) for name in detailed)


def test_percentiles_are_quantiles_with_their_intervals():
    asked = replace(Y, quantiles=(0.05, 0.5, 0.99))
    for runs in (
        runs_of(Sampling.INDEPENDENT, 130),
        runs_of(Sampling.STRATIFIED, 240, np.repeat(np.arange(4), 60)),
    ):
        found = analyze(runs, [asked])["y"]
        assert_same(found["percentile"].sel(percent=[5, 50, 99]), found["quantile"])
        assert found["percentile"]["percent"].values.tolist() == [1, 5, 10, 25, 50, 75, 90, 95, 99]


def test_the_first_draws_are_a_smaller_sample():
    runs = runs_of(Sampling.INDEPENDENT, 130)
    runs["status"][3] = Status.FAILED
    answers = convergence(runs, [Y, KIND])
    assert answers["kind"]["share"]["runs_so_far"].values.tolist() == [20, 30, 50, 100, 130]
    alone = analyze(runs.isel(run=slice(50)), [Y, KIND])
    for output, statistics in answers.items():
        for name, parts in statistics.items():
            assert_same(parts[2], alone[output][name])
    note = interval_text(answers["y"]["exceedance"][0, 1], "note")
    assert note == "allows for any outcome of the missing runs (1)"
    assert answers["y"]["exceedance"]["threshold"].values.tolist() == ["1 m", "2 m"]


def test_replicates_are_taken_whole_wherever_their_runs_stand():
    mixed = np.random.default_rng(2).permutation(np.repeat(np.arange(4), 60))
    runs = runs_of(Sampling.STRATIFIED, 240, mixed)
    answers = convergence(runs, [Y])
    assert answers["y"]["mean"]["runs_so_far"].values.tolist() == [120, 180, 240]
    alone = analyze(runs.isel(run=mixed < 3), [Y])["y"]
    assert_same(answers["y"]["mean"][1], alone["mean"])
    assert interval_text(answers["y"]["mean"][0], "interval") == texts.STUDENT_FOR_SKEWED_REPLICATES


@pytest.mark.parametrize(
    ("sampling", "count", "replicates", "expected"),
    [
        (Sampling.INDEPENDENT, 25, 0, [20, 25]),
        (Sampling.INDEPENDENT, 1000, 0, [20, 30, 50, 100, 200, 300, 500, 1000]),
        (Sampling.INDEPENDENT, 240_000, 0, [30, 100, 300, 1000, 3000, 10_000, 30_000, 100_000]),
        (Sampling.STRATIFIED, 300, 10, [60, 90, 120, 150, 210, 300]),
        (Sampling.STRATIFIED, 240_000, 10, [48_000, 96_000, 192_000, 240_000]),
    ],
)
def test_parts_grow_in_round_steps(sampling, count, replicates, expected):
    replicate = np.repeat(np.arange(replicates), count // replicates) if replicates else None
    expected = expected if expected[-1] == count else [*expected, count]
    assert sizes(runs_of(sampling, count, replicate)) == expected


def test_there_are_sixteen_parts_at_the_most():
    assert len(sizes(runs_of(Sampling.STRATIFIED, 1000, np.repeat(np.arange(500), 2)))) == 16


@pytest.mark.parametrize(
    ("sampling", "count", "replicates", "reason"),
    [
        (
            Sampling.STRATIFIED,
            100,
            1,
            "its points are one stratified set, of which no part is a stratified set",
        ),
        (
            Sampling.GIVEN,
            100,
            0,
            "its points are not declared independent, so no part is known to be like the whole",
        ),
        (Sampling.STRATIFIED, 100, 2, "it has only two replicates, and an error needs two"),
        (Sampling.INDEPENDENT, 24, 0, "it has only 24 runs"),
        (Sampling.QUADRATURE, 24, 0, "its points are not a sample of the input distribution"),
    ],
)
def test_what_cannot_be_divided_says_why(sampling, count, replicates, reason):
    replicate = np.repeat(np.arange(replicates), count // replicates) if replicates else None
    runs = runs_of(sampling, count, replicate)
    assert reason_without_parts(runs) == reason
    assert convergence(runs, [Y]) == {"y": {}}


def test_runs_that_were_all_lost_have_no_figures():
    runs = runs_of(Sampling.INDEPENDENT, 60)
    runs["status"][:30] = Status.CRASHED
    means = convergence(runs, [Y])["y"]["mean"]
    assert np.isnan(means.values[:2]).all()
    assert interval_text(means[0], "note") == "no run completed"
    assert np.isfinite(means.values[-1]).all()

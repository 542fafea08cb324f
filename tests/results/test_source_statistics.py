"""Statistics of all sources side by side, beside the runs that each took."""

from collections import Counter

import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.archive.read import open_archive
from uqpen.archive.write import write
from uqpen.core.catalogue import REQUESTED
from uqpen.report.page import report_page
from uqpen.results.json import archive_json
from uqpen.results.source_statistics import SourceStatistics

DESIGNS = """
[outputs.y]
exceeds = [0.5, 1.5]
[designs.mc]
kind = "monte-carlo"
runs = 400
[designs.blocks]
kind = "saltelli"
base = 256
[designs.steps]
kind = "one-at-a-time"
[surrogates.pce]
kind = "polynomial-chaos"
design = "mc"
check = "fresh"
[designs.fresh]
kind = "monte-carlo"
runs = 100
"""


@pytest.fixture(scope="module")
def tree(module_study_of):
    return uqpen.run(module_study_of("a + b**2", DESIGNS, a=(0, 1), b=(0, 1)))


def test_each_source_stands_with_its_runs(tree):
    statistics = SourceStatistics(tree)
    assert statistics.sources == ["mc", "blocks", "steps", "fresh", "pce"]
    kinds = [statistics.kind(source) for source in statistics.sources]
    assert kinds == ["design"] * 4 + ["surrogate"]
    # The surrogate takes the runs that it is fitted to and those that check it.
    spent = [int(tree[f"statistics/{name}"].attrs["runs_spent"]) for name in statistics.sources]
    assert spent == [400, 1024, 5, 100, 500]


def test_a_source_has_what_it_tells_and_nothing_else(tree):
    statistics = SourceStatistics(tree)
    assert statistics.get("steps", "y", "mean") is None
    assert list(statistics.by_source("y", "mean")) == ["mc", "blocks", "fresh", "pce"]
    assert list(statistics.by_source("y", "response")) == ["steps"]
    response = statistics.statistics("steps", "y")["response"]
    assert np.isfinite(response.sel(bound="estimate")).all()


@pytest.mark.processor
def test_statistics_read_back_from_an_archive(tree, tmp_path):
    write(tree, tmp_path / "all.nc")
    made, read = SourceStatistics(tree), SourceStatistics(open_archive(tmp_path / "all.nc"))
    assert read.sources == made.sources
    for source in made.sources:
        for name, array in made.statistics(source, "y").items():
            xr.testing.assert_equal(read.statistics(source, "y")[name], array)


def test_a_source_that_tells_of_more_inputs_stands_beside_one_that_tells_of_fewer(study_of):
    text = """
    [designs.mc]
    kind = "monte-carlo"
    runs = 200
    [designs.steps]
    kind = "one-at-a-time"
    fixed = true
    """
    tree = uqpen.run(study_of("a + b * c", text, a=(1, 2), b=(1, 2), c=3.0))
    responses = tree["statistics/steps/y"]["response"].sel(bound="estimate")
    assert responses["input"].values.tolist() == ["a", "b", "c"]
    assert np.isfinite(responses).all()
    first = tree["statistics/mc/y"]["first_order"].sel(bound="estimate")
    assert first["input"].values.tolist() == ["a", "b"]
    assert np.isfinite(first).all()


def test_entries_are_those_of_a_statistic_by_their_labels(tree):
    statistics = SourceStatistics(tree)
    for statistic in ("quantile", "exceedance", "percentile"):
        array = statistics.get("mc", "y", statistic)
        assert array is not None
        found = statistics.entries("mc", "y", statistic)
        assert list(found) == array[array.dims[0]].values.tolist()
        for entry, expected in zip(found.values(), array, strict=True):
            xr.testing.assert_identical(entry, expected)
    assert statistics.entries("steps", "y", "exceedance") == {}


def test_a_page_takes_each_threshold_out_of_its_array_once(study_of, monkeypatch):
    taken, isel = Counter[int](), xr.DataArray.isel

    def counted(self, *arguments, **options):
        taken[number] += 1
        return isel(self, *arguments, **options)

    monkeypatch.setattr(xr.DataArray, "isel", counted)
    for number in (10, 30):
        limits = np.linspace(0.3, 1.5, number).round(4).tolist()
        design = '[designs.mc]\nkind = "monte-carlo"\nruns = 100'
        asked = study_of("a + b", f"[outputs.y]\nexceeds = {limits}\n{design}", a=(0, 1), b=(0, 1))
        report_page(uqpen.run(asked))
    # Of the probability and of the indices of an event.
    assert taken[30] - taken[10] <= 20 * 2


REQUESTS = """
[outputs.y]
exceeds = [0.5]
below = [0.2]
hold = [0.9]
hold_above = [0.9]
hold_between = [0.9]
expected_shortfall = [0.9]
return_periods = [50]
[designs.mc]
kind = "monte-carlo"
runs = 600
[designs.blocks]
kind = "saltelli"
base = 64
[designs.rule]
kind = "quadrature"
order = 2
[designs.paths]
kind = "morris"
trajectories = 4
[designs.steps]
kind = "one-at-a-time"
[designs.rare]
kind = "subset-simulation"
event = "y > 1.9"
samples = 100
[surrogates.pce]
kind = "polynomial-chaos"
design = "mc"
order = 2
"""


def test_each_source_has_what_a_study_asks_for_or_says_why_not(study_of):
    tree = uqpen.run(study_of("a + b", REQUESTS, a=(0.0, 1.0), b=(0.0, 1.0)))
    statistics, reported = SourceStatistics(tree), archive_json(tree)
    sources = {**reported["designs"], **reported["surrogates"]}
    assert sources.keys() == {*statistics.sources}
    for source, found in sources.items():
        output = found["outputs"]["y"]
        for statistic in REQUESTED:
            key = statistic.shown.json
            reason = output.get("not_estimated", {}).get(key, "")
            assert (key in output) != ("not estimated" in reason), (source, key)
            if key in output:
                for entry in output[key].values():
                    known = entry["estimate"], entry["lower"], entry["upper"]
                    assert any(each is not None for each in known) or entry["note"], key

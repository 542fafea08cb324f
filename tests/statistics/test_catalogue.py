"""The catalogue of statistics: what analyses yield is in it, and is packed without a loss."""

import re

import numpy as np
import pytest
import xarray as xr
from catalogue_tables import PAGE, with_tables
from hypothesis import given
from hypothesis import strategies as st

import uqpen
from uqpen.archive.estimates import INTERVAL_TEXTS, estimate_array, pack, statistic_names, unpack
from uqpen.core.catalogue import (
    CATALOGUE,
    FAILURE_STATISTICS,
    JOINT_STATISTICS,
    MEASURES,
    REQUESTED,
)
from uqpen.core.lookup import resolve
from uqpen.core.model import Output
from uqpen.core.statistic import UnitRule
from uqpen.results.source_statistics import SourceStatistics
from uqpen.statistics.analyze import analyze, analyze_failures
from uqpen.statistics.quantity_of_interest import QuantityOfInterest, Threshold

# In metres, so that values of the output and plain numbers are distinguished.
LENGTH = QuantityOfInterest(
    Output("y", "m"),
    "m",
    quantiles=(0.5,),
    tolerance_contents=(0.95,),
    thresholds=(Threshold("2 m", 2.0),),
)

# A fifth of the runs is lost.
LOSSY = "np.where(a > 0.8, np.nan, np.exp(a + b))"

DESIGNS = """
[outputs.y]
exceeds = [2, 3]
[designs.mc]
kind = "monte-carlo"
runs = 300
[designs.blocks]
kind = "saltelli"
base = 64
[designs.grid]
kind = "quadrature"
order = 3
[designs.paths]
kind = "morris"
trajectories = 10
[designs.steps]
kind = "one-at-a-time"
"""


@pytest.mark.parametrize("statistic", CATALOGUE.values(), ids=lambda each: each.name)
def test_a_record_names_what_there_is(statistic):
    for reference in filter(None, (*statistic.by.values(), statistic.asked.declared_by)):
        assert callable(resolve(reference))
    # A correction by runs or stand-ins takes the place of an estimate, which another record makes.
    estimated = statistic.by.keys() - {"corrected", "stand_ins"}
    assert bool(statistic.group) or not estimated, "what is estimated can be left out"
    if statistic.own:
        assert statistic.own.name in statistic.dims
    if statistic.asked.key:
        assert statistic.shown.label, "what is asked for is shown"
        assert hasattr(LENGTH, statistic.asked.attribute)


@pytest.mark.parametrize(
    "statistic", [each for each in CATALOGUE.values() if each.of], ids=lambda each: each.name
)
def test_a_statistic_that_follows_from_another_is_of_the_same_entries(statistic):
    of = CATALOGUE[statistic.of]
    assert statistic.name == statistic.prefix + of.name
    assert of.title in statistic.title
    assert statistic.dims[len(statistic.dims) - len(of.dims) :] == of.dims
    assert (statistic.unit, statistic.recipe) == (of.unit, of.recipe)
    assert not statistic.asked.key


def test_every_statistic_of_the_inputs_is_a_measure_with_words_and_a_place_of_its_own():
    every = (*CATALOGUE.values(), *JOINT_STATISTICS.values())
    of_inputs = [each for each in every if of_input(each)]
    assert [each.name for each in of_inputs if not each.measure.label] == []
    assert sorted(each.name for each in of_inputs) == sorted(
        each.name for table in MEASURES.values() for each in table if of_input(each)
    )
    for each in of_inputs:
        if each.measure.reason:
            assert each.measure.share or "{input}" in each.measure.sentence, each.name


def of_input(statistic):
    return not {"input", "pair"}.isdisjoint(statistic.dims)


def has_dims_of(array, entry):
    return array.dims == (*entry.dims, *(("bound",) if entry.has_bounds else ()))


@pytest.mark.slow
def test_every_statistic_that_analyses_yield_is_in_the_catalogue_with_these_dims_and_unit(study_of):
    tree = uqpen.run(study_of(LOSSY, DESIGNS, a=(0, 1), b=(0, 1)))
    seen = set()
    for design in ("mc", "blocks", "grid", "paths", "steps"):
        runs = tree[f"runs/{design}"].to_dataset()
        statistics = analyze(runs, [LENGTH])["y"]
        assert list(statistics) == [name for name in CATALOGUE if name in statistics]
        for name, array in statistics.items():
            entry = CATALOGUE[name]
            assert has_dims_of(array, entry), name
            assert array.attrs["units"] == ("1" if entry.unit is UnitRule.NONE else "m"), name
        seen |= set(statistics)
    assert {"mean", "quantile", "cdf_band", "pearson", "total_order", "mu", "response"} <= seen


def test_every_statistic_of_failures_is_in_the_catalogue_with_these_dims(study_of):
    tree = uqpen.run(study_of(LOSSY, DESIGNS, a=(0, 1), b=(0, 1)))
    found = analyze_failures(tree["runs/mc"].to_dataset())
    assert set(found) == set(FAILURE_STATISTICS)
    for name, array in found.items():
        assert has_dims_of(array, FAILURE_STATISTICS[name]), name


def test_counts_of_runs_are_those_of_each_statistic(study_of):
    # Of blocks, A and B are a sample; the others serve the indices alone.
    text = '[designs.blocks]\nkind = "saltelli"\nbase = 64\n'
    tree = uqpen.run(study_of(LOSSY, text, a=(0, 1), b=(0, 1)))
    runs = tree["runs/blocks"].to_dataset()
    is_lost = np.isnan(runs["y"].values)
    is_drawn = np.isin(runs["matrix"].values, (0, 1))
    statistics = SourceStatistics(tree).statistics("blocks", "y")
    for name, of in (("pearson", is_drawn), ("mean", is_drawn), ("total_order", is_drawn | True)):
        attributes = statistics[name].attrs
        assert attributes["runs"] == of.sum(), name
        assert attributes["runs_used"] == (of & ~is_lost).sum(), name
        assert attributes["runs_not_finite"] == (of & is_lost).sum(), name
    assert statistics["pearson"].attrs["runs"] == 128
    assert statistics["first_order"].attrs["runs"] == 256
    assert "blocks_used" not in statistics["pearson"].attrs
    assert statistics["first_order"].attrs["blocks_used"] < 64


TEXTS = st.sampled_from(["", "none", "nominal", "Student t", "a note; another", "中"])


@st.composite
def estimate_arrays(draw):
    sizes = draw(st.lists(st.integers(1, 4), max_size=2))
    dims = dict(zip(("threshold", "input"), sizes, strict=False))
    size = int(np.prod(list(dims.values()), dtype=int))
    values = draw(st.lists(st.floats(), min_size=3 * size, max_size=3 * size))
    each = st.lists(TEXTS, min_size=size, max_size=size)
    texts = {name: draw(each | TEXTS) for name in INTERVAL_TEXTS}
    return estimate_array(values, dims, texts, units="m", long_name="what it is")


@pytest.mark.slow
@given(array=estimate_arrays())
def test_what_is_packed_is_unpacked_the_same(array):
    packed = pack({"mean": array})
    assert statistic_names(packed) == ["mean"]
    unpacked = unpack(packed, "mean")
    assert unpacked is not None
    assert unpacked.values.tobytes() == array.values.tobytes()
    assert unpacked.attrs == array.attrs
    for name in INTERVAL_TEXTS:
        assert unpacked.coords[name].dims == array.coords[name].dims
        assert unpacked.coords[name].values.tolist() == array.coords[name].values.tolist()


def test_what_a_dataset_does_not_have_is_none():
    assert unpack(xr.Dataset(), "mean") is None


def test_the_tables_of_the_documentation_are_those_of_the_records():
    text = PAGE.read_text(encoding="utf-8")
    assert with_tables(text) == text, "python tests/catalogue_tables.py writes them"


def test_the_documentation_has_each_key_by_which_a_study_asks():
    page = (PAGE.parent / "study_file.md").read_text(encoding="utf-8")
    keys = re.findall(r"^\| `(\w+) = ", page, re.MULTILINE)
    assert {each.asked.key for each in REQUESTED} <= {*keys}

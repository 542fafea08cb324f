"""Statistics of an output that some runs do not have: they are of the others, and say so."""

from functools import cache

import numpy as np
import pytest

import uqpen
from uqpen.archive.estimates import interval_text
from uqpen.report.page import report_page
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables
from uqpen.results.source_statistics import SourceStatistics

TIMES = np.linspace(0.0, 1.0, 11)
FIELD = uqpen.OutputSpec("1", along={"time": {"unit": "s", "from": 0, "to": 1, "size": 11}})


def study(design, **more):
    return uqpen.Study(
        model=lambda x, z: {"curve": x * TIMES, "plain": z},
        inputs={"x": uqpen.Uniform(0.0, 1.0), "z": uqpen.Uniform(0.0, 1.0)},
        outputs={
            "curve": FIELD,
            "plain": "1",
            "crossing": uqpen.OutputSpec(
                of="curve", take="first_above", threshold=0.5, exceeds=["0.8 s"], hold=[0.9]
            ),
        },
        designs={"d": design},
        seed=1,
        **more,
    )


DESIGNS = {
    "independent": uqpen.MonteCarlo(runs=400),
    "replicated": uqpen.LatinHypercube(runs=400, replicates=20),
    "pick-freeze": uqpen.Saltelli(base=64, replicates=8),
}


@cache
def made(design):
    return uqpen.run(study(DESIGNS[design]))


CONDITION = "its existence (curve never exceeds 0.5 in {share:.3g} % of the completed runs)"


@pytest.fixture(scope="module", params=DESIGNS)
def tree(request):
    return made(request.param)


def sampled(tree):
    runs = tree["runs/d"].to_dataset()
    return runs.isel(run=runs["matrix"].values <= 1) if "matrix" in runs else runs


def test_a_statistic_is_of_the_runs_with_a_value(tree):
    runs = sampled(tree)
    exists = runs["x"].values > 0.5
    crossing = runs["crossing"].values
    assert crossing[exists] == pytest.approx(0.5 / runs["x"].values[exists])
    assert np.isnan(crossing[~exists]).all()
    mean = tree["statistics/d/crossing/mean"]
    assert mean.values[0] == pytest.approx(crossing[exists].mean(), rel=0.02)
    # The distribution given x > 0.5: the mean of 0.5 / x is log 2, and half a unit is its share.
    assert mean.values[1] < np.log(2) < mean.values[2]
    exceedance = tree["statistics/d/crossing/exceedance"].values[0]
    assert exceedance[1] < 2 * (0.625 - 0.5) < exceedance[2]


def test_it_says_what_it_is_conditional_on(tree):
    runs = sampled(tree)
    absent = int((runs["x"] <= 0.5).sum())
    share = 100 * absent / runs.sizes["run"]
    attributes = tree["statistics/d/crossing/mean"].attrs
    assert attributes["conditional_on"] == CONDITION.format(share=share)
    assert attributes["runs_absent"] == absent
    assert attributes["runs_used"] == runs.sizes["run"] - absent
    assert "missing" not in attributes
    assert "conditional_on" not in tree["statistics/d/plain/mean"].attrs


def test_its_companion_counts_all_runs(tree):
    share = tree["statistics/d/crossing_occurs/share"]
    assert share["category"].values.tolist() == ["occurs", "absent"]
    assert (share.values[:, 1] < 0.5).all()
    assert (share.values[:, 2] > 0.5).all()


def test_tables_and_json_say_it(tree):
    runs = sampled(tree)
    absent = int((runs["x"] <= 0.5).sum())
    table = next(each for each in output_tables(tree) if each.title.startswith("crossing ["))
    cell = dict(table.rows)["without a value"][0]
    assert cell.startswith(str(absent))
    assert any(
        note.startswith("statistics are conditional on its existence") for note in table.notes
    )
    content = archive_json(tree)["designs"]["d"]["outputs"]
    assert content["crossing"]["runs_absent"] == absent
    assert "runs_absent" not in content["plain"]


def test_indices_of_blocks_are_of_those_with_values():
    tree = made("pick-freeze")
    first = tree["statistics/d/crossing/first_order"]
    assert first.attrs["estimand"].endswith("; blocks with a run without a value are left out")
    whole = tree["statistics/d/plain/first_order"]
    assert first.attrs["blocks_used"] < whole.attrs["blocks_used"] == 64
    assert first.sel(input="z").values[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("design", "statistic", "said"),
    [
        (uqpen.Morris(trajectories=10), "mu_star", "effects are missing because a run gave no"),
        (uqpen.Quadrature(order=3), "mean", "of 16 nodes gave no value"),
    ],
    ids=["effects", "nodes"],
)
def test_what_a_design_lacks_is_no_failure(design, statistic, said):
    array = SourceStatistics(uqpen.run(study(design))).get("d", "crossing", statistic)
    assert array is not None
    assert said in interval_text(array if array.ndim == 1 else array[0], "note")
    assert "its existence" in array.attrs["conditional_on"]


def test_a_surrogate_is_refused_with_the_reason():
    surrogate = uqpen.PolynomialChaos(design="d", order=2)
    tree = uqpen.run(study(DESIGNS["independent"], surrogates={"pce": surrogate}))
    reason = tree["surrogates/pce/crossing"].attrs["not_fitted"]
    absent = int((tree["runs/d/x"] <= 0.5).sum())
    assert reason == f"some runs have no value of it (curve never exceeds 0.5 in {absent})"


def test_an_event_of_several_outputs_is_of_the_runs_that_have_all():
    events = {"both": ["crossing < 0.8 s", "plain < 0.5"], "one": ["plain < 0.5"]}
    tree = uqpen.run(study(DESIGNS["independent"], joint_probabilities=events))
    runs, found = tree["runs/d"].to_dataset(), SourceStatistics(tree).joint_probability("d")
    assert found is not None
    has_all = runs["crossing"].notnull().values
    both = (runs["crossing"].values < 0.8) & (runs["plain"].values < 0.5)
    assert found.values[0, 0] == both[has_all].mean()
    assert found.values[1, 0] == (runs["plain"] < 0.5).mean()
    notes = found["note"].values.tolist()
    assert "of the runs in which all its outputs have a value" in notes[0]
    assert "value" not in notes[1]


def test_a_claim_is_of_the_runs_with_a_value():
    # Given x > 0.5, the crossing is after 0.8 in a quarter of the runs; of all, in an eighth.
    claim = "P(crossing > 0.8 s) > 0.15"
    tree = uqpen.run(study(uqpen.MonteCarlo(at_most=5000, accept=claim)))
    assert tree["statistics/d"].attrs["decision"] == "held"
    exceedance = tree["statistics/d/crossing/exceedance"].values[0]
    assert exceedance[1] < 0.25 < exceedance[2]


@pytest.mark.slow
@pytest.mark.parametrize("threshold", [0.5, 2.0])
def test_a_report_is_written_even_if_no_run_has_a_value(threshold):
    made = uqpen.Study(
        model=lambda x: {"curve": x * TIMES},
        inputs={"x": uqpen.Uniform(0.0, 1.0)},
        outputs={
            "curve": FIELD,
            "crossing": uqpen.OutputSpec(of="curve", take="first_above", threshold=threshold),
            "peak": uqpen.OutputSpec(of="curve", take="max"),
        },
        designs={"d": uqpen.MonteCarlo(runs=50)},
        seed=1,
    )
    page = report_page(uqpen.run(made))
    has_values = threshold < 1
    assert ("Some estimates are conditional" in page) == has_values


@pytest.mark.parametrize(
    ("threshold", "note"),
    [
        (0.5, "from the step up only: the other run gave no value"),
        (0.6, "the run at the nominal point gave no value"),
    ],
)
def test_a_response_without_a_value_is_no_failed_run(threshold, note):
    made = uqpen.Study(
        model=lambda x: {"curve": x * (1 + TIMES)},
        inputs={"x": uqpen.Uniform(0.0, 0.5 + 1e-9)},
        outputs={
            "curve": FIELD,
            "crossing": uqpen.OutputSpec(of="curve", take="first_above", threshold=threshold),
        },
        designs={"d": uqpen.OneAtATime(step=0.1)},
        seed=1,
    )
    response = uqpen.run(made)["statistics/d/crossing/response"]
    assert note in response.attrs["note"]
